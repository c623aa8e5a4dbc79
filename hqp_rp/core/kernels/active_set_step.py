"""One step of an active-set search: the working set factored, and the way to the minimizer over it."""

from __future__ import annotations

import numpy as np

from hqp_rp.core.kernels.active_set_room import (
    COUNTED,
    ENTERED,
    GRADIENT,
    ORIGIN,
    REF_COL,
    REF_ROW,
    REF_TAU,
    STEP,
    TARGET,
    to_free,
)
from hqp_rp.core.kernels.compile import lean
from hqp_rp.core.kernels.orthogonal import (
    level_least_squares,
    lq,
    svd_level,
    triangle,
    turn_back_by,
    turn_back_reflectors,
    turn_forward,
)
from hqp_rp.core.kernels.rows import NORM, VALUE, WORKING, bound_of, gather, gather_unit, level_norm, miss, release


@lean
def factor_working_set(rows, room, r0, r1, nW, c0, depends):
    """Gather W and B and factor W; rows of W that depend on others of it leave it.

    Returns (rows of W in the matrix, rows of W, rows of B).
    """
    nB = 0
    listed = room.lists[COUNTED]
    for i in range(r0, r1):
        if rows.flags[WORKING, i]:
            listed[nB] = i
            nB += 1
    work = room.matrix
    entered = room.lists[ENTERED]
    origin = room.real[ORIGIN]
    for i in range(nW):
        gather_unit(rows, entered[i], c0, work, i)
    for i in range(nB):
        gather(rows, listed[i], c0, work, nW + i)
    for i in range(nW + nB):
        origin[i] = i
    if nW == 0:
        return 0, 0, nB
    rW = lq(
        work, 0, nW, c0, nW + nB, origin, depends, 0, room.lists[REF_ROW], room.lists[REF_COL], room.real[REF_TAU]
    )  # fmt: skip
    if rW < nW:
        for i in range(rW, nW):
            release(rows, entered[int(origin[i])])
        for i in range(rW):
            room.real[TARGET, i] = entered[int(origin[i])]
        for i in range(rW):
            entered[i] = int(room.real[TARGET, i])
            origin[i] = i
    return nW, rW, nB


@lean
def factor_level(rows, room, r0, r1, top, count, c0, rW, tol):
    """Factor `count` rows of level r0:r1, at `top` in the matrix, in the freedom behind column c0 + rW; as `triangle`."""
    return triangle(
        room.matrix, top, top + count, c0 + rW, top + count, room.real[ORIGIN], level_norm(rows, r0, r1), tol, rW,
        room.lists[REF_ROW], room.lists[REF_COL], room.real[REF_TAU],
    )  # fmt: skip


@lean
def answer_level(room, A, scale, r0, r1, top, count, c0, r, proven, tol, k, step):
    """step[c0:c0 + rank] <- the least-squares answer of the factored rows to `TARGET`, the rank decided by the library's rule.

    Returns (rank, columns turned by an SVD into turns[k], smallest pivot of the rank, 0 where one was cut).
    """
    target = room.real[TARGET]
    if r == 0:
        return 0, 0, np.inf
    if not proven:
        rank, pivot = svd_level(
            room.matrix, room.turns.shape[1], top, top + count, c0, top + count, r, A, r0, r1, scale, tol, target,
            0, 0.0, 0.0, step, room.turns[k],
        )  # fmt: skip
        return rank, r, pivot
    level_least_squares(room.matrix, top, top + count, c0, r, target)
    pivot = np.inf
    for i in range(r):
        step[c0 + i] = target[i]
        pivot = min(pivot, abs(room.matrix[top + i, c0 + i]))
    return r, 0, pivot


@lean
def step_to_minimizer(rows, room, k, A, scale, z, r0, r1, last, top, rW, nB, c0, tol, size):
    """Fill `STEP`, which leads to the minimizer over the working set, from the factored W; factor B.

    In the `last` level, what is minimized is ||x - z||; `GRADIENT` then is its gradient along W. Returns (reflectors, rank,
    columns turned by an SVD, what the step is after as a length, smallest pivot of the kept rank).
    """
    n = room.turns.shape[1]
    work = room.matrix
    origin = room.real[ORIGIN]
    step = room.real[STEP]
    for j in range(len(step)):
        step[j] = 0.0
    sought = 0.0
    row, col, tau = room.lists[REF_ROW], room.lists[REF_COL], room.real[REF_TAU]
    if last:
        for j in range(n):
            step[j] = z[j] - rows.x[j]
        to_free(room, k, step)
        for j in range(c0):
            step[j] = 0.0
        for j in range(c0, n):
            sought += abs(step[j])
        turn_forward(work, step, 0, rW, row, col, tau)
        for j in range(rW):
            room.real[GRADIENT, j] = -step[c0 + j]
    for i in range(rW):  # rows of W go (back) to their bounds
        kept = room.lists[ENTERED, int(origin[i])]
        s = -miss(rows, size, kept) / rows.real[NORM, kept]
        for j in range(i):
            s -= work[i, c0 + j] * step[c0 + j]
        step[c0 + i] = s / work[i, c0 + i]
        if last:
            room.real[GRADIENT, i] += step[c0 + i]
    r = 0
    rank = 0
    turned = 0
    pivot = np.inf
    if nB:
        r, proven = factor_level(rows, room, r0, r1, top, nB, c0, rW, tol)
        for i in range(nB):
            own = room.lists[COUNTED, int(origin[top + i]) - top]
            s = bound_of(rows, own) - rows.real[VALUE, own]
            sought = max(sought, abs(s))
            for j in range(c0, c0 + rW):
                s -= work[top + i, j] * step[j]
            room.real[TARGET, i] = s
        rank, turned, pivot = answer_level(room, A, scale, r0, r1, top, nB, c0 + rW, r, proven, tol, k, step)
        if turned:
            turn_back_by(room.turns[k], turned, step, c0 + rW)
        turn_back_reflectors(work, step, rW, rW + r, row, col, tau)
    turn_back_reflectors(work, step, 0, rW, row, col, tau)
    return r, rank, turned, sought, pivot


@lean
def factor_determined(rows, room, A, scale, r0, r1, held, count, c0, tol, depends, k):
    """Factor what a level determined, where that is not the working set of its last step: `held` rows of W, then its own.

    Returns (reflectors of W, reflectors of the level, rank, columns turned by an SVD).
    """
    listed = room.lists[COUNTED]
    origin = room.real[ORIGIN]
    for i in range(held):
        gather_unit(rows, listed[i], c0, room.matrix, i)
    for i in range(held, count):
        gather(rows, listed[i], c0, room.matrix, i)
    for i in range(count):
        origin[i] = i
        room.real[TARGET, i] = 0.0
    rW = 0
    if held:
        rW = lq(
            room.matrix, 0, held, c0, count, origin, depends, 0,
            room.lists[REF_ROW], room.lists[REF_COL], room.real[REF_TAU],
        )  # fmt: skip
    r, proven = factor_level(rows, room, r0, r1, held, count - held, c0, rW, tol)
    rank, turned, _ = answer_level(
        room, A, scale, r0, r1, held, count - held, c0 + rW, r, proven, tol, k, room.real[STEP]
    )
    return rW, r, rank, turned
