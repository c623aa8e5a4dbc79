"""A quick proof that an answer is the lexicographic optimum: sufficient, not necessary (`hqp_rp.core.verify`).

The excess of a level is bounded from above as `certify` defines it. Rows are carried in the coordinates of the freedom
that judged levels leave, W (M + 1, d); the last row is x - zeta. Where inequality rows are active, the multipliers of the
unconstrained least squares, cut off at zero, give the bound; certify searches for the best ones.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import EPS, factor, frobenius, load, lower_block, tall_least_squares

STEP_COST = 1e-5  # as in certify
GONE = 1  # judged, holds nothing or is part of the freedom already taken
HELD = 2  # an active inequality row of a judged level


@kernel
def length_of(v):  # type: ignore[no-untyped-def]
    """||v||_2; overflow gives inf, which proves nothing."""
    return math.sqrt(np.sum(v * v))


@kernel
def projected(C, v, size, rank_tol):  # type: ignore[no-untyped-def]
    """Norm of the part of v (m,) in range(C), C (m, d); singular values <= rank_tol * size count as zero."""
    m, d = C.shape
    work = C.copy()
    right = v.copy()
    ref_row = np.empty(m, np.int64)
    ref_col = np.empty(m, np.int64)
    ref_tau = np.empty(m)
    r, rank, _, U, S = factor(
        work, 0, m, 0, m, right, C, 0, m, max(size / frobenius(C, 0, m), 1.0), rank_tol, False, 0, ref_row, ref_col, ref_tau
    )
    if rank == 0:
        return 0.0
    if len(S):
        return length_of(np.dot(np.ascontiguousarray(U[:, :rank].T), right))
    if r == m:
        return length_of(v)
    L = lower_block(work, 0, m, 0, r)
    t = right.copy()
    tall_least_squares(L.copy(), t)
    return length_of(np.dot(L, t[:r].copy()))


@kernel
def against_held(C, v, H, size):  # type: ignore[no-untyped-def]
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
    weights = np.maximum(np.linalg.lstsq(columns, -slope, 1e-14)[0], 0.0)
    return length_of(slope + np.dot(columns, weights))


@kernel
def removable(C, v, H, size, rank_tol):  # type: ignore[no-untyped-def]
    """An upper bound of the part of v that moves allowed by H remove through C; both in the free coordinates."""
    m, d = C.shape
    if m == 0 or d == 0 or size == 0.0:
        return 0.0
    if len(H) == 0:
        return projected(C, v, size, rank_tol)
    return against_held(C, v, H, size)


@kernel
def held_rows(W, state, side):  # type: ignore[no-untyped-def]
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
def take(W, fixed, count, original, o0, o1, state, rank_tol):  # type: ignore[no-untyped-def]
    """The rows of W in the coordinates that the `count` fixed rows leave free (M + 1, d - rank)."""
    total, d = W.shape
    work = np.empty((count + total, d))
    for i in range(count):
        for j in range(d):
            work[i, j] = W[fixed[i], j]
    work[count:] = W
    right = np.zeros(count)
    ref_row = np.empty(count, np.int64)
    ref_col = np.empty(count, np.int64)
    ref_tau = np.empty(count)
    _, rank, _, _, _ = factor(
        work, 0, count, 0, count + total, right, original, o0, o1, 1.0, rank_tol, False, 0, ref_row, ref_col, ref_tau
    )
    return work[count:, rank:].copy()


@kernel
def proven_optimal(A, lower, upper, offsets, x, zeta, tolerance, rank_tol):  # type: ignore[no-untyped-def]
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
        level_scale = size * x_size + math.sqrt(target_size)
        allowed = tolerance * level_scale
        if k > 0 and not length_of(residual) <= allowed:
            C = np.empty((pulls, W.shape[1]))
            for i in range(pulls):
                C[i] = W[pulling[i]]
            new = np.empty(M, np.int64)  # rows of this level bind only the levels behind it
            for i in range(r0, r1):
                new[i] = state[i]
                state[i] = GONE
            H = held_rows(W, state, side)
            for i in range(r0, r1):
                state[i] = new[i]
            if not removable(C, residual, H, size, rank_tol) <= allowed:
                return False
        if fixes and W.shape[1]:
            W = take(W, fixed, fixes, original, r0, r1, state, rank_tol)
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
