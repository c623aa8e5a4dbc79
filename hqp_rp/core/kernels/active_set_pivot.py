"""Which rows enter and leave the working set of an active-set search: first sets, multipliers, block pivots, guesses."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.active_set_room import COUNTED, ENTERED, GRADIENT, MULTIPLIER, NEXT, ORIGIN, at, turn_rows
from hqp_rp.core.kernels.active_set_step import toward_goal
from hqp_rp.core.kernels.compile import inlined, lean
from hqp_rp.core.kernels.orthogonal import EPS
from hqp_rp.core.kernels.predict import guess_working_set
from hqp_rp.core.kernels.rows import (
    CHANGE,
    GUESS,
    KEPT,
    LOW,
    NONE,
    NORM,
    STATE,
    UP,
    VALUE,
    WORKING,
    activate,
    beyond,
    compress,
    miss,
    release,
)


@lean
def start_from_values(address, r0, r1, nW, size):
    """Working set of the point where the search stands: rows of the level that it violates, of W those at their bounds."""
    rows, room = at(address)
    for i in range(r0, r1):
        value = rows.real[VALUE, i]
        if rows.real[LOW, i] == rows.real[UP, i] or value > rows.real[UP, i]:
            activate(rows, i, 1)
        elif value < rows.real[LOW, i]:
            activate(rows, i, -1)
        else:
            release(rows, i)
    listed = room.lists[ENTERED]
    for i in range(nW):
        if miss(rows, size, listed[i]) != 0.0:
            release(rows, listed[i])
    return compress(listed, nW, rows)


@lean
def enter_level(address, r0, r1, size):
    """Working rows to start a level with: equalities, what is violated and, beside such rows, what is guessed.

    False when no row counts: then the level is met where the search stands.
    """
    rows, _ = at(address)
    counts = False
    for i in range(r0, r1):
        if rows.real[LOW, i] == rows.real[UP, i]:
            activate(rows, i, 1)
            counts = True
        elif beyond(rows, i, size):
            counts = True
    if not counts:
        return False
    for i in range(r0, r1):
        low, up, value, guess = rows.real[LOW, i], rows.real[UP, i], rows.real[VALUE, i], rows.flags[GUESS, i]
        if low < up:
            if value > up or (guess > 0 and up < np.inf):
                activate(rows, i, 1)
            elif value < low or (guess < 0 and low > -np.inf):
                activate(rows, i, -1)
    return True


@lean
def enter_guessed(address, r0, nW, most):
    """W with the kept rows that are guessed; returns its size."""
    rows, room = at(address)
    for i in range(r0):
        guess = rows.flags[GUESS, i]
        if guess == 0 or rows.flags[STATE, i] != KEPT or rows.flags[WORKING, i] or nW >= most:
            continue
        if abs(rows.real[UP, i] if guess > 0 else rows.real[LOW, i]) < np.inf:
            activate(rows, i, guess)
            room.lists[ENTERED, nW] = i
            nW += 1
    return nW


@lean
def multipliers(address, top, nW, nB, c0, last, size):
    """Fill `MULTIPLIER` of W from L^T multiplier = -gradient; returns the largest miss of B, or in the last level ||gradient||.

    A row of the level has its own miss as multiplier.
    """
    rows, room = at(address)
    work = room.matrix
    origin = room.real[ORIGIN]
    gradient = room.real[GRADIENT]
    found = room.real[MULTIPLIER]
    residual = 0.0
    for i in range(nB):
        residual = max(residual, abs(miss(rows, size, room.lists[COUNTED, i])))
    for i in range(nW):
        found[i] = 0.0
    if last:
        residual = 0.0
        for i in range(nW):
            residual += gradient[i] * gradient[i]
        residual = math.sqrt(residual)
    if nW == 0 or residual == 0.0:
        return residual
    if not last:
        for j in range(nW):
            gradient[j] = 0.0
        for i in range(nB):
            w = miss(rows, size, room.lists[COUNTED, int(origin[top + i]) - top])
            for j in range(nW):
                gradient[j] += w * work[top + i, c0 + j]
    for i in range(nW - 1, -1, -1):
        s = -gradient[i]
        for j in range(i + 1, nW):
            s -= work[j, c0 + i] * found[int(origin[j])]
        found[int(origin[i])] = s / work[i, c0 + i]
    return residual


@inlined
def wrong_of_level(rows, row, size):
    """How far inside its bounds a counted row of the level is, > 0 when it should not count."""
    inside = -miss(rows, size, row) * rows.side[row]
    return inside if rows.real[LOW, row] < rows.real[UP, row] else 0.0


@inlined
def wrong_of_kept(rows, room, i, floor):
    """The multiplier of row i of W where it has the wrong sign and is above rounding error, else 0."""
    wrong = -room.real[MULTIPLIER, i] * rows.side[room.lists[ENTERED, i]]
    return wrong if wrong > floor else 0.0


@inlined
def leave(rows, row):
    """Release a row, or turn it to its other bound when a step carried it across a narrow band."""
    if rows.flags[STATE, row] != KEPT and rows.real[VALUE, row] < rows.real[LOW, row]:
        rows.side[row] = -1
    elif rows.flags[STATE, row] != KEPT and rows.real[VALUE, row] > rows.real[UP, row]:
        rows.side[row] = 1
    else:
        release(rows, row)


@lean
def row_to_leave(address, nW, nB, residual, size, bland):
    """The row whose multiplier is most wrong, by Bland's rule the first such row; -1 at the optimum."""
    rows, room = at(address)
    worst = -1
    largest = 0.0
    for i in range(nB):
        row = room.lists[COUNTED, i]
        wrong = wrong_of_level(rows, row, size)
        if wrong > 0.0 and (worst < 0 or (row < worst if bland else wrong > largest)):
            largest, worst = wrong, row
    if residual > 0.0:
        floor = 1e-13 * max(residual, EPS * size)
        for i in range(nW):
            row = room.lists[ENTERED, i]
            wrong = wrong_of_kept(rows, room, i, floor)
            if wrong > 0.0 and (worst < 0 or (row < worst if bland else wrong > largest)):
                largest, worst = wrong, row
    return worst


