"""A quick proof that an answer is the lexicographic optimum: sufficient, not necessary (`hqp_rp.core.verify`).

The excess of a level is bounded from above as `certify` defines it. Rows are carried in the coordinates of the freedom
that judged levels leave, W (M + 1, d); the last row is x - zeta.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import EPS, factor, frobenius, load, lower_block, tall_least_squares

STEP_COST = 1e-5  # as in certify
GONE = 1  # judged, holds nothing or is part of the freedom already taken
HELD = 2  # an active inequality row of a judged level
LATER = 3  # the same, of the level that is being judged


@kernel
def length_of(v):
    """||v||_2; overflow gives inf, which proves nothing."""
    return math.sqrt(np.sum(v * v))


@kernel
def projected(work, m, r, rank, U, S, v):
    """Norm of the part of v (m,) in the range of the m rows that `factor` left in `work` with (r, rank, U, S)."""
    if rank == 0:
        return 0.0
    if len(S):
        return length_of(np.dot(np.ascontiguousarray(U[:, :rank].T), v))
    if r == m:
        return length_of(v)
    L = lower_block(work, 0, m, 0, r)
    t = v.copy()
    tall_least_squares(L.copy(), t)
    return length_of(np.dot(L, t[:r].copy()))


@kernel
def nonnegative(C, y):
    """y - C w for a w >= 0 that makes it short (Lawson and Hanson 1974): any w >= 0 gives an upper bound."""
    d, k = C.shape
    w = np.zeros(k)
    passive = np.zeros(k, np.bool_)
    rest = y.copy()
    least = 1e-13 * length_of(y)
    index = np.empty(k, np.int64)
    for _ in range(3 * k + 10):
        entering = -1
        most = least
        for i in range(k):
            if not passive[i]:
                pull = np.sum(C[:, i] * rest)
                if pull > most:
                    most = pull
                    entering = i
        if entering < 0:
            break
        passive[entering] = True
        kept = w.copy()
        count = 0
        while True:
            count = 0
            for i in range(k):
                if passive[i]:
                    index[count] = i
                    count += 1
            if count == 0 or count > d:
                break
            t = y.copy()
            tall_least_squares(C[:, index[:count]].copy(), t)
            step = 1.0
            for i in range(count):
                old = w[index[i]]
                if t[i] <= 0.0:
                    step = min(step, old / (old - t[i]) if old > t[i] else 0.0)
            for i in range(count):
                w[index[i]] += step * (t[i] - w[index[i]])
                if t[i] <= 0.0 and w[index[i]] <= 1e-15 * abs(t[i]):
                    w[index[i]] = 0.0
                    passive[index[i]] = False
            if step == 1.0:
                break
            if not passive[entering] and step == 0.0:
                break
        if count > d:
            return rest
        following = y - np.dot(C, np.maximum(w, 0.0))
        if not length_of(following) < length_of(rest):
            w = kept
            break
        rest = following
    return rest


@kernel
def against_held(C, v, H, size):
    """An upper bound of what moves z with H z <= 0 remove from v through C z, each at the cost STEP_COST * size * ||z||."""
    d = C.shape[1]
    S = np.zeros(d)
    _, sigma, Vt = np.linalg.svd(C, True)
    S[: len(sigma)] = sigma
    metric = 1.0 / np.sqrt(S * S + (STEP_COST * size) ** 2)
    slope = metric * np.dot(Vt, np.dot(np.ascontiguousarray(C.T), v))
    columns = np.empty((d, len(H)))
    turned = np.dot(H, np.ascontiguousarray(Vt.T))
    for i in range(len(H)):
        s = 0.0
        for j in range(d):
            columns[j, i] = turned[i, j] * metric[j]
            s += columns[j, i] ** 2
        if s > 0.0:
            columns[:, i] /= math.sqrt(s)
    return length_of(nonnegative(columns, -slope))


@kernel
def held_rows(W, state, side):
    """Outward unit normals (h, d) of the held rows that still have a part in the free coordinates."""
    M = len(state)
    d = W.shape[1]
    H = np.empty((M, d))
    h = 0
    for i in range(M):
        if state[i] != HELD:
            continue
        s = 0.0
        for j in range(d):
            s += W[i, j] ** 2
        s = math.sqrt(s)
        if s <= 1e-9:
            state[i] = GONE
            continue
        for j in range(d):
            H[h, j] = side[i] * W[i, j] / s
        h += 1
    return H[:h].copy()


@kernel
def take(W, fixed, count, v, original, o0, o1, rank_tol):
    """(W in the coordinates that the `count` fixed rows leave free, the norm of the part of v that those rows reach)."""
    total, d = W.shape
    work = np.empty((count + total, d))
    right = np.empty(count)
    for i in range(count):
        work[i] = W[fixed[i]]
        right[i] = v[fixed[i]]
    work[count:] = W
    ref_row = np.empty(count, np.int64)
    ref_col = np.empty(count, np.int64)
    ref_tau = np.empty(count)
    r, rank, _, U, S = factor(
        work, 0, count, 0, count + total, right, original, o0, o1, 1.0, rank_tol, False, 0, ref_row, ref_col, ref_tau
    )
    return work[count:, rank:].copy(), projected(work, count, r, rank, U, S, right)


@kernel
def proven_optimal(A, lower, upper, offsets, x, zeta, tolerance, rank_tol):
    """Whether x is proven to be the lexicographic optimum nearest to zeta, to the relative `tolerance`.

    Level 0 holds the hard rows (it may be empty). False means only that this proof did not succeed.
    """
    M, n = A.shape
    p = len(offsets) - 1
    W = np.empty((M + 1, n))
    scale = np.empty(p)
    if not load(A, np.zeros(M), offsets, W, np.empty(M), scale):
        return False
    original = W[:M].copy()
    W[M] = x - zeta
    side = np.zeros(M)
    state = np.zeros(M, np.int64)
    x_size = length_of(x)
    if not x_size < 1e150:
        return False
    near_tol = max(tolerance, 1e-9)
    v = np.zeros(M)
    pulling = np.empty(M, np.int64)
    fixed = np.empty(M, np.int64)
    for k in range(p):
        r0 = offsets[k]
        r1 = offsets[k + 1]
        if r0 == r1:
            continue
        size = frobenius(original, r0, r1) / math.sqrt(min(r1 - r0, n))
        target_size = 0.0
        pulls = 0
        fixes = 0
        for i in range(r0, r1):
            value = 0.0
            row = 0.0
            for j in range(n):
                value += original[i, j] * x[j]
                row += original[i, j] ** 2
            row = math.sqrt(row)
            low = lower[i] * scale[k]
            up = upper[i] * scale[k]
            target = min(max(value, low), up)
            target_size += target * target
            v[i] = value - target
            reach = row * x_size + abs(target)
            near = near_tol * reach
            if k == 0 and abs(v[i]) > tolerance * reach:
                return False
            above = value >= up - near
            below = value <= low + near
            beyond = abs(v[i]) > near
            state[i] = GONE
            if lower[i] == upper[i] or v[i] != 0.0:
                pulling[pulls] = i
                pulls += 1
            if lower[i] == upper[i] or beyond or (above and below):
                fixed[fixes] = i
                fixes += 1
            elif (above or below) and row > 0.0:
                state[i] = HELD
                side[i] = 1.0 if above else -1.0
        residual = np.empty(pulls)
        for i in range(pulls):
            residual[i] = v[pulling[i]]
        allowed = tolerance * (size * x_size + math.sqrt(target_size))
        open_question = k > 0 and W.shape[1] > 0 and not length_of(residual) <= allowed
        if open_question:
            for i in range(r0, r1):  # this level's own rows bind only the levels behind it
                if state[i] == HELD:
                    state[i] = LATER
            H = held_rows(W, state, side)
            for i in range(r0, r1):
                if state[i] == LATER:
                    state[i] = HELD
            if len(H) or pulls != fixes:
                C = np.empty((pulls, W.shape[1]))
                for i in range(pulls):
                    C[i] = W[pulling[i]]
                if not against_held(C, residual, H, size) <= allowed:
                    return False
                open_question = False
        if fixes and W.shape[1]:
            W, reached = take(W, fixed, fixes, v, original, r0, r1, rank_tol)
            if open_question and not reached <= allowed:
                return False
    d = W.shape[1]
    if d == 0:
        return True
    whole = x_size + length_of(zeta)
    allowed = tolerance * whole + 8.0 * EPS * n * whole
    if length_of(W[M]) <= allowed:
        return True
    H = held_rows(W, state, side)
    if len(H) == 0:
        return False
    return against_held(np.eye(d), W[M].copy(), H, 1.0) <= allowed
