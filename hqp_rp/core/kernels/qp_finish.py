"""After a stage's QP: x moves, rows that must stay where they are take their directions along, satisfied rows are kept."""

from __future__ import annotations

import math

from hqp_rp.core.kernels.compile import inlined, lean
from hqp_rp.core.kernels.householder import reflect_rows_by_all
from hqp_rp.core.kernels.orthogonal import frobenius, lq, spectral, triangle
from hqp_rp.core.kernels.qp_desk import KEPT, RANK, RANK_TOLERANCE, SIZE, SOFT, STAGE, TAKEN, M, N, P, T, desk_of
from hqp_rp.core.kernels.qp_factor import GONE
from hqp_rp.core.kernels.qp_tall import by_singular_values, turn_columns
from hqp_rp.core.kernels.vector import dot_row, sum_of_squares

STRONG = 1e-6  # A row whose scaled multiplier or violation exceeds this stays where it is at later levels.


@lean
def move(desk, c0, t, rank, lower, w, size):
    """x += Q z size on t columns from c0 on, B z = w on the first `rank`; lower: B is a triangle, else the identity."""
    for j in range(len(desk.z)):
        desk.z[j] = 0.0
    for j in range(t):
        s = w[j]
        if j < rank and lower:
            for i in range(j):
                s -= desk.B[j, i] * desk.z[c0 + i]
            s /= desk.B[j, j]
        desk.z[c0 + j] = s
    for i in range(desk.raw.shape[1]):
        desk.x[i] += size * dot_row(desk.turned, i, desk.z, c0)


@lean
def take_leave(desk, rows, count, c0, r0, r1, tol, by_rule):
    """The first `count` rows of `work` take their directions from the columns c0 ...; returns the first column still free.

    by_rule: their rank is decided by the rank rule of the stage's rows, else rows of length one are noise below `GONE`.
    """
    proven = True
    if by_rule:
        norm = frobenius(desk.A, r0, r1)
        r, proven = triangle(desk.work, 0, count, c0, count, desk.order, norm, tol, 0, desk.row, desk.column, desk.tau)
    else:
        r = lq(desk.work, 0, count, c0, count, desk.order, GONE, 0, desk.row, desk.column, desk.tau)
    reflect_rows_by_all(desk.turned, 0, rows, desk.work, 0, r, c0, desk.tau, 0)
    if proven:
        return c0 + r
    zero = tol * spectral(desk.A, r0, r1)
    rank = by_singular_values(desk.work, count, c0, r, zero, desk.residual, desk.B, desk.sharp, desk.c)
    turn_columns(desk.turned, 0, rows, c0, desk.B, r)
    return c0 + rank


@lean
def finish_stage(numbers, counts, step, y):
    """Move x by the answer, let go what must stay where it is, keep satisfied rows; y (QP_ROWS,) multipliers.

    Without an answer (SIZE 0, or one that was not found) step is empty. `Desk.side`, by row number, is written for rows that
    now leave, +1 at their upper bound, -1 at their lower one. A kept row is never tighter than the point reached.
    """
    desk = desk_of(numbers, counts)
    n = counts[N]
    k = counts[STAGE]
    last = k == counts[P] + 1
    r0 = desk.offsets[k] if not last else counts[M]
    r1 = desk.offsets[k + 1] if not last else counts[M]
    K = counts[KEPT]
    mS = counts[SOFT]
    size = numbers[SIZE]
    c0 = counts[TAKEN]
    rank = counts[RANK]
    if size > 0.0 and len(step):
        move(desk, c0, counts[T], rank, not last, step, size)
    c0 += rank
    leaving = 0
    for i in range(mS):
        row = desk.S[i]
        value = dot_row(desk.A, row, desk.x, 0)
        desk.right[i] = value
        desk.leaves[i] = size > 0.0 and max(desk.low[row] - value, value - desk.up[row]) > STRONG * size
        if desk.leaves[i]:
            desk.side[row] = 1 if value > desk.up[row] else -1
            if c0 < n:
                move_row(desk.turned, n + K + i, desk.work, leaving)
                leaving += 1
    if leaving:
        c0 = take_leave(desk, n + K + mS, leaving, c0, r0, r1, numbers[RANK_TOLERANCE], True)
    leaving = 0
    for i in range(K):
        desk.right[mS + i] = dot_row(desk.kept, i, desk.x, 0)
        desk.leaves[mS + i] = len(y) > 0 and abs(y[mS + i]) > STRONG
        if desk.leaves[mS + i]:
            desk.side[desk.kept_ids[i]] = 1 if y[mS + i] > 0.0 else -1
            if c0 < n:
                move_row(desk.turned, n + i, desk.work, leaving)
                leaving += 1
    if leaving:
        c0 = take_leave(desk, n + K + mS, leaving, c0, r0, r1, numbers[RANK_TOLERANCE], False)
    counts[TAKEN] = c0
    q = 0
    for i in range(K):
        if not desk.leaves[mS + i] and still_free(desk.turned, n + i, c0, n, 1.0):
            move_row(desk.kept, i, desk.kept, q)
            move_row(desk.turned, n + i, desk.turned, n + q)
            desk.kept_lower[q] = min(desk.kept_lower[i], desk.right[mS + i])
            desk.kept_upper[q] = max(desk.kept_upper[i], desk.right[mS + i])
            desk.kept_ids[q] = desk.kept_ids[i]
            q += 1
    for i in range(mS):
        row = desk.S[i]
        length = math.sqrt(sum_of_squares(desk.A, row, 0))
        if not desk.leaves[i] and length > 0.0 and still_free(desk.turned, n + K + i, c0, n, length):
            for j in range(desk.kept.shape[1]):
                desk.kept[q, j] = desk.A[row, j] / length
                desk.turned[n + q, j] = desk.turned[n + K + i, j] / length
            desk.kept_lower[q] = min(desk.low[row], desk.right[i]) / length
            desk.kept_upper[q] = max(desk.up[row], desk.right[i]) / length
            desk.kept_ids[q] = row
            q += 1
    counts[KEPT] = q


@inlined
def move_row(A, i, B, k):
    """B[k] <- A[i]."""
    for j in range(A.shape[1]):
        B[k, j] = A[i, j]


@lean
def still_free(turned, i, c0, n, length):
    """Whether a row of that length has more than rounding left in the free directions."""
    return c0 < n and math.sqrt(sum_of_squares(turned, i, c0)) > 1e-12 * length
