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
from typing import NamedTuple

import numpy as np

from hqp_rp.core.kernels.cascade import finite
from hqp_rp.core.kernels.compile import inlined, kernel, lean
from hqp_rp.core.kernels.orthogonal import (
    EPS,
    level_least_squares,
    lq,
    padded,
    svd_level,
    triangle,
    turn_back_by,
    turn_back_reflectors,
    turn_forward,
    turn_forward_by,
    turn_vector,
)
from hqp_rp.core.kernels.predict import guess_working_set
from hqp_rp.core.kernels.rows import (
    BEFORE,
    CHANGE,
    CONFLICT,
    FIXED,
    GUESS,
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
    gather,
    gather_unit,
    level_norm,
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

ENTERED, COUNTED, REF_ROW, REF_COL, DONE_COL = range(5)
ORIGIN, TARGET, MULTIPLIER, REF_TAU, STEP, GRADIENT, DONE_TAU, MOVE = range(8)
FIRST, END, TURNED_AT, TURNED = range(4)


class Room(NamedTuple):
    """Arrays that a search writes anew, few for the reason given in `Rows`.

    matrix (., padded n): the kept rows W of the working set, then the rows B of the level that count; factored.
    done (M, padded n): reflectors of finished levels. marks (p + 1, 4): of each finished level, its reflectors `FIRST`:`END`
    and the column `TURNED_AT` at which its `TURNED` columns were turned by an SVD, by turns[k] (p + 1, n, n).
    lists (5, .): `ENTERED` is W; `COUNTED` is B, or in the end the rows that a level determined; `REF_ROW`, `REF_COL` of the
    reflectors in `matrix`; `DONE_COL` of those in `done`.
    real (8, .): `ORIGIN`, which listed row stands where after the factorization's swaps; `TARGET` of each row of B;
    `MULTIPLIER` of each row of W; `REF_TAU`, `DONE_TAU`; vectors `STEP`, `GRADIENT` and `MOVE` (n,), zero behind.
    """

    matrix: np.ndarray
    done: np.ndarray
    turns: np.ndarray
    marks: np.ndarray
    lists: np.ndarray
    real: np.ndarray


@kernel
def make_room(M, n, p, largest):
    """Room for p levels of up to `largest` rows, M in all."""
    N = padded(n)
    size = max(N + largest + 1, M)
    return Room(
        np.empty((N + largest + 1, N)),
        np.empty((M, N)),  # a level cut by the rank rule turns more often than it takes directions
        np.empty((p + 1, n, n)),  # pages that no SVD writes to are never touched
        np.zeros((p + 1, 4), np.int64),
        np.empty((5, size), np.int64),
        np.zeros((8, size)),
    )


@lean
def from_free(room, levels, step, move):
    """move (n,) <- Z step: a step in the freedom that `levels` finished levels left, as a step of x."""
    n = room.turns.shape[1]
    for j in range(n):
        move[j] = step[j]
    for k in range(levels - 1, -1, -1):
        if room.marks[k, TURNED]:
            turn_back_by(room.turns[k], room.marks[k, TURNED], move, room.marks[k, TURNED_AT])
        for t in range(room.marks[k, END] - 1, room.marks[k, FIRST] - 1, -1):
            turn_vector(move, room.done, t, room.lists[DONE_COL, t], room.real[DONE_TAU, t])


@lean
def to_free(room, levels, step):
    """step <- the coordinates of a step of x, those of the freedom that `levels` finished levels left standing last."""
    for k in range(levels):
        for t in range(room.marks[k, FIRST], room.marks[k, END]):
            turn_vector(step, room.done, t, room.lists[DONE_COL, t], room.real[DONE_TAU, t])
        r = room.marks[k, TURNED]
        if r:
            turn_forward_by(room.turns[k], r, step, room.marks[k, TURNED_AT])


@lean
def keep_turns(room, k, reflectors, turned, v0):
    """Remember what level k turned."""
    first = room.marks[k - 1, END] if k else 0
    room.marks[k, FIRST] = first
    room.marks[k, END] = first + reflectors
    room.marks[k, TURNED] = turned
    room.marks[k, TURNED_AT] = v0
    for t in range(reflectors):
        room.lists[DONE_COL, first + t] = room.lists[REF_COL, t]
        room.real[DONE_TAU, first + t] = room.real[REF_TAU, t]
        row = room.lists[REF_ROW, t]
        for j in range(room.done.shape[1]):
            room.done[first + t, j] = room.matrix[row, j]


@inlined
def length_of(x):
    """||x||."""
    s = 0.0
    for value in x:
        s += value * value
    return math.sqrt(s)


@lean
def start_from_values(rows, room, r0, r1, nW, size):
    """Working set of the point where the search stands: rows of the level that it violates, of W those at their bounds."""
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
def enter_level(rows, room, r0, r1, nW, most):
    """Working set to start a level with: what is violated or guessed of its rows, and the kept rows that are guessed."""
    for i in range(r0, r1):
        low, up, value, guess = rows.real[LOW, i], rows.real[UP, i], rows.real[VALUE, i], rows.flags[GUESS, i]
        if low == up or value > up or (guess > 0 and up < np.inf):
            activate(rows, i, 1)
        elif value < low or (guess < 0 and low > -np.inf):
            activate(rows, i, -1)
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
def multipliers(rows, room, top, nW, nB, c0, last, size):
    """Fill `MULTIPLIER` of W from L^T multiplier = -gradient; returns the largest miss of B, or in the last level ||gradient||.

    A row of the level has its own miss as multiplier.
    """
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
        residual = length_of(gradient[:nW])
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


@lean
def leave(rows, row):
    """Release a row, or turn it to its other bound when a step carried it across a narrow band."""
    if rows.flags[STATE, row] != KEPT and rows.real[VALUE, row] < rows.real[LOW, row]:
        rows.side[row] = -1
    elif rows.flags[STATE, row] != KEPT and rows.real[VALUE, row] > rows.real[UP, row]:
        rows.side[row] = 1
    else:
        release(rows, row)


@lean
def row_to_leave(rows, room, nW, nB, residual, size, bland):
    """The row whose multiplier is most wrong, by Bland's rule the first such row; -1 at the optimum."""
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
def pivot_block(rows, room, end, r0, nW, nB, most, residual, size, span, depends):
    """Every row whose multiplier is wrong leaves, every row that the step's end violates enters.

    Returns (rows of W, rows that left, rows that entered or wanted to).
    """
    left = 0
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
    crossed = 0
    for i in range(end):
        own = i >= r0
        if rows.flags[WORKING, i] or not (own or rows.flags[STATE, i] == KEPT):
            continue
        value = rows.real[VALUE, i]
        above = value - rows.real[UP, i]
        below = rows.real[LOW, i] - value
        over = max(above, below)
        if over <= 0.0:
            continue
        bound = rows.real[UP, i] if above > 0.0 else rows.real[LOW, i]
        norm = rows.real[NORM, i]
        if over <= 64.0 * EPS * (norm * size + abs(bound)):
            continue
        if not own and abs(rows.real[CHANGE, i]) <= 2.0 * depends * norm * span:
            continue  # it depends on W, as its factorization sees it
        if own:
            crossed += 1
            activate(rows, i, 1 if above > 0.0 else -1)
        else:
            crossed += 1
            if count < most:
                activate(rows, i, 1 if above > 0.0 else -1)
                entered[count] = i
                count += 1
    return count, left, crossed


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


@inlined
def guessable(rows, r0, r1):
    """Whether every row of the level is an equality."""
    for i in range(r0, r1):  # noqa: SIM110  numba compiles the loop, not the generator
        if rows.real[LOW, i] < rows.real[UP, i]:
            return False
    return True


@lean
def enter_guess(rows, room, k, z, r0, r1, last, nW, c0):
    """W becomes the guessed one; returns its size."""
    n = room.turns.shape[1]
    goal = room.real[MOVE]
    if last:
        for j in range(n):
            goal[j] = z[j] - rows.x[j]
        to_free(room, k, goal)
    guess_working_set(rows, r0, r1, c0, goal)
    entered = room.lists[ENTERED]
    for i in range(nW):
        release(rows, entered[i])
    count = 0
    for i in range(r0):
        if rows.flags[GUESS, i] != 0 and rows.flags[STATE, i] == KEPT and count < n - c0:
            activate(rows, i, rows.flags[GUESS, i])
            entered[count] = i
            count += 1
    return count


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
