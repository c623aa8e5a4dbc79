"""One step of an active-set search: the working set factored, and the way to the minimizer over it."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.active_set_room import (
    COUNTED,
    ENTERED,
    GOAL,
    GRADIENT,
    ORIGIN,
    POINT,
    REF_COL,
    REF_ROW,
    REF_TAU,
    STEP,
    TARGET,
    at,
    to_free,
    turn_rows,
)
from hqp_rp.core.kernels.compile import inlined, lean
from hqp_rp.core.kernels.householder import householder, longest_row
from hqp_rp.core.kernels.orthogonal import EPS, inverse_norm, level_least_squares, svd_level, turn_back_by
from hqp_rp.core.kernels.rows import NONE, NORM, TURNS, VALUE, WORKING, bound_of, level_norm, miss, release
from hqp_rp.core.kernels.vector import (
    add_multiple,
    reflect_four_rows,
    reflect_four_rows_by_raw,
    reflect_row,
    reflect_row_by_raw,
    swap_rows,
)
from hqp_rp.core.kernels.vector_rows import copy_row, scale_row

APART = 1e-3
"""A kept row of length one is held beside rows that are all met when this much of it is left in the freedom behind them."""


@inlined
def gather_held(address, rows, room, levels, nW, top):
    """Copy W, each row divided by the norm of the whole row (a row of zeros stays one), to the matrix at `top`."""
    for i in range(nW):
        row = room.lists[ENTERED, i]
        if rows.flags[TURNS, row] != levels:
            turn_rows(address, row, row + 1, levels)
        copy_row(room.matrix, top + i, rows.T, row)
        norm = rows.real[NORM, row]
        if norm > 0.0:
            scale_row(room.matrix, top + i, 1.0 / norm)
        room.real[ORIGIN, top + i] = top + i


@inlined
def gather_counted(rows, room, first, count, top):
    """Copy that part of B to the matrix at `top`."""
    for i in range(count):
        copy_row(room.matrix, top + i, rows.T, room.lists[COUNTED, first + i])
        room.real[ORIGIN, top + i] = top + i


@inlined
def list_counted(rows, room, r0, r1):
    """B: the working rows of the level; returns how many."""
    count = NONE
    for i in range(r0, r1):
        if rows.flags[WORKING, i]:
            room.lists[COUNTED, count] = i
            count += 1
    return count


@lean
def lq(address, i0, i1, c0, end, floor, t0):
    """`orthogonal.lq` of rows i0:i1 of the room's matrix, with `ORIGIN` as right-hand side; rows i1:end are turned too."""
    _, room = at(address)
    work = room.matrix
    origin = room.real[ORIGIN]
    steps = min(i1 - i0, work.shape[1] - c0)
    for j in range(steps):
        c = c0 + j
        top = i0 + j
        best, longest = longest_row(work, top, i1, c)
        norm = math.sqrt(longest)
        if not norm > floor:
            steps = j
            break
        if best != top:
            swap_rows(work, top, best)
            swap = origin[top]
            origin[top] = origin[best]
            origin[best] = swap
        alpha = work[top, c]
        beta = -norm if alpha >= 0.0 else norm
        factor = 1.0 / (beta * (beta - alpha))
        i = top + 1
        while i + 4 <= i1:
            reflect_four_rows_by_raw(work, i, top, c, beta, factor)
            i += 4
        while i < i1:
            reflect_row_by_raw(work, i, top, c, beta, factor)
            i += 1
        room.lists[REF_ROW, t0 + j] = top
        room.lists[REF_COL, t0 + j] = c
        room.real[REF_TAU, t0 + j] = householder(work, top, c, norm)
    i = i1
    while i + 4 <= end:
        for j in range(steps):
            reflect_four_rows(work, i, work, i0 + j, c0 + j, room.real[REF_TAU, t0 + j])
        i += 4
    while i < end:
        for j in range(steps):
            reflect_row(work, i, work, i0 + j, c0 + j, room.real[REF_TAU, t0 + j])
        i += 1
    return steps


