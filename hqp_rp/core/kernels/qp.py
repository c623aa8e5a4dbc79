"""One level of a QP cascade in its free directions: the small QP before a back end sees it, and what is kept afterwards.

Z (n, d) is an orthonormal basis of the directions that finished levels leave free. Kept rows are satisfied rows of finished
levels, of length one. A level's rows come scaled by powers of two (`scaled_rows`).
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import (
    EPS,
    factor,
    forward_substitution,
    frobenius,
    inverse_norm,
    lower_block,
    lq,
)

FLAT = 1e-3  # Singular values are preconditioned away down to this fraction of the largest one.
STRONG = 1e-6  # A row whose scaled multiplier or violation exceeds this stays where it is at later levels.
GONE = 1e-10  # A kept row with no more than this left in the free directions is rounding noise.


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
        for j in range(n):
            rows[i, j] = math.ldexp(A[i, j], e)
        low[i] = math.ldexp(lower[i], e)
        up[i] = math.ldexp(upper[i], e)
        if low[i] == np.inf or up[i] == -np.inf:
            fits = False
    return rows, low, up, fits


@kernel
def power_of_two(largest):
    """The power of two above `largest`; 0 for 0."""
    return math.ldexp(1.0, math.frexp(largest)[1]) if 0.0 < largest < np.inf else 0.0


@kernel
def turned(E, Z, extra, A, tol):
    """Factor E Z by the rank rule of A; Z and `extra` Z are turned with it.

    Returns (work, r, rank, U, S, order): work = [L; Z Q; extra Z Q]; order: which row of E each row of L is.
    """
    m = len(E)
    n, d = Z.shape
    work = np.empty((m + n + len(extra), d))
    work[:m] = np.dot(E, Z)
    work[m : m + n] = Z
    if len(extra):
        work[m + n :] = np.dot(extra, Z)
    order = np.arange(m) * 1.0
    ref_row = np.empty(m, np.int64)
    ref_col = np.empty(m, np.int64)
    ref_tau = np.empty(m)
    r, rank, _, U, S = factor(
        work, 0, m, 0, len(work), order, A, 0, len(A), 1.0, tol, False, 0, ref_row, ref_col, ref_tau
    )
    if r > 0 and len(S) == 0 and r < m:
        U, S = by_svd(work, m, r)
    return work, r, rank, U, S, order


@kernel
def by_svd(work, m, r):
    """L = U S V^T of the factor in the first m rows of `work`, proven to be of rank r; the rows below are turned by V."""
    U, S, Vt = np.linalg.svd(lower_block(work, 0, m, 0, r), False)
    work[m:, :r] = np.dot(np.ascontiguousarray(work[m:, :r]), np.ascontiguousarray(Vt.T))
    return U.copy(), S


@kernel
def plain_level(rows, bounds, row_by_row, Z, x, tol):
    """The QP of a level of equalities without rows: min 1/2 ||w||^2 - c . w in coordinates w of the factored rows.

    Returns (-c / size, size, L (r, r) with z = L^-1 w, ZQ (n, d)); size 0: nothing to do, below 0: the bounds overflow.
    """
    A, b, _, fits = scaled_rows(rows, bounds, bounds, row_by_row)
    m = len(A)
    n = len(x)
    d = b - np.dot(A, x)
    work, _, rank, U, S, order = turned(A, Z, np.empty((0, n)), A, tol)
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
                L[i, j] = work[i, j]
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
    return c, size, L, work[m : m + n].copy()


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


@kernel
def level_with_rows(
    A, lower, upper, Z, x, kept, kept_lower, kept_upper, identity, tol, guess_x, guess_y, ids, kept_ids
):
    """The QP of a level in coordinates t = (w, u), x-step = T t: see `Cascade.minimize`.

    guess_x (n,), guess_y (all rows,): an earlier answer, or empty. ids, kept_ids: row numbers into guess_y.
    Returns (size, T (n, t), Z0 (n, d0), hessian, gradient, rows, low, up, lengths, S, guess t, guess y); gradient, low and up
    are divided by size, which is 0 where nothing is left to do. S: the two-sided rows.
    """
    m, n = A.shape
    d = Z.shape[1]
    E_index = np.empty(m, np.int64)
    S_index = np.empty(m, np.int64)
    mE = 0
    mS = 0
    for i in range(m):
        if lower[i] == upper[i]:
            E_index[mE] = i
            mE += 1
        elif lower[i] > -np.inf or upper[i] < np.inf:
            S_index[mS] = i
            mS += 1
    S = S_index[:mS].copy()
    K = len(kept)
    count = mS + K
    met = mE == 0
    for i in range(mS):
        if met:
            value = 0.0
            for j in range(n):
                value += A[S[i], j] * x[j]
            met = lower[S[i]] <= value <= upper[S[i]]
    if met:  # a level of rows that x meets: nothing to solve
        none = np.empty(0)
        empty = np.empty((0, 0))
        return 0.0, np.empty((n, 0)), Z, none, none, empty, none, none, none, S, none, none
    rows_x = np.empty((count, n))
    lengths = np.ones(count)
    for i in range(mS):
        rows_x[i] = A[S[i]]
    for i in range(K):
        rows_x[mS + i] = kept[i]
    rank = 0
    sharp = np.empty(0)  # curvature of w
    if identity:  # A Z is orthonormal as it is
        rank = d
        c = np.dot(Z.T.copy(), lower - x)
        sharp = np.ones(d)
        W = Z.copy()
        Wrows = np.dot(rows_x, Z)
        ZQ = Z
        back = np.eye(d)
        noise = 8.0 * EPS * (math.sqrt(np.sum(lower * lower)) + math.sqrt(np.sum(x * x)))
    elif mE and d:
        E = np.empty((mE, n))
        b = np.empty(mE)
        for i in range(mE):
            E[i] = A[E_index[i]]
            b[i] = lower[E_index[i]]
        res = b - np.dot(E, x)
        noise = 8.0 * EPS * (math.sqrt(np.sum(b * b)) + frobenius(E, 0, mE) * math.sqrt(np.sum(x * x)))
        work, r, rank, U, Sigma, order = turned(E, Z, rows_x, A, tol)
        if (
            r
            and len(Sigma) == 0
            and inverse_norm(work, 0, 0, r) * frobenius(lower_block(work, 0, r, 0, r), 0, r) * FLAT > 1.0
        ):
            U, Sigma = by_svd(work, mE, r)
        W = work[mE : mE + n, :rank].copy()
        Wrows = work[mE + n :, :rank].copy()
        ZQ = work[mE : mE + n].copy()
        c = np.empty(rank)
        sharp = np.ones(rank)
        back = np.zeros((rank, rank))  # w = back (z in ZQ)
        if len(Sigma):
            for j in range(rank):
                s = 0.0
                for i in range(mE):
                    s += U[i, j] * res[int(order[i])]
                scale = max(Sigma[j], FLAT * Sigma[0])
                sharp[j] = Sigma[j] / scale
                c[j] = s
                back[j, j] = scale
                W[:, j] /= scale
                Wrows[:, j] /= scale
        else:
            for i in range(rank):
                c[i] = res[int(order[i])]
                for j in range(i + 1):
                    back[i, j] = work[i, j]
            over_triangle(W, back)
            over_triangle(Wrows, back)
    else:
        noise = 0.0
        c = np.empty(0)
        W = np.empty((n, 0))
        Wrows = np.empty((count, 0))
        ZQ = Z
        back = np.empty((0, 0))
    d0 = d - rank
    Z0 = ZQ[:, rank:].copy()
    # Along directions that no row feels the QP would be free to run away.
    felt = Z0
    if d0:
        ref_row = np.empty(count, np.int64)
        ref_col = np.empty(count, np.int64)
        ref_tau = np.empty(count)
        probe = np.empty((count + n, d0))
        probe[:count] = np.dot(rows_x, Z0)
        for i in range(mS):
            s = math.sqrt(np.sum(rows_x[i] ** 2))
            if s > 0.0:
                probe[i] /= s
        probe[count:] = Z0
        order2 = np.zeros(count)
        rf = lq(probe, 0, count, 0, count + n, order2, GONE, 0, ref_row, ref_col, ref_tau)
        if rf < d0:
            felt = probe[count:, :rf].copy()
    t = rank + felt.shape[1]
    T = np.empty((n, t))
    T[:, :rank] = W
    T[:, rank:] = felt
    rows = np.empty((count, t))
    rows[:, :rank] = Wrows
    rows[:, rank:] = np.dot(rows_x, felt)
    low = np.empty(count)
    up = np.empty(count)
    hessian = np.zeros(t)
    gradient = np.zeros(t)
    for j in range(rank):
        hessian[j] = sharp[j] * sharp[j]
        gradient[j] = -sharp[j] * c[j]
    within = np.dot(rows_x[:mS], Z)
    largest = 0.0
    if math.sqrt(np.sum(c * c)) > noise:
        for j in range(rank):
            largest = max(largest, abs(c[j]))
    for i in range(count):
        value = 0.0
        for j in range(n):
            value += rows_x[i, j] * x[j]
        s = 0.0
        if i < mS:
            for j in range(n):
                s += rows_x[i, j] ** 2
            whole = math.sqrt(s)
            s = 0.0
            for j in range(d):
                s += within[i, j] ** 2
            if math.sqrt(s) <= tol * whole:  # earlier levels have used it up: nothing here may follow it
                rows[i] = 0.0
            low[i] = lower[S[i]] - value
            up[i] = upper[S[i]] - value
            largest = max(largest, low[i], -up[i])
        else:
            for j in range(t):
                s += rows[i, j] ** 2
            s = math.sqrt(s)
            lengths[i] = s
            if s > 0.0:
                rows[i] /= s
            else:
                s = 1.0
            # The start is feasible by construction: a bound passed by rounding moves to where the point is.
            low[i] = min(kept_lower[i - mS] - value, 0.0) / s
            up[i] = max(kept_upper[i - mS] - value, 0.0) / s
    size = power_of_two(largest)
    guess_t = np.empty(0)
    y = np.empty(0)
    if size > 0.0:
        gradient /= size
        low /= size
        up /= size
        if len(guess_x):
            guess_t = np.empty(t)
            away = (guess_x - x) / size
            guess_t[:rank] = np.dot(back, np.dot(ZQ[:, :rank].T.copy(), away))
            guess_t[rank:] = np.dot(felt.T.copy(), away)
            y = np.empty(count)
            for i in range(mS):
                y[i] = guess_y[ids[S[i]]] / size
            for i in range(K):
                y[mS + i] = guess_y[kept_ids[i]] * lengths[mS + i] / size
            if not math.isfinite(np.sum(guess_t) + np.sum(y)):
                guess_t = np.empty(0)
    return size, T, Z0, hessian, gradient, rows, low, up, lengths, S, guess_t, y


@kernel
def over_triangle(rows, L):
    """rows <- rows L^-1, L lower triangular."""
    r = len(L)
    for i in range(len(rows)):
        for j in range(r - 1, -1, -1):
            s = rows[i, j] / L[j, j]
            rows[i, j] = s
            for k in range(j):
                rows[i, k] -= s * L[j, k]


@kernel
def finish_with_rows(A, lower, upper, ids, S, T, Z0, t, y, size, x, kept, kept_lower, kept_upper, kept_ids, tol):
    """x += T t size (in place); eliminate what must stay where it is, keep satisfied rows.

    Returns (Z, kept, kept_lower, kept_upper, kept_ids); a kept row is never tighter than the point reached.
    """
    n = len(x)
    if size > 0.0:
        for i in range(n):
            s = 0.0
            for j in range(len(t)):
                s += T[i, j] * t[j]
            x[i] += s * size
    mS = len(S)
    K = len(kept)
    fixed = np.zeros(mS, np.bool_)
    value = np.zeros(mS + K)
    F = 0
    H = 0
    for i in range(mS):
        row = S[i]
        for j in range(n):
            value[i] += A[row, j] * x[j]
        beyond = max(lower[row] - value[i], value[i] - upper[row])
        if size > 0.0 and beyond > STRONG * size:
            fixed[i] = True
            F += 1
    held = np.zeros(K, np.bool_)
    for i in range(K):
        for j in range(n):
            value[mS + i] += kept[i, j] * x[j]
        if len(y) and abs(y[mS + i]) > STRONG:
            held[i] = True
            H += 1
    Z = Z0
    if (F or H) and Z.shape[1]:
        if F:
            rows = np.empty((F, n))
            q = 0
            for i in range(mS):
                if fixed[i]:
                    rows[q] = A[S[i]]
                    q += 1
            work, _, rank, _, _, _ = turned(rows, Z, np.empty((0, n)), A, tol)
            Z = work[F:, rank:].copy()
        if H and Z.shape[1]:
            rows = np.empty((H, n))
            q = 0
            for i in range(K):
                if held[i]:
                    rows[q] = kept[i]
                    q += 1
            work = np.empty((H + n, Z.shape[1]))
            work[:H] = np.dot(rows, Z)
            work[H:] = Z
            ref = np.empty(H, np.int64)
            rank = lq(work, 0, H, 0, H + n, np.zeros(H), GONE, 0, ref, np.empty(H, np.int64), np.empty(H))
            Z = work[H:, rank:].copy()
    total = K - H + mS - F
    new = np.empty((total, n))
    new_lower = np.empty(total)
    new_upper = np.empty(total)
    new_ids = np.empty(total, np.int64)
    q = 0
    for i in range(K):
        if held[i]:
            continue
        new[q] = kept[i]
        new_lower[q] = min(kept_lower[i], value[mS + i])
        new_upper[q] = max(kept_upper[i], value[mS + i])
        new_ids[q] = kept_ids[i]
        q += still_free(new[q], Z)
    for i in range(mS):
        row = S[i]
        length = math.sqrt(np.sum(A[row] ** 2))
        if fixed[i] or length == 0.0:
            continue
        for j in range(n):
            new[q, j] = A[row, j] / length
        new_lower[q] = min(lower[row], value[i]) / length
        new_upper[q] = max(upper[row], value[i]) / length
        new_ids[q] = ids[row]
        q += still_free(new[q], Z)
    return Z, new[:q].copy(), new_lower[:q].copy(), new_upper[:q].copy(), new_ids[:q].copy()


@kernel
def still_free(row, Z):
    """1 when more than rounding of a row of length one is left in the free directions, else 0."""
    total = 0.0
    for j in range(Z.shape[1]):
        s = 0.0
        for i in range(len(row)):
            s += row[i] * Z[i, j]
        total += s * s
    return 1 if math.sqrt(total) > 1e-12 else 0


@kernel
def with_slacks(hessian, gradient, rows, lower, upper, soft, infinite, t, y):
    """(H, g, C, lower, upper) of a `SlackQP` on (t, s), bounds cut at `infinite`; (t, s = -y) as a point to start from."""
    n = len(gradient)
    m = len(lower)
    H = np.zeros((n + soft, n + soft))
    g = np.zeros(n + soft)
    C = np.zeros((m, n + soft))
    start = np.empty(n + soft)
    low = np.empty(m)
    up = np.empty(m)
    for j in range(n):
        H[j, j] = hessian[j]
        g[j] = gradient[j]
        start[j] = t[j]
    for i in range(m):
        for j in range(n):
            C[i, j] = rows[i, j]
        if i < soft:
            H[n + i, n + i] = 1.0
            C[i, n + i] = 1.0
            start[n + i] = -y[i]
        low[i] = max(lower[i], -infinite)
        up[i] = min(upper[i], infinite)
    return H, g, C, low, up, start
