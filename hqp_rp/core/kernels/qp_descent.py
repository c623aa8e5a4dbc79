"""A lexicographic descent by QPs, on arrays that are kept between problems: `begin`, then `advance` and `answer` in turn.

`advance` goes on until a back end has to solve a QP, and says which: (code, t, m, soft, guessed). The QP lies in `Desk.qp`,
cut by `qp_parts`. Stages: 0 the hard rows (maybe none), 1 ... p the levels, p + 1 the distance to the start. One kernel for
all would take longer to compile: numba compiles what a kernel calls once more with it.
"""

from __future__ import annotations

import math

from hqp_rp.core.kernels.compile import lean
from hqp_rp.core.kernels.qp_desk import (
    CODE,
    KEPT,
    POLISH,
    QP_ROWS,
    SIZE,
    SOFT,
    STAGE,
    TAKEN,
    TOLERANCE,
    M,
    N,
    P,
    T,
    desk_of,
    qp_parts,
)
from hqp_rp.core.kernels.qp_factor import length_of, scale_rows
from hqp_rp.core.kernels.qp_finish import finish_stage
from hqp_rp.core.kernels.qp_polish import polish_in_place
from hqp_rp.core.kernels.qp_rows import stage_qp
from hqp_rp.core.kernels.room import as_matrix

DONE = 0
NOT_FINITE = 1
PLAIN = 2  # asks for the QP without rows, 1/2 ||w||^2 + gradient . w
ROWS = 3  # asks for a QP with rows
VIOLATED = 4  # hard rows remain violated beyond the tolerance after their stage: `advance` goes on all the same


@lean
def begin(hard, hard_lower, hard_upper, matrix, lower, upper, offsets, numbers, counts):
    """Take up a problem; `numbers` and `counts` hold its sizes, the settings and the start already."""
    desk = desk_of(numbers, counts)
    h, n = hard.shape
    load_rows(hard, hard_lower, hard_upper, desk, 0)
    load_rows(matrix, lower, upper, desk, h)
    desk.offsets[0] = 0
    for k in range(len(offsets)):
        desk.offsets[k + 1] = h + offsets[k]
    for i in range(len(desk.side)):
        desk.side[i] = 0
    for j in range(len(desk.x)):
        desk.x[j] = desk.start[j]
        desk.least[j] = desk.start[j]
    for i in range(n):
        for j in range(desk.turned.shape[1]):
            desk.turned[i, j] = 1.0 if i == j else 0.0
    counts[TAKEN] = 0
    counts[KEPT] = 0
    counts[STAGE] = -1
    counts[CODE] = DONE


@lean
def load_rows(matrix, lower, upper, desk, r0):
    """Copy rows and bounds to the desk, from its row r0 on."""
    for i in range(len(lower)):
        for j in range(matrix.shape[1]):
            desk.raw[r0 + i, j] = matrix[i, j]
        desk.lower[r0 + i] = lower[i]
        desk.upper[r0 + i] = upper[i]


@lean
def advance(numbers, counts):
    """The stages that need no QP, up to one that does or to the end."""
    if counts[CODE] != VIOLATED and left_violated(numbers, counts):
        counts[CODE] = VIOLATED
        return VIOLATED, 0, 0, 0, False
    desk = desk_of(numbers, counts)
    last = counts[P] + 1
    while counts[STAGE] < last and counts[TAKEN] < counts[N]:  # else nothing can move any more
        counts[STAGE] += 1
        k = counts[STAGE]
        if k < last:
            r0 = desk.offsets[k]
            r1 = desk.offsets[k + 1]
            if r0 == r1:
                continue
            if not scale_rows(desk, r0, r1, k == 0):
                return NOT_FINITE, 0, 0, 0, False  # in scaled units a bound overflows: x is beyond what floats hold
        guessed = stage_qp(numbers, counts)
        if numbers[SIZE] > 0.0 and counts[T] > 0:
            counts[CODE] = ROWS if counts[QP_ROWS] > 0 else PLAIN
            return counts[CODE], counts[T], counts[QP_ROWS], counts[SOFT], guessed
        finish_stage(numbers, counts, desk.qp[:0], desk.qp[:0])
    counts[CODE] = DONE
    return (DONE if math.isfinite(length_of(desk.x)) else NOT_FINITE), 0, 0, 0, False


@lean
def left_violated(numbers, counts):
    """After the stage of the hard rows: remember where they left x, and say whether one is violated beyond the tolerance."""
    desk = desk_of(numbers, counts)
    if counts[STAGE] != 0:
        return False
    n = counts[N]
    for j in range(n):
        desk.least[j] = desk.x[j]
    x_size = length_of(desk.x)
    for i in range(desk.offsets[1]):
        value = 0.0
        s = 0.0
        for j in range(n):
            value += desk.raw[i, j] * desk.x[j]
            s += desk.raw[i, j] ** 2
        bound = min(max(value, desk.lower[i]), desk.upper[i])
        # Not "a > b": what is not a number counts as violated.
        if value != bound and not abs(value - bound) <= numbers[TOLERANCE] * (math.sqrt(s) * x_size + abs(bound)):
            return True
    return False


@lean
def answer(numbers, counts, t, y):
    """Polish and take the answer to the QP that was asked for: t (T or more,), y (QP_ROWS,); without one (t empty) x stays."""
    desk = desk_of(numbers, counts)
    k = counts[STAGE]
    size = numbers[SIZE]
    nt = counts[T]
    count = counts[QP_ROWS]
    soft = counts[SOFT]
    a, b, c, e, f, g, H, _, _, _, _, _, _ = qp_parts(nt, count, soft)
    q = desk.qp
    step = q[f:g]
    multipliers = q[g:H]
    total = 0.0
    found = len(t) >= nt and len(y) == count
    for j in range(nt):
        step[j] = t[j] if found else 0.0
        total += step[j]
    for i in range(count):
        multipliers[i] = y[i] if found else 0.0
        total += multipliers[i]
    found = found and math.isfinite(total)
    if not found:
        for i in range(count):
            multipliers[i] = 0.0
    elif counts[POLISH] and count > 0:
        polish_in_place(q[:a], q[a:b], as_matrix(q[b:c], count, nt), q[c:e], q[e:f], soft, step, multipliers)
    desk.known[k] = 1
    for i in range(counts[M]):
        desk.guess_y[k, i] = 0.0
    for i in range(soft):
        desk.guess_y[k, desk.S[i]] = multipliers[i] * size
    for i in range(soft, count):
        length = desk.lengths[i]
        desk.guess_y[k, desk.kept_ids[i - soft]] = multipliers[i] * size / (length if length > 0.0 else 1.0)
    finish_stage(numbers, counts, step[: nt if found else 0], multipliers)
    for j in range(counts[N]):
        desk.guess_x[k, j] = desk.x[j]