@lean
def turn_back(address, step, t1):
    """Row `step` of `vectors` <- Q step by the first t1 reflectors of the matrix, in reverse order."""
    _, room = at(address)
    for t in range(t1 - 1, -1, -1):
        reflect_row(
            room.vectors, step, room.matrix, room.lists[REF_ROW, t], room.lists[REF_COL, t], room.real[REF_TAU, t]
        )


@lean
def factor_level(address, r0, r1, top, count, end, c0, t0, tol):
    """Factor `count` rows of level r0:r1, at `top` in the matrix, in the freedom behind column c0, as `triangle` does.

    Rows up to `end` are turned too. Returns (reflectors, whether no singular value counts as zero, smallest pivot).
    """
    rows, room = at(address)
    n = room.turns.shape[1]
    norm = level_norm(rows, r0, r1)
    if count == 0 or c0 >= n or norm == 0.0:
        return NONE, True, np.inf
    floor = min(64.0 * EPS, tol / math.sqrt(min(count, room.matrix.shape[1]))) * norm
    r = lq(address, top, top + count, c0, end, floor, t0)
    pivot = np.inf
    for i in range(r):
        pivot = min(pivot, abs(room.matrix[top + i, c0 + i]))
    if r == 0 or (r <= 30 and 2.0 * tol * norm * math.sqrt(4.0**r + 6.0 * r - 1.0) < 3.0 * pivot):
        return r, True, pivot
    return r, tol * norm * inverse_norm(room.matrix, top, c0, r) < 1.0, pivot


@lean
def answer_level(address, k, r0, r1, top, count, c0, r, proven, smallest, tol):
    """STEP[c0:c0 + rank] <- the least-squares answer of the factored rows to `TARGET`, the rank decided by the library's rule.

    Returns (rank, columns turned by an SVD into turns[k], smallest pivot of the rank, 0 where one was cut).
    """
    rows, room = at(address)
    target = room.real[TARGET]
    step = room.vectors[STEP]
    if r == 0:
        return r, r, np.inf
    if not proven:
        rank, pivot = svd_level(
            room.matrix, room.turns.shape[1], top, top + count, c0, top + count, r, rows.R, r0, r1, 1.0, tol, target,
            0, 0.0, 0.0, step, room.turns[k],
        )  # fmt: skip
        return rank, r, pivot
    level_least_squares(room.matrix, top, top + count, c0, r, target)
    for i in range(r):
        step[c0 + i] = target[i]
    return r, NONE, smallest


@lean
def reach_level(address, k, r0, r1, nW, nB, c0, tol, size):
    """Fill `STEP`, which leads to where all of B and W are at their bounds; B, factored first, stays factored.

    Returns (True, what the step is after as a length, smallest pivot), or False where they may not be independent.
    """
    rows, room = at(address)
    if nB + nW > room.turns.shape[1] - c0:
        return False, 0.0, 0.0
    work = room.matrix
    gather_counted(rows, room, 0, nB, 0)
    gather_held(address, rows, room, k, nW, nB)
    r, proven, pivot = factor_level(address, r0, r1, NONE, nB, nB + nW, c0, NONE, tol)
    if r < nB or not proven:
        return False, 0.0, 0.0
    if nW and lq(address, nB, nB + nW, c0 + nB, nB + nW, APART, nB) < nW:
        return False, 0.0, 0.0
    step = room.vectors[STEP]
    for j in range(len(step)):
        step[j] = 0.0
    sought = 0.0
    for i in range(nB + nW):
        s = 0.0
        if i < nB:
            own = room.lists[COUNTED, int(room.real[ORIGIN, i])]
            s = bound_of(rows, own) - rows.real[VALUE, own]
            sought = max(sought, abs(s))
        else:
            kept = room.lists[ENTERED, int(room.real[ORIGIN, i]) - nB]
            s = -miss(rows, size, kept) / rows.real[NORM, kept]
        for j in range(i):
            s -= work[i, c0 + j] * step[c0 + j]
        step[c0 + i] = s / work[i, c0 + i]
    turn_back(address, STEP, nB + nW)
    return True, sought, pivot


