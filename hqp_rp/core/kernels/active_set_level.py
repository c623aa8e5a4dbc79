"""One level of an active-set search: met where its rows allow it, else minimized over what earlier levels reached."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.active_set_codes import LIMIT, NOT_FINITE, SOLVED
from hqp_rp.core.kernels.active_set_pivot import (
    enter_crossed,
    enter_guess,
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
    NEXT,
    POINT,
    STEP,
    at,
    from_free,
)
from hqp_rp.core.kernels.active_set_step import (
    factor_held,
    list_counted,
    reach_level,
    step_to_minimizer,
)
from hqp_rp.core.kernels.cascade import finite
from hqp_rp.core.kernels.compile import inlined, lean
from hqp_rp.core.kernels.orthogonal import EPS
from hqp_rp.core.kernels.rows import (
    KEPT,
    NONE,
    STATE,
    activate,
    compress,
    first_to_block,
    miss,
    set_length,
    set_values,
    still,
    try_step,
)
from hqp_rp.core.kernels.vector import add_multiple, sum_of_squares
from hqp_rp.core.kernels.vector_rows import copy_row

REACHES = 3
"""Steps tried in a level to where all of its counted rows are met."""

BLOCK_PIVOTS = 6
"""Block pivots tried in a level before the primal search takes over."""


@inlined
def length_of(vectors, i):
    """Length of a row of `vectors`."""
    return math.sqrt(sum_of_squares(vectors, i, 0))


@inlined
def length_behind(vectors):
    """||x + move||; `NEXT` <- that point."""
    copy_row(vectors, NEXT, vectors, POINT)
    add_multiple(vectors[NEXT], vectors, MOVE, 1.0)
    return math.sqrt(sum_of_squares(vectors, NEXT, 0))


@inlined
def move_to_next(vectors, size):
    """x <- `NEXT`, of length `size`; False when it is not finite."""
    copy_row(vectors, POINT, vectors, NEXT)
    return size < np.inf or finite(vectors[POINT])


@inlined
def came_from_afar(rows, vectors, end, begun, length):
    """Whether x has become so much shorter that the rows' values would carry the rounding error of where it was.

    Then they are computed anew, and the level is not done before a step from there.
    """
    afar = begun > 16.0 * length
    if afar:
        set_values(rows, vectors, POINT, 0, end)
    return afar


@lean
def meet_level(address, k, r0, r1, nW, c0, tol, depends, allowed):
    """Step to where all rows of B and W are at their bounds, and let rows that this would violate enter W.

    Returns (whether the level is met, steps, rows of W, of B, smallest pivot, ||x||, whether x is finite).
    """
    rows, room = at(address)
    vectors = room.vectors
    most = room.turns.shape[1] - c0
    nB = list_counted(rows, room, r0, r1)
    tried = 0
    while tried < min(REACHES, allowed):
        begun = size = length_of(vectors, POINT)
        reached, sought, pivot = reach_level(address, k, r0, r1, nW, nB, c0, tol, size)
        if not reached:
            break
        tried += 1
        from_free(address, k)
        span = length_of(vectors, STEP)
        if not span > 4.0 * EPS * (size + sought):  # the step is rounding error
            return True, tried, nW, nB, pivot, size + sought, True
        outside = try_step(rows, vectors, MOVE, r1, r0)
        length = length_behind(vectors)
        size = length + sought
        missed = 0
        for i in range(nB):
            if miss(rows, size, room.lists[COUNTED, i]) != 0.0:
                missed += 1
        crossed = 0
        if missed == 0 and outside:
            nW, crossed = enter_crossed(address, r1, r0, nW, most, size, span, depends)
        if missed == 0 and crossed == 0:
            is_finite = move_to_next(vectors, length)
            if not came_from_afar(rows, vectors, r1, begun, length):
                return True, tried, nW, nB, pivot, size, is_finite
            continue
        set_length(rows, r1, r0, 0.0)
        if missed:
            break
        nB = list_counted(rows, room, r0, r1)
    return False, tried, nW, nB, 0.0, 0.0, True


@lean
def search_level(address, k, r0, r1, last, nW, c0, tol, depends, pivoted, allowed):
    """Minimize level k; `pivoted` when W is not that of the start any more.

    Returns (code, iterations, rows of W, of W while factored, of B, reflectors of B, rank, turned, residual, pivot, size).
    """
    rows, room = at(address)
    vectors = room.vectors
    end = r1
    most = room.turns.shape[1] - c0
    blocks = BLOCK_PIVOTS
    idle = NONE
    bland = idle > room.turns.shape[1]
    iterations = 0
    guess = guessable(rows, r0, r1)
    entered = room.lists[ENTERED]
    while True:
        iterations += 1
        if iterations > allowed:
            return LIMIT, iterations, nW, nW, nW, nW, nW, nW, 0.0, 0.0, 0.0
        if pivoted and guess:
            guess = False
            nW = enter_guess(address, k, r0, r1, last, nW, c0)
        nB = list_counted(rows, room, r0, r1)
        top = nW
        nW = factor_held(address, k, nW, nB, c0, depends)
        begun = size = length_of(vectors, POINT)
        r, rank, turned, sought, pivot = step_to_minimizer(address, k, r0, r1, last, top, nW, nB, c0, tol, size)
        size += sought  # the rounding error of what the step is after counts like that of x
        from_free(address, k)
        span = length_of(vectors, STEP)
        moves = span > 4.0 * EPS * size  # else the step is rounding error
        if moves:
            try_step(rows, vectors, MOVE, end, r0)
        else:
            still(rows, end, r0)
        if blocks > 0:
            blocks -= 1
            length = length_behind(vectors)
            size = length + sought
            residual = multipliers(address, top, nW, nB, c0, last, size)
            before = nW
            nW, left, crossed = pivot_block(address, end, r0, nW, nB, most, residual, size, span, depends)
            if crossed == 0:
                if moves and not move_to_next(vectors, length):
                    return NOT_FINITE, iterations, nW, nW, nB, r, rank, turned, residual, pivot, size
                if left == 0 and not (moves and came_from_afar(rows, vectors, end, begun, length)):
                    return SOLVED, iterations, nW, before, nB, r, rank, turned, residual, pivot, size
            else:
                set_length(rows, end, r0, 0.0)
            pivoted = True
            if blocks == 0:
                nW = start_from_values(address, r0, r1, nW, length_of(vectors, POINT))
            continue
        length, blocking, which = 1.0, -1, 0
        if moves:
            length, blocking, which = first_to_block(rows, end, r0, span, 1e-12 * size if bland else 0.0, depends)
            set_length(rows, end, r0, length)
            add_multiple(vectors[POINT], vectors, MOVE, length)
            if not finite(vectors[POINT]):
                return NOT_FINITE, iterations, nW, nW, nB, r, rank, turned, 0.0, pivot, size
        size = length_of(vectors, POINT) + sought
        idle = idle + 1 if length * span <= 1e-13 * size else 0
        bland = idle > room.turns.shape[1]
        if blocking >= 0:
            activate(rows, blocking, which)
            if rows.flags[STATE, blocking] == KEPT:
                entered[nW] = blocking
                nW += 1
            continue
        residual = multipliers(address, top, nW, nB, c0, last, size)
        worst = row_to_leave(address, nW, nB, residual, size, bland)
        if worst < 0:
            return SOLVED, iterations, nW, nW, nB, r, rank, turned, residual, pivot, size
        leave(rows, worst)
        nW = compress(entered, nW, rows)
