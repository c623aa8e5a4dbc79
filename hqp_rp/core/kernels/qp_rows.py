"""One level of a QP cascade with two-sided rows or rows kept from before: the small QP, and what is kept afterwards.

Z (n, d) is an orthonormal basis of the directions that finished levels leave free. Kept rows are satisfied rows of finished
levels, of length one. A level's rows come scaled by powers of two (`scaled_rows`).
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.blocked import turned_rows
from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import EPS, frobenius, inverse_norm, lq
from hqp_rp.core.kernels.qp import by_svd, factored, power_of_two, taken_from

FLAT = 1e-3  # Singular values are preconditioned away down to this fraction of the largest one.
STRONG = 1e-6  # A row whose scaled multiplier or violation exceeds this stays where it is at later levels.
GONE = 1e-10  # A kept row with no more than this left in the free directions is rounding noise.
CLEAR = 1e-6  # Pivots of a Gram matrix above this show full rank without a factorization of the rows.


@kernel
def full_rank(rows):
    """Whether the columns of `rows`, (m, d) of length one or less, are shown to be independent: sufficient, not necessary."""
    m, d = rows.shape
    if m < d:
        return False
    G = np.dot(np.ascontiguousarray(rows.T), rows)
    for j in range(d):
        s = G[j, j]
        for q in range(j):
            s -= G[j, q] * G[j, q]
        if not s > CLEAR:
            return False
        s = math.sqrt(s)
        G[j, j] = s
        for i in range(j + 1, d):
            t = G[i, j]
            for q in range(j):
                t -= G[i, q] * G[j, q]
            G[i, j] = t / s
    return True


@kernel
def directions_felt(probe, Z0):
    """Basis (n, f) of the directions of Z0 that some row, `probe` (count, d0) in these directions, feels.

    Rows are of length one before they are put into these directions. Along the others the QP would be free to run away.
    """
    count, d0 = probe.shape
    if d0 == 0 or full_rank(probe):
        return Z0
    ref = np.empty(count, np.int64)
    tau = np.empty(count)
    r = lq(probe, 0, count, 0, count, np.zeros(count), GONE, 0, ref, np.empty(count, np.int64), tau)
    if r == d0:
        return Z0
    return turned_rows(Z0, probe, r, tau, np.empty((0, 0)))[:, :r].copy()


@kernel
def level_with_rows(
    A, lower, upper, Z, x, kept, kept_lower, kept_upper, identity, tol, guess_x, guess_y, ids, kept_ids
):
    """The QP of a level in coordinates t = (w, u), x-step = T t (`hqp_rp.core.qp_descent` has the formula).

    identity: A is the identity. guess_x (n,), guess_y (all rows,): an earlier answer, or empty. ids, kept_ids: row numbers
    into guess_y. Returns (size, T (n, t), Z0 (n, d0), hessian, gradient, rows, low, up, lengths, S, guess t, guess y);
    gradient, low and up are divided by size, which is 0 where nothing is left to do. S: the two-sided rows.
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
    row_size = np.ones(count)
    lengths = np.ones(count)
    for i in range(mS):
        rows_x[i] = A[S[i]]
        s = math.sqrt(np.sum(rows_x[i] ** 2))
        if s > 0.0:
            row_size[i] = s
    rows_x[mS:] = kept
    rank = 0
    sharp = np.empty(0)  # curvature of w
    noise = 0.0
    c = np.empty(0)
    W = np.empty((n, 0))
    ZQ = Z
    back = np.empty((0, 0))  # w = back (z in ZQ)
    if identity:  # A Z is orthonormal as it is
        rank = d
        c = np.dot(lower - x, Z)
        sharp = np.ones(d)
        W = Z
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
        c, back, Sigma, ZQ = factored(E, res, Z, A, tol)
        rank = len(c)
        if rank and len(Sigma) == 0 and inverse_norm(back, 0, 0, rank) * frobenius(back, 0, rank) * FLAT > 1.0:
            c, back, Sigma = by_svd(c, back, ZQ)
        W = ZQ[:, :rank].copy()
        sharp = np.ones(rank)
        if len(Sigma):
            for j in range(rank):
                scale = max(Sigma[j], FLAT * Sigma[0])
                sharp[j] = Sigma[j] / scale
                back[j, j] = scale
                W[:, j] /= scale
        else:
            over_triangle(W, back)
    Z0 = ZQ[:, rank:].copy()
    T = np.empty((n, d))
    T[:, :rank] = W
    T[:, rank:] = Z0
    rows = np.dot(rows_x, T)
    probe = rows[:, rank:].copy()
    for i in range(mS):
        probe[i] /= row_size[i]
    felt = directions_felt(probe, Z0)
    t = rank + felt.shape[1]
    if t < d:
        T = np.concatenate((W, felt), 1)
        rows = np.dot(rows_x, T)
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
            for j in range(d):
                s += within[i, j] ** 2
            if math.sqrt(s) <= tol * row_size[i]:  # earlier levels have used it up: nothing here may follow it
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
            guess_t[:rank] = np.dot(back, np.dot(away, ZQ)[:rank])
            guess_t[rank:] = np.dot(away, felt)
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
def finish_with_rows(A, lower, upper, ids, S, T, Z0, t, y, size, x, kept, kept_lower, kept_upper, kept_ids, tol, side):
    """x += T t size (in place); eliminate what must stay where it is, keep satisfied rows.

    side, by row number: written for rows that now leave, +1 at their upper bound, -1 at their lower one.
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
            side[ids[row]] = 1 if value[i] > upper[row] else -1
            F += 1
    held = np.zeros(K, np.bool_)
    for i in range(K):
        for j in range(n):
            value[mS + i] += kept[i, j] * x[j]
        if len(y) and abs(y[mS + i]) > STRONG:
            held[i] = True
            side[kept_ids[i]] = 1 if y[mS + i] > 0.0 else -1
            H += 1
    Z = Z0
    if F and Z.shape[1]:
        rows = np.empty((F, n))
        q = 0
        for i in range(mS):
            if fixed[i]:
                rows[q] = A[S[i]]
                q += 1
        _, _, _, rank, _, _, ZQ = taken_from(rows, Z, A, tol)
        Z = ZQ[:, rank:].copy()
    if H and Z.shape[1]:
        rows = np.empty((H, n))
        q = 0
        for i in range(K):
            if held[i]:
                rows[q] = kept[i]
                q += 1
        L = np.dot(rows, Z)
        ref = np.empty(H, np.int64)
        tau = np.empty(H)
        rank = lq(L, 0, H, 0, H, np.zeros(H), GONE, 0, ref, np.empty(H, np.int64), tau)
        Z = turned_rows(Z, L, rank, tau, np.empty((0, 0)))[:, rank:].copy()
    total = K - H + mS - F
    new = np.empty((total, n))
    new_lower = np.empty(total)
    new_upper = np.empty(total)
    new_ids = np.empty(total, np.int64)
    q = 0
    for i in range(K):
        if not held[i]:
            new[q] = kept[i]
            new_lower[q] = min(kept_lower[i], value[mS + i])
            new_upper[q] = max(kept_upper[i], value[mS + i])
            new_ids[q] = kept_ids[i]
            q += 1
    for i in range(mS):
        row = S[i]
        length = math.sqrt(np.sum(A[row] ** 2))
        if not fixed[i] and length > 0.0:
            for j in range(n):
                new[q, j] = A[row, j] / length
            new_lower[q] = min(lower[row], value[i]) / length
            new_upper[q] = max(upper[row], value[i]) / length
            new_ids[q] = ids[row]
            q += 1
    free = np.dot(new[:q], Z)
    still = 0
    for i in range(q):  # a row with rounding alone left in the free directions goes
        if math.sqrt(np.sum(free[i] ** 2)) > 1e-12:
            new[still] = new[i]
            new_lower[still] = new_lower[i]
            new_upper[still] = new_upper[i]
            new_ids[still] = new_ids[i]
            still += 1
    return Z, new[:still].copy(), new_lower[:still].copy(), new_upper[:still].copy(), new_ids[:still].copy()