@lean
def factor_held(address, k, nW, nB, c0, depends):
    """Gather W and B and factor W; rows of W that depend on others of it leave it. Returns how many remain."""
    rows, room = at(address)
    entered = room.lists[ENTERED]
    origin = room.real[ORIGIN]
    gather_held(address, rows, room, k, nW, 0)
    gather_counted(rows, room, 0, nB, nW)
    if nW == 0:
        return nW
    rW = lq(address, NONE, nW, c0, nW + nB, depends, NONE)
    if rW < nW:
        for i in range(rW, nW):
            release(rows, entered[int(origin[i])])
        for i in range(rW):
            room.real[TARGET, i] = entered[int(origin[i])]
        for i in range(rW):
            entered[i] = int(room.real[TARGET, i])
            origin[i] = i
    return rW


@inlined
def toward_goal(address, levels, step):
    """Row `step` of `vectors` <- goal - x, in the coordinates of the freedom that finished levels left."""
    _, room = at(address)
    copy_row(room.vectors, step, room.vectors, GOAL)
    add_multiple(room.vectors[step], room.vectors, POINT, -1.0)
    to_free(address, levels, step + NONE)


@lean
def step_to_minimizer(address, k, r0, r1, last, top, rW, nB, c0, tol, size):
    """Fill `STEP`, which leads to the minimizer over the working set, from the factored W; factor B.

    In the `last` level, what is minimized is ||x - goal||; `GRADIENT` then is its gradient along W. Returns (reflectors, rank,
    columns turned by an SVD, what the step is after as a length, smallest pivot of the kept rank).
    """
    rows, room = at(address)
    work = room.matrix
    origin = room.real[ORIGIN]
    step = room.vectors[STEP]
    sought = 0.0
    if last:
        toward_goal(address, k, STEP)
        for j in range(c0):
            step[j] = 0.0
        for j in range(c0, len(step)):
            sought += abs(step[j])
        for t in range(rW):
            reflect_row(room.vectors, STEP, work, t, room.lists[REF_COL, t], room.real[REF_TAU, t])
        for j in range(rW):
            room.real[GRADIENT, j] = -step[c0 + j]
    else:
        for j in range(len(step)):
            step[j] = 0.0
    for i in range(rW):  # rows of W go (back) to their bounds
        kept = room.lists[ENTERED, int(origin[i])]
        s = -miss(rows, size, kept) / rows.real[NORM, kept]
        for j in range(i):
            s -= work[i, c0 + j] * step[c0 + j]
        step[c0 + i] = s / work[i, c0 + i]
        if last:
            room.real[GRADIENT, i] += step[c0 + i]
    r = rank = turned = NONE
    pivot = np.inf
    if nB:
        r, proven, smallest = factor_level(address, r0, r1, top, nB, top + nB, c0 + rW, rW, tol)
        for i in range(nB):
            own = room.lists[COUNTED, int(origin[top + i]) - top]
            s = bound_of(rows, own) - rows.real[VALUE, own]
            sought = max(sought, abs(s))
            for j in range(c0, c0 + rW):
                s -= work[top + i, j] * step[j]
            room.real[TARGET, i] = s
        rank, turned, pivot = answer_level(address, k, r0, r1, top, nB, c0 + rW, r, proven, smallest, tol)
        if turned:
            turn_back_by(room.turns[k], turned, step, c0 + rW)
    turn_back(address, STEP, rW + r)
    return r, rank, turned, sought, pivot


@lean
def factor_determined(address, k, r0, r1, held, count, c0, tol, depends):
    """Factor what a level determined, where that is not the working set of its last step: `held` rows of W, then its own.

    Returns (reflectors of W, reflectors of the level, rank, columns turned by an SVD).
    """
    rows, room = at(address)
    gather_counted(rows, room, 0, count, 0)
    for i in range(held):
        norm = rows.real[NORM, room.lists[COUNTED, i]]
        if norm > 0.0:
            scale_row(room.matrix, i, 1.0 / norm)
    for i in range(count):
        room.real[TARGET, i] = 0.0
    rW = lq(address, NONE, held, c0, count, depends, NONE)
    r, proven, smallest = factor_level(address, r0, r1, held, count - held, count, c0 + rW, rW, tol)
    rank, turned, _ = answer_level(address, k, r0, r1, held, count - held, c0 + rW, r, proven, smallest, tol)
    return rW, r, rank, turned
