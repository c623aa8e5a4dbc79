"""One level of a QP cascade in its free directions: the factored equality rows, and a level of equalities alone.

Z (n, d) is an orthonormal basis of the directions that finished levels leave free. A level's rows come scaled by powers of
two (`scaled_rows`).
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.blocked import turned_rows
from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import EPS, factor, forward_substitution, frobenius


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
def taken_from(E, Z, A, tol):
    """Factor E Z by the rank rule of A: what `factor` returns of L = E Z Q (m, d), with the order of its rows, and ZQ (n, d).

    The first `rank` columns of ZQ are the directions that the rows E take from Z. Returns (L, order, r, rank, U, S, ZQ).
    """
    m = len(E)
    L = np.dot(E, Z)
    order = np.arange(m) * 1.0
    ref = np.empty(m, np.int64)
    tau = np.empty(m)
    r, rank, V, U, S = factor(L, 0, m, 0, m, order, A, 0, len(A), 1.0, tol, False, 0, ref, np.empty(m, np.int64), tau)
    return L, order, r, rank, U, S, turned_rows(Z, L, r, tau, V)


@kernel
def factored(E, residual, Z, A, tol):
    """Coordinates w = B z in which `min ||E Z Q z - residual||` is `min ||w - c||`.

    Returns (c (rank,), B (rank, rank) lower triangular, S, ZQ (n, d)); z are the first `rank` columns of ZQ. Where the rank
    rule needed singular values, B is their diagonal S, else S is empty.
    """
    L, order, r, rank, U, S, ZQ = taken_from(E, Z, A, tol)
    m = len(E)
    c = np.zeros(rank)
    B = np.zeros((rank, rank))
    if len(S):
        for i in range(rank):
            B[i, i] = S[i]
            for j in range(m):
                c[i] += U[j, i] * residual[int(order[j])]
        return c, B, S, ZQ
    if r == m:
        for i in range(rank):
            c[i] = residual[int(order[i])]
            for j in range(i + 1):
                B[i, j] = L[i, j]
        return c, B, S, ZQ
    # L = Q R by Householder's reflectors; R, upper triangular, becomes lower triangular with w and z in reverse order.
    columns = np.zeros((r, m))
    turned = np.empty(m)
    for i in range(m):
        turned[i] = residual[int(order[i])]
        for j in range(min(i + 1, r)):
            columns[j, i] = L[i, j]
    for j in range(r):
        length = math.sqrt(np.sum(columns[j, j:] ** 2))
        alpha = columns[j, j]
        beta = -length if alpha >= 0.0 else length
        columns[j, j] = alpha - beta
        share = 1.0 / (beta * (beta - alpha))
        for i in range(j + 1, r):
            dot = share * np.sum(columns[i, j:] * columns[j, j:])
            for q in range(j, m):
                columns[i, q] -= dot * columns[j, q]
        dot = share * np.sum(turned[j:] * columns[j, j:])
        for q in range(j, m):
            turned[q] -= dot * columns[j, q]
        columns[j, j] = beta
    for i in range(r):
        c[i] = turned[r - 1 - i]
        for j in range(i + 1):
            B[i, j] = columns[r - 1 - j, r - 1 - i]
    ZQ[:, :r] = ZQ[:, :r][:, ::-1].copy()
    return c, B, S, ZQ


@kernel
def by_svd(c, B, ZQ):
    """B = U S V^T, proven to be of full rank: (U^T c, diag(S), S), with ZQ turned by V in place."""
    r = len(B)
    U, S, Vt = np.linalg.svd(B, False)
    ZQ[:, :r] = np.dot(np.ascontiguousarray(ZQ[:, :r]), np.ascontiguousarray(Vt.T))
    return np.dot(c, U), np.diag(S), S


@kernel
def plain_level(rows, bounds, row_by_row, Z, x, tol):
    """The QP of a level of equalities without rows: min 1/2 ||w||^2 - c . w in coordinates w of the factored rows.

    Returns (-c / size, size, B (rank, rank) with w = B z, ZQ (n, d)); size 0: nothing to do, below 0: the bounds overflow.
    """
    A, b, _, fits = scaled_rows(rows, bounds, bounds, row_by_row)
    c, B, _, ZQ = factored(A, b - np.dot(A, x), Z, A, tol)
    size = 0.0
    length = math.sqrt(np.sum(c * c))
    noise = 8.0 * EPS * (math.sqrt(np.sum(b * b)) + frobenius(A, 0, len(A)) * math.sqrt(np.sum(x * x)))
    if len(c) and not length <= noise:
        size = power_of_two(np.max(np.abs(c)))
    if size > 0.0:
        c /= -size
    if not fits:
        size = -1.0
    return c, size, B, ZQ


@kernel
def finish_plain(w, size, B, ZQ, x):
    """x += ZQ B^-1 w size (in place); returns what stays free."""
    r = len(B)
    if size > 0.0 and len(w) == r:
        y = np.empty(r)
        forward_substitution(B, 0, 0, r, w, y)
        for i in range(len(x)):
            s = 0.0
            for j in range(r):
                s += ZQ[i, j] * y[j]
            x[i] += s * size
    return ZQ[:, r:].copy()
