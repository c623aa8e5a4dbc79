"""A quick proof that an answer is the lexicographic optimum: sufficient, not necessary (`hqp_rp.core.verify`).

The excess of a level is bounded from above as `certify` defines it, and what rounding may contribute to it from below. Rows
that still matter are carried in coordinates whose columns from c0 on are the freedom that judged levels leave: the h active
inequality rows of judged levels (held), the rows of levels to come and, at last, x - zeta.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import inlined, lean
from hqp_rp.core.kernels.held import held_back, length_of
from hqp_rp.core.kernels.householder import reflect_rows_by_all
from hqp_rp.core.kernels.orthogonal import EPS, load, lq, spectral, triangle
from hqp_rp.core.kernels.qp_tall import by_singular_values, lay_down, turn_columns
from hqp_rp.core.kernels.room import as_matrix
from hqp_rp.core.kernels.vector import dot_row, sum_of_squares
from hqp_rp.core.kernels.verify_room import proof_of, proof_parts
from hqp_rp.core.problem import FloatArray, IntArray

FIRM = 1e-4  # a multiplier above this part of its level's pull keeps its row at the bound for every later level
DEPENDENT = 1e-10  # what is left of a firm row of length one, when it depends on rows that are fixed already


def proven_optimal(
    A: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    offsets: IntArray,
    x: FloatArray,
    zeta: FloatArray,
    tolerance: float,
    rank_tol: float,
) -> bool:
    """Whether x is proven to be the lexicographic optimum nearest to zeta, to the relative `tolerance`.

    Level 0 holds the hard rows (it may be empty). False means only that this proof did not succeed.
    """
    M, n = A.shape
    *_, numbers, counts = proof_parts(M, n, len(offsets) - 1)
    room = np.empty(numbers)
    proven: bool = prove(room, np.empty(counts, np.int64), A, lower, upper, offsets, x, zeta, tolerance, rank_tol)
    return proven


@lean
def prove(room, counts, A, lower, upper, offsets, x, zeta, tolerance, rank_tol):
    """`proven_optimal` in a given room."""
    M, n = A.shape
    p = len(offsets) - 1
    at = proof_of(room, counts, M, n, p)
    W = at.W
    for i in range(M):
        at.v[i] = 0.0
        at.order[i] = i
    if not load(A, at.v, offsets, W, at.right, at.scale):
        return False
    x_size = length_of(x)
    if not x_size < 1e150:
        return False
    for j in range(W.shape[1]):
        at.x[j] = x[j] if j < n else 0.0
        W[M, j] = x[j] - zeta[j] if j < n else 0.0
    for i in range(M):
        at.value[i] = dot_row(W, i, at.x, 0)
        at.size[i] = sum_of_squares(W, i, 0)
    near_tol = max(tolerance, 1e-9)
    h = 0
    c0 = 0
    for k in range(p):
        r0 = offsets[k]
        r1 = offsets[k + 1]
        if r0 == r1:
            continue
        square = 0.0
        for i in range(r0, r1):
            square += at.size[i]
        whole = math.sqrt(square)
        size = whole / math.sqrt(min(r1 - r0, n))
        target_size = 0.0
        residual_size = 0.0
        pulls = 0
        fixes = 0
        holds = 0
        for i in range(r0, r1):
            value = at.value[i]
            row = math.sqrt(at.size[i])
            low = lower[i] * at.scale[k]
            up = upper[i] * at.scale[k]
            target = min(max(value, low), up)
            target_size += target * target
            at.v[i] = value - target
            reach = row * x_size + abs(target)
            near = near_tol * reach
            if k == 0 and abs(at.v[i]) > tolerance * reach:
                return False
            above = value >= up - near
            below = value <= low + near
            beyond = abs(at.v[i]) > near
            at.new_side[i] = 0.0
            if lower[i] == upper[i] or at.v[i] != 0.0:
                at.pulling[pulls] = i
                pulls += 1
                residual_size += at.v[i] * at.v[i]
            if lower[i] == upper[i] or beyond or (above and below):
                at.fixed[fixes] = i
                fixes += 1
            elif (above or below) and row > 0.0:
                at.new_side[i] = 1.0 if above else -1.0
                holds += 1
        if c0 == n:
            return True
        level_size = size * x_size + math.sqrt(target_size)
        allowed = tolerance * level_size
        open_question = k > 0 and not math.sqrt(residual_size) <= allowed
        if open_question:
            allowed += 4.0 * EPS * (n + r1 - r0) * level_size
        firm = 0
        if open_question and (h or pulls != fixes):
            d = n - c0
            C = as_matrix(at.C[: pulls * d], pulls, d)
            for i in range(pulls):
                for j in range(d):
                    C[i, j] = W[at.pulling[i], c0 + j]
                at.residual[i] = at.v[at.pulling[i]]
            H = as_matrix(at.H[: h * d], h, d)
            normals_of(at.held, h, at.side, c0, H)
            if not held_back(C, at.residual[:pulls], H, size, whole, allowed, at.multipliers):
                return False
            open_question = False
            for i in range(h):
                firm += at.multipliers[i] > FIRM
        # What is fixed leaves with the directions that it takes: so do firm rows, whose normals, weighted by multipliers, add
        # up to a combination of fixed rows, so that no allowed move leaves their bounds. What is held stays, with later rows.
        for i in range(h):
            length = math.sqrt(sum_of_squares(at.held, i, c0))
            if not firm or not at.multipliers[i] > FIRM:
                at.multipliers[i] = 0.0  # it stays
            else:
                at.multipliers[i] = 1.0 / length if length > 1e-9 else -1.0  # its factor to length one
        for i in range(r0, r1):
            if at.new_side[i] != 0.0:
                move_scaled(W, i, at.held, h, c0, 1.0)
                at.side[h] = at.new_side[i]
                at.multipliers[h] = 0.0
                h += 1
        if fixes:
            for i in range(fixes):
                move_scaled(W, at.fixed[i], at.work, i, c0, 1.0)
                at.order[i] = i
            r, proven = triangle(at.work, 0, fixes, c0, fixes, at.order, whole, rank_tol, 0, at.row, at.column, at.tau)
            for i in range(fixes):
                at.right[i] = at.v[at.fixed[int(at.order[i])]]
                at.residual[i] = at.right[i]
            reflect_rows_by_all(at.held, 0, h, at.work, 0, r, c0, at.tau, 0)
            reflect_rows_by_all(W, r1, M + 1, at.work, 0, r, c0, at.tau, 0)
            if not proven:
                zero = rank_tol * at.scale[k] * spectral(A, r0, r1)
                rank = by_singular_values(at.work, fixes, c0, r, zero, at.residual, at.V, at.sharp, at.right)
                turn_columns(at.held, 0, h, c0, at.V, r)
                turn_columns(W, r1, M + 1, c0, at.V, r)
                r = rank
            elif open_question and 0 < r < fixes:
                lay_down(at.work, 0, fixes, c0, r, at.tall, at.right, at.pivot)
            if open_question and not length_of(at.right[:r]) <= allowed:
                return False
            c0 += r
        if firm and c0 < n:
            c0 += firm_rows(at, h, r1, M + 1, c0)
        if firm:
            h = still_held(at, h)
    if c0 == n:
        return True
    d = n - c0
    for j in range(d):
        at.residual[j] = W[M, c0 + j]
    reach = x_size + length_of(zeta)
    allowed = (tolerance + 8.0 * EPS * n) * reach
    if length_of(at.residual[:d]) <= allowed:
        return True
    if h == 0:
        return False
    C = as_matrix(at.C[: d * d], d, d)
    for i in range(d):
        for j in range(d):
            C[i, j] = 1.0 if i == j else 0.0
    H = as_matrix(at.H[: h * d], h, d)
    normals_of(at.held, h, at.side, c0, H)
    return held_back(C, at.residual[:d], H, 1.0, 1.0, allowed, at.multipliers)


@inlined
def move_scaled(A, i, B, k, c0, factor):
    """B[k] <- factor A[i] from the chunk of eight that holds column c0."""
    for j in range(c0 // 8 * 8, A.shape[1]):
        B[k, j] = factor * A[i, j]


@lean
def normals_of(held, h, side, c0, H):
    """H (h, d) <- outward unit normals of held rows in the columns from c0 on; a row without a part there gives zeros."""
    for i in range(h):
        length = math.sqrt(sum_of_squares(held, i, c0))
        factor = side[i] / length if length > 1e-9 else 0.0
        for j in range(H.shape[1]):
            H[i, j] = factor * held[i, c0 + j]


@lean
def firm_rows(at, h, r1, end, c0):
    """Turn what stays by the directions that firm rows take from the columns c0 ...; returns how many those are."""
    firm = 0
    for i in range(h):
        if at.multipliers[i] > 0.0:
            move_scaled(at.held, i, at.work, firm, c0, at.multipliers[i])
            firm += 1
    r = lq(at.work, 0, firm, c0, firm, at.order, DEPENDENT, 0, at.row, at.column, at.tau)
    reflect_rows_by_all(at.held, 0, h, at.work, 0, r, c0, at.tau, 0)
    reflect_rows_by_all(at.W, r1, end, at.work, 0, r, c0, at.tau, 0)
    return r


@lean
def still_held(at, h):
    """Drop the rows that were firm from the held ones; returns how many remain."""
    still = 0
    for i in range(h):
        if at.multipliers[i] == 0.0:
            move_scaled(at.held, i, at.held, still, 0, 1.0)
            at.side[still] = at.side[i]
            still += 1
    return still