@lean
def pivot_block(address, end, r0, nW, nB, most, residual, size, span, depends):
    """Every row whose multiplier is wrong leaves, every row that the step's end violates enters.

    Returns (rows of W, rows that left, rows that entered or wanted to).
    """
    rows, room = at(address)
    left = NONE
    for i in range(nB):
        row = room.lists[COUNTED, i]
        if wrong_of_level(rows, row, size) > 0.0:
            leave(rows, row)
            left += 1
    entered = room.lists[ENTERED]
    count = nW
    if residual > 0.0:
        floor = 1e-13 * max(residual, EPS * size)
        for i in range(nW):
            if wrong_of_kept(rows, room, i, floor) > 0.0:
                release(rows, entered[i])
                left += 1
        if left:
            count = compress(entered, nW, rows)
    count, crossed = enter_crossed(address, end, r0, count, most, size, span, depends)
    return count, left, crossed


@lean
def enter_crossed(address, end, r0, nW, most, size, span, depends):
    """Every row that the step's end violates enters. Returns (rows of W, rows that entered or wanted to)."""
    rows, room = at(address)
    crossed = NONE
    for i in range(end):
        own = i >= r0
        if rows.flags[WORKING, i] or not (own or rows.flags[STATE, i] == KEPT) or not beyond(rows, i, size):
            continue
        if not own and abs(rows.real[CHANGE, i]) <= 2.0 * depends * rows.real[NORM, i] * span:
            continue  # it depends on W, as its factorization sees it
        crossed += 1
        if own or nW < most:
            activate(rows, i, 1 if rows.real[VALUE, i] > rows.real[UP, i] else -1)
            if not own:
                room.lists[ENTERED, nW] = i
                nW += 1
    return nW, crossed


@inlined
def guessable(rows, r0, r1):
    """Whether every row of the level is an equality."""
    for i in range(r0, r1):  # noqa: SIM110  numba compiles the loop, not the generator
        if rows.real[LOW, i] < rows.real[UP, i]:
            return False
    return True


@lean
def enter_guess(address, k, r0, r1, last, nW, c0):
    """W becomes the guessed one; returns its size."""
    rows, room = at(address)
    n = room.turns.shape[1]
    turn_rows(address, NONE, r0, k)
    if last:
        toward_goal(address, k, NEXT)
    guess_working_set(rows, r0, r1, c0, n - c0, room.vectors[NEXT])
    entered = room.lists[ENTERED]
    for i in range(nW):
        release(rows, entered[i])
    count = NONE
    for i in range(r0):
        if rows.flags[GUESS, i] != 0 and rows.flags[STATE, i] == KEPT and count < n - c0:
            activate(rows, i, rows.flags[GUESS, i])
            entered[count] = i
            count += 1
    return count
