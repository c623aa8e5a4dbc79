"""A quick proof that an answer is the lexicographic optimum: sufficient, not necessary (`hqp_rp.core.verify`).

The excess of a level is bounded from above as `certify` defines it, and what rounding may contribute to it from below. Rows
that still matter are carried in the coordinates of the freedom that judged levels leave, W (h + later + 1, d): the h active
inequality rows of judged levels (held), then the rows of levels to come, at last x - zeta.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.blocked import turned_rows
from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.held import held_back, length_of
from hqp_rp.core.kernels.orthogonal import EPS, factor, frobenius, load, lower_block, lq, tall_least_squares

FIRM = 1e-4  # a multiplier above this part of its level's pull keeps its row at the bound for every later level
DEPENDENT = 1e-10  # what is left of a firm row of length one, when it depends on rows that are fixed already


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
def normals_of(W, h, side):
    """Outward unit normals (h, d) of the first h rows of W; a row without a part in the free coordinates gives zeros."""
    d = W.shape[1]
    H = np.zeros((h, d))
    for i in range(h):
        s = 0.0
        for j in range(d):
            s += W[i, j] ** 2
        s = math.sqrt(s)
        if s > 1e-9:
            for j in range(d):
                H[i, j] = side[i] * W[i, j] / s
    return H


@kernel
def proven_optimal(A, lower, upper, offsets, x, zeta, tolerance, rank_tol):
    """Whether x is proven to be the lexicographic optimum nearest to zeta, to the relative `tolerance`.

    Level 0 holds the hard rows (it may be empty). False means only that this proof did not succeed.
    """
    M, n = A.shape
    p = len(offsets) - 1
    original = np.empty((M, n))
    scale = np.empty(p)
    if not load(A, np.zeros(M), offsets, original, np.empty(M), scale):
        return False
    x_size = length_of(x)
    if not x_size < 1e150:
        return False
    W = np.empty((M + 1, n))
    W[:M] = original
    W[M] = x - zeta
    h = 0
    side = np.zeros(M)
    near_tol = max(tolerance, 1e-9)
    v = np.zeros(M)
    pulling = np.empty(M, np.int64)
    fixed = np.empty(M, np.int64)
    new_side = np.empty(M)
    multipliers = np.empty(M)
    for k in range(p):
        r0 = offsets[k]
        r1 = offsets[k + 1]
        if r0 == r1:
            continue
        d = W.shape[1]
        whole = frobenius(original, r0, r1)
        size = whole / math.sqrt(min(r1 - r0, n))
        target_size = 0.0
        residual_size = 0.0
        pulls = 0
        fixes = 0
        holds = 0
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
            new_side[i] = 0.0
            if lower[i] == upper[i] or v[i] != 0.0:
                pulling[pulls] = i
                pulls += 1
                residual_size += v[i] * v[i]
            if lower[i] == upper[i] or beyond or (above and below):
                fixed[fixes] = i
                fixes += 1
            elif (above or below) and row > 0.0:
                new_side[i] = 1.0 if above else -1.0
                holds += 1
        if d == 0:
            return True
        level_size = size * x_size + math.sqrt(target_size)
        allowed = tolerance * level_size
        at = h - r0  # row i of this level is row at + i of W
        open_question = k > 0 and not math.sqrt(residual_size) <= allowed
        if open_question:
            allowed += 4.0 * EPS * (n + r1 - r0) * level_size
        firm = 0
        H = W
        if open_question and (h or pulls != fixes):
            C = np.empty((pulls, d))
            residual = np.empty(pulls)
            for i in range(pulls):
                C[i] = W[at + pulling[i]]
                residual[i] = v[pulling[i]]
            H = normals_of(W, h, side)
            if not held_back(C, residual, H, size, whole, allowed, multipliers):
                return False
            open_question = False
            for i in range(h):
                firm += multipliers[i] > FIRM
        # What is fixed leaves with the directions that it takes: so do firm rows, whose normals, weighted by multipliers, add
        # up to a combination of fixed rows, so that no allowed move leaves their bounds. What is held stays, with later rows.
        after = len(W) - h - (r1 - r0)
        staying = np.empty((h + holds + after, d))
        work = np.empty((fixes, d))
        right = np.empty(fixes)
        for i in range(fixes):
            work[i] = W[at + fixed[i]]
            right[i] = v[fixed[i]]
        q = 0
        still = 0
        for i in range(h):
            if firm and multipliers[i] > FIRM:
                staying[q] = H[i]
                q += 1
        for i in range(h):
            if not (firm and multipliers[i] > FIRM):
                staying[q] = W[i]
                q += 1
                side[still] = side[i]
                still += 1
        h = still
        for i in range(r0, r1):
            if new_side[i] != 0.0:
                staying[q] = W[at + i]
                side[h] = new_side[i]
                h += 1
                q += 1
        staying[q:] = W[len(W) - after :]
        W = staying
        if fixes:
            ref = np.empty(fixes, np.int64)
            tau = np.empty(fixes)
            r, rank, V, U, S = factor(
                work, 0, fixes, 0, fixes, right, original, r0, r1, 1.0, rank_tol, False, 0, ref, ref.copy(), tau
            )
            if open_question and not projected(work, fixes, r, rank, U, S, right) <= allowed:
                return False
            W = turned_rows(W, work, r, tau, V)[:, rank:].copy()
        if firm:
            work = W[:firm].copy()
            ref = np.empty(firm, np.int64)
            tau = np.empty(firm)
            rank = lq(work, 0, firm, 0, firm, np.empty(firm), DEPENDENT, 0, ref, ref.copy(), tau)
            W = turned_rows(W[firm:], work, rank, tau, np.empty((0, 0)))[:, rank:].copy()
    d = W.shape[1]
    if d == 0:
        return True
    gap = W[len(W) - 1].copy()
    reach = x_size + length_of(zeta)
    allowed = tolerance * reach + 8.0 * EPS * n * reach
    if length_of(gap) <= allowed:
        return True
    return h > 0 and held_back(np.eye(d), gap, normals_of(W, h, side), 1.0, 1.0, allowed, multipliers)
