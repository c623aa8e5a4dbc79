"""Lexicographic least squares with two-sided rows at any level: an active set searched level by level.

Level k minimizes the squared violation of its rows over the points that keep what earlier levels reached. Its working set
holds kept rows at their bounds (W, equalities of a step) and its own rows that count (B: equalities and violated rows, the
least squares of a step). Each step factors [W; B] afresh by orthogonal transformations. Rows that are then determined
(equalities, violated rows, rows held by a multiplier) leave for good together with the directions they determine; satisfied
rows are kept as rows.

The search of a level starts with block pivots: every row that the whole step would violate enters, every row whose
multiplier has the wrong sign leaves, nothing moves until the working set allows it. That mostly ends after a few
factorizations, and where it ends it has found the optimum. Where it does not, the primal search takes over from the last
point that kept every bound: it moves until a row blocks, one row at a time, and cannot cycle.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.active_set_pivot import (
    enter_guess,
    enter_level,
    guessable,
    leave,
    multipliers,
    pivot_block,
    row_to_leave,
    start_from_values,
)
from hqp_rp.core.kernels.active_set_room import (
    COUNTED,
    ENTERED,
    MOVE,
    MULTIPLIER,
    REF_COL,
    REF_ROW,
    REF_TAU,
    STEP,
    from_free,
    keep_turns,
    make_room,
)
from hqp_rp.core.kernels.active_set_step import factor_determined, factor_working_set, step_to_minimizer
from hqp_rp.core.kernels.cascade import finite
from hqp_rp.core.kernels.compile import inlined, kernel, lean
from hqp_rp.core.kernels.householder import padded
from hqp_rp.core.kernels.orthogonal import EPS
from hqp_rp.core.kernels.rows import (
    BEFORE,
    CHANGE,
    CONFLICT,
    FIXED,
    KEPT,
    LOW,
    NORM,
    STATE,
    UP,
    VALUE,
    WORKING,
    Rows,
    activate,
    bound_of,
    compress,
    first_to_block,
    length_of,
    load_rows,
    miss,
    release,
    set_length,
    set_values,
    try_step,
    turn_rows,
    turn_rows_by,
)

SOLVED = 0
LIMIT = 1
INFEASIBLE = 2
NOT_FINITE = 3
DELICATE = 4  # solved, but a level was kept by a pivot so small that multipliers near rounding error decided

BLOCK_PIVOTS = 6
"""Block pivots tried in a level before the primal search takes over."""

BLIND_PIVOTS = 1
"""How many of them are tried before the working set is guessed."""


@lean
def still(rows, end, r0):
    """The change of a step that is rounding error: none."""
    for i in range(end):
        if i >= r0 or rows.flags[STATE, i] == KEPT:
            rows.real[CHANGE, i] = 0.0
            rows.real[BEFORE, i] = rows.real[VALUE, i]


@inlined
def length_behind(x, change):
    """||x + change||."""
    s = 0.0
    for j in range(len(x)):
        s += (x[j] + change[j]) * (x[j] + change[j])
    return math.sqrt(s)


@inlined
def move(rows, room, length):
    """x += length * `MOVE`; False when x is not finite."""
    changed = room.real[MOVE]
    finite = True
    for j in range(len(rows.x)):
        rows.x[j] += length * changed[j]
        if not abs(rows.x[j]) < np.inf:
            finite = False
    return finite


@lean
def search_level(rows, room, k, A, scale, z, r0, r1, last, nW, c0, tol, depends, allowed):
    """Minimize level k. Returns (code, iterations, rows of W, of B, reflectors, rank, turned, residual, pivot, size)."""
    n = room.turns.shape[1]
    end = r1
    most = n - c0
    blocks = BLOCK_PIVOTS
    bland = False
    idle = 0
    iterations = 0
    entered = room.lists[ENTERED]
    while True:
        iterations += 1
        top, nW, nB = factor_working_set(rows, room, r0, r1, nW, c0, depends)
        size = length_of(rows.x)
        r, rank, turned, sought, pivot = step_to_minimizer(
            rows, room, k, A, scale, z, r0, r1, last, top, nW, nB, c0, tol, size
        )
        if iterations > allowed:
            return LIMIT, iterations, nW, nB, r, rank, turned, 0.0, pivot, size
        size += sought  # the rounding error of what the step is after counts like that of x
        from_free(room, k, room.real[STEP], room.real[MOVE])
        span = length_of(room.real[STEP, :n])
        moves = span > 4.0 * EPS * size  # else the step is rounding error
        if moves:
            try_step(rows, end, r0, c0, room.real[STEP])
        else:
            still(rows, end, r0)
        if blocks > 0:
            blocks -= 1
            set_length(rows, end, r0, 1.0)
            size = length_behind(rows.x, room.real[MOVE]) + sought
            residual = multipliers(rows, room, top, nW, nB, c0, last, size)
            before = nW
            nW, left, crossed = pivot_block(rows, room, end, r0, nW, nB, most, residual, size, span, depends)
            if crossed == 0:
                if moves and not move(rows, room, 1.0):
                    return NOT_FINITE, iterations, nW, nB, r, rank, turned, residual, pivot, size
                if left == 0:
                    return SOLVED, iterations, before, nB, r, rank, turned, residual, pivot, size
            else:
                set_length(rows, end, r0, 0.0)
            if blocks == BLOCK_PIVOTS - BLIND_PIVOTS and guessable(rows, r0, r1):
                nW = enter_guess(rows, room, k, z, r0, r1, last, nW, c0)
            if blocks == 0:
                nW = start_from_values(rows, room, r0, r1, nW, length_of(rows.x))
            continue
        length, blocking, which = 1.0, -1, 0
        if moves:
            length, blocking, which = first_to_block(rows, end, r0, span, 1e-12 * size if bland else 0.0, depends)
            set_length(rows, end, r0, length)
            if not move(rows, room, length):
                return NOT_FINITE, iterations, nW, nB, r, rank, turned, 0.0, pivot, size
        size = length_of(rows.x) + sought
        idle = idle + 1 if length * span <= 1e-13 * size else 0
        bland = idle > n
        if blocking >= 0:
            activate(rows, blocking, which)
            if rows.flags[STATE, blocking] == KEPT:
                entered[nW] = blocking
                nW += 1
            continue
        residual = multipliers(rows, room, top, nW, nB, c0, last, size)
        worst = row_to_leave(rows, room, nW, nB, residual, size, bland)
        if worst < 0:
            return SOLVED, iterations, nW, nB, r, rank, turned, residual, pivot, size
        leave(rows, worst)
        nW = compress(entered, nW, rows)


@lean
def settle(rows, room, r0, r1, nW, hard_rows, residual, size):
    """Sort the rows of a finished level into those it determined (rows of W held by a multiplier first) and kept ones.

    The former are listed in `COUNTED`. Returns (size of W, rows of W determined, rows determined, contradicting hard rows).
    """
    entered = room.lists[ENTERED]
    determined = room.lists[COUNTED]
    count = 0
    still_in = 0
    for i in range(nW):
        row = entered[i]
        if residual > 0.0 and room.real[MULTIPLIER, i] * rows.side[row] > 1e-13 * residual:
            determined[count] = row
            count += 1
        else:
            entered[still_in] = row
            still_in += 1
    nW = still_in
    held = count
    contradicting = 0
    for i in range(r0, r1):
        working = rows.flags[WORKING, i] != 0
        w = miss(rows, size, i) if working else 0.0
        if working and (rows.real[LOW, i] == rows.real[UP, i] or w != 0.0):
            determined[count] = i
            count += 1
        else:
            rows.flags[STATE, i] = KEPT
            rows.real[LOW, i] = min(rows.real[LOW, i], rows.real[VALUE, i])
            rows.real[UP, i] = max(rows.real[UP, i], rows.real[VALUE, i])
            if working and nW < len(rows.x):
                entered[nW] = i
                nW += 1
            elif working:
                release(rows, i)
        if i < hard_rows and w != 0.0:
            rows.flags[CONFLICT, i] = 1
            if abs(w) > 1e-9 * (rows.real[NORM, i] * (size + 1.0) + abs(bound_of(rows, i))):
                contradicting += 1
    for i in range(count):
        rows.flags[STATE, determined[i]] = FIXED
    return nW, held, count, contradicting


@kernel
def hierarchical_active_set(A, lower, upper, offsets, hard_rows, z, tol, limit, go_on, x, side):
    """Solve; returns (code, iterations). Level 0 is the hard rows (rows 0 ... hard_rows - 1; may be empty).

    x (n,): where to start, then the answer. side (M,): the bound at which a row is thought to be active (-1, 0, +1), then
    the bounds at which rows are active; when INFEASIBLE, 1 for each hard row of the contradiction and 0 for others. The answer
    is then the point of least violation, and the levels are optimized over such points only with `go_on`. DELICATE: solved
    near a singularity, where the answer should be verified.
    """
    M, n = A.shape
    p = len(offsets) - 1
    largest = 0
    for k in range(p):
        largest = max(largest, offsets[k + 1] - offsets[k])
    rows = Rows(np.empty((M, padded(n))), np.empty((6, M)), np.empty((4, M), np.int64), side, x)
    room = make_room(M, n, p, largest)
    return search(rows, room, np.empty(p + 1), A, lower, upper, offsets, hard_rows, z, tol, limit, go_on)


@inlined
def name_conflict(rows):
    """side <- 1 for each hard row of the contradiction, 0 for others."""
    for i in range(len(rows.side)):
        rows.side[i] = rows.flags[CONFLICT, i]


@lean
def search(rows, room, scale, A, lower, upper, offsets, hard_rows, z, tol, limit, go_on):
    """`hierarchical_active_set` in a given room."""
    M, n = A.shape
    p = len(offsets) - 1
    if not load_rows(A, lower, upper, offsets, rows, scale):
        return NOT_FINITE, 0
    scale[p] = 1.0
    depends = max(tol, 1e-12)  # a kept row whose free part is smaller than this depends on the working set
    iterations = 0
    contradicting = 0
    smallest = np.inf
    nW = 0
    c0 = 0
    for k in range(p + 1):
        last = k == p
        r0 = offsets[k] if not last else M
        r1 = offsets[k + 1] if not last else M
        if c0 == n:
            break
        if r0 == r1 and not last:
            keep_turns(room, k, 0, 0, c0)
            continue
        set_values(A, scale[k], rows, r0, r1)
        nW = enter_level(rows, room, r0, r1, nW, n - c0)
        code, tried, nW, nB, r, rank, turned, residual, pivot, size = search_level(
            rows, room, k, A, scale[k], z, r0, r1, last, nW, c0, tol, depends, limit - iterations
        )
        iterations += tried
        if code != SOLVED:
            return code, iterations
        if last:
            break
        smallest = min(smallest, pivot)
        entered = nW
        nW, held, count, more = settle(rows, room, r0, r1, nW, hard_rows, residual, size)
        contradicting += more
        if contradicting and not go_on:
            name_conflict(rows)
            return INFEASIBLE, iterations
        rW = entered
        if count == 0:
            rW, r, rank, turned = 0, 0, 0, 0
        elif held < entered or count - held < nB:  # not the set of the last factorization
            rW, r, rank, turned = factor_determined(rows, room, A, scale[k], r0, r1, held, count, c0, tol, depends, k)
        keep_turns(room, k, rW + r, turned, c0 + rW)
        turn_rows(rows, M, room.matrix, rW + r, room.lists[REF_ROW], room.lists[REF_COL], room.real[REF_TAU])
        if turned:
            turn_rows_by(rows, M, room.turns[k], turned, c0 + rW)
        c0 += rW + rank
    if not finite(rows.x):
        return NOT_FINITE, iterations
    if contradicting:
        name_conflict(rows)
        return INFEASIBLE, iterations
    return DELICATE if smallest < 1e-6 else SOLVED, iterations
