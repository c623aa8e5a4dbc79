"""One level of a QP cascade in its free directions: the factored equality rows, and a level of equalities alone.

Z (n, d) is an orthonormal basis of the directions that finished levels leave free. A level's rows come scaled by powers of
two (`scaled_rows`).
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.blocked import turned_rows
from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import EPS, factor, forward_substitution, frobenius, lower_block


@kernel
def scaled_rows(A, lower, upper, row_by_row):
    """(A, lower, upper) times powers of two that bring the largest entry (of each row) into [1/2, 1); False on overflow."""
    m, n = A.shape
    rows = np.empty((m, n))
    low = np.empty(m)
    up = np.empty(m)
    fits = True
    whole = 0.0
    for i in range(m):
        for j in range(n):
            whole = max(whole, abs(A[i, j]))
    for i in range(m):
        big = whole
        if row_by_row:
            big = 0.0
            for j in range(n):
                big = max(big, abs(A[i, j]))
        e = -math.frexp(big)[1] if big > 0.0 else 0
        half = math.ldexp(1.0, e // 2)  # the whole power may overflow
        rest = math.ldexp(1.0, e - e // 2)
        for j in range(n):
            rows[i, j] = A[i, j] * half * rest
        low[i] = lower[i] * half * rest
        up[i] = upper[i] * half * rest
        if low[i] == np.inf or up[i] == -np.inf:
            fits = False
    return rows, low, up, fits


@kernel
def power_of_two(largest):
    """The power of two above `largest`; 0 for 0."""
    return math.ldexp(1.0, math.frexp(largest)[1]) if 0.0 < largest < np.inf else 0.0


@kernel
def factored(E, Z, A, tol):
    """Factor E Z by the rank rule of A and turn Z with it.

    Returns (L, r, rank, U, S, order, ZQ): E Z Q = L (m, r) or U S (then U, S are not empty); order: which row of E each row
    of L is. The first `rank` columns of ZQ (n, d) are what E takes.
    """
    m = len(E)
    L = np.dot(E, Z)
    order = np.arange(m) * 1.0
    ref = np.empty(m, np.int64)
    tau = np.empty(m)
    r, rank, V, U, S = factor(L, 0, m, 0, m, order, A, 0, len(A), 1.0, tol, False, 0, ref, np.empty(m, np.int64), tau)
    ZQ = turned_rows(Z, L, r, tau, V)
    if r > 0 and len(S) == 0 and r < m:
        U, S = by_svd(L, r, ZQ)
    return L, r, rank, U, S, order, ZQ


@kernel
def by_svd(L, r, ZQ):
    """U, S of L = U S V^T, proven to be of rank r; ZQ is turned by V in place."""
    U, S, Vt = np.linalg.svd(lower_block(L, 0, len(L), 0, r), False)
    ZQ[:, :r] = np.dot(np.ascontiguousarray(ZQ[:, :r]), np.ascontiguousarray(Vt.T))
    return U.copy(), S


@kernel
def plain_level(rows, bounds, row_by_row, Z, x, tol):
    """The QP of a level of equalities without rows: min 1/2 ||w||^2 - c . w in coordinates w of the factored rows.

    Returns (-c / size, size, L (rank, rank) with z = L^-1 w, ZQ (n, d)); size 0: nothing to do, below 0: the bounds overflow.
    """
    A, b, _, fits = scaled_rows(rows, bounds, bounds, row_by_row)
    m = len(A)
    d = b - np.dot(A, x)
    triangle, _, rank, U, S, order, ZQ = factored(A, Z, A, tol)
    L = np.zeros((rank, rank))
    c = np.empty(rank)
    for i in range(rank):
        if len(S):
            L[i, i] = S[i]
            s = 0.0
            for j in range(m):
                s += U[j, i] * d[int(order[j])]
            c[i] = s
        else:
            for j in range(i + 1):
                L[i, j] = triangle[i, j]
            c[i] = d[int(order[i])]
    size = 0.0
    length = math.sqrt(np.sum(c * c))
    noise = 8.0 * EPS * (math.sqrt(np.sum(b * b)) + frobenius(A, 0, m) * math.sqrt(np.sum(x * x)))
    if rank and not length <= noise:
        size = power_of_two(np.max(np.abs(c)))
    if size > 0.0:
        c /= -size
    if not fits:
        size = -1.0
    return c, size, L, ZQ


@kernel
def finish_plain(w, size, L, ZQ, x):
    """x += ZQ L^-1 w size (in place); returns what stays free."""
    r = len(L)
    if size > 0.0 and len(w) == r:
        y = np.empty(r)
        forward_substitution(L, 0, 0, r, w, y)
        for i in range(len(x)):
            s = 0.0
            for j in range(r):
                s += ZQ[i, j] * y[j]
            x[i] += s * size
    return ZQ[:, r:].copy()
