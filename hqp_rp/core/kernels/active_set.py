"""Lexicographic least squares with two-sided rows at any level: an active set searched level by level.

Level k minimizes the squared violation of its rows over the points that keep what earlier levels reached. Its working set
holds kept rows at their bounds (W, equalities of a step) and its own rows that count (B: equalities and violated rows, the
least squares of a step). Each step factors W and B afresh by orthogonal transformations. Rows that are then determined
(equalities, violated rows, rows held by a multiplier) leave for good together with the directions they determine; satisfied
rows are kept as rows.

The search of a level starts with a step to where all of B and W are at their bounds, as far as they are independent: no
multiplier then has to be known, and what the level determines is B alone, factored before W. Rows that this step would
violate enter W. Where B cannot be met so, block pivots follow: every row that the whole step would violate enters, every row
whose multiplier has the wrong sign leaves, nothing moves until the working set allows it. That mostly ends after a few
factorizations, and where it ends it has found the optimum. Where it does not, the primal search takes over from the last
point that kept every bound: it moves until a row blocks, one row at a time, and cannot cycle.
"""

from __future__ import annotations

import numpy as np
from numba.core import types

from hqp_rp.core.kernels.active_set_codes import DELICATE, INFEASIBLE, LIMIT, NOT_FINITE, SOLVED
from hqp_rp.core.kernels.active_set_level import length_of, meet_level, search_level
from hqp_rp.core.kernels.active_set_pivot import (
    enter_guessed,
    enter_level,
)
from hqp_rp.core.kernels.active_set_room import (
    COUNTED,
    ENTERED,
    GOAL,
    MULTIPLIER,
    POINT,
    at,
    keep_turns,
    lay_out,
    turn_rows,
    words,
)
from hqp_rp.core.kernels.active_set_step import (
    factor_determined,
)
from hqp_rp.core.kernels.cascade import finite
from hqp_rp.core.kernels.compile import inlined, kernel, lean
from hqp_rp.core.kernels.room import STACK_NUMBERS, on_the_stack
from hqp_rp.core.kernels.rows import (
    CONFLICT,
    FIXED,
    KEPT,
    LOW,
    NONE,
    NORM,
    STATE,
    UP,
    VALUE,
    WORKING,
    bound_of,
    load_rows,
    miss,
    release,
    set_values,
)

__all__ = ["DELICATE", "INFEASIBLE", "LIMIT", "NOT_FINITE", "SOLVED"]  # beside the kernel, what it returns

SMALL = min(2048, STACK_NUMBERS)
"""Up to so many words a search works on the stack: enough for 30 rows in 7 unknowns."""

small_block = on_the_stack(SMALL, types.int64)


@lean
def settle(address, r0, r1, nW, hard_rows, residual, size):
    """Sort the rows of a finished level into those it determined (rows of W held by a multiplier first) and kept ones.

    The former are listed in `COUNTED`. Returns (size of W, rows of W determined, rows determined, contradicting hard rows).
    """
    rows, room = at(address)
    entered = room.lists[ENTERED]
    determined = room.lists[COUNTED]
    count = 0
    if residual > 0.0:
        still_in = 0
        for i in range(nW):
            row = entered[i]
            if room.real[MULTIPLIER, i] * rows.side[row] > 1e-13 * residual:
                rows.flags[STATE, row] = FIXED
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
        equality = rows.real[LOW, i] == rows.real[UP, i]
        w = miss(rows, size, i) if working and (i < hard_rows or not equality) else 0.0
        if working and (equality or w != 0.0):
            rows.flags[STATE, i] = FIXED
            determined[count] = i
            count += 1
        else:
            rows.flags[STATE, i] = KEPT
            rows.real[LOW, i] = min(rows.real[LOW, i], rows.real[VALUE, i])
            rows.real[UP, i] = max(rows.real[UP, i], rows.real[VALUE, i])
            if working and nW < room.turns.shape[1]:
                entered[nW] = i
                nW += 1
            elif working:
                release(rows, i)
        if w != 0.0 and i < hard_rows:
            rows.flags[CONFLICT, i] = 1
            if abs(w) > 1e-9 * (rows.real[NORM, i] * (size + 1.0) + abs(bound_of(rows, i))):
                contradicting += 1
    return nW, held, count, contradicting


@kernel
def hierarchical_active_set(A, lower, upper, offsets, hard_rows, z, tol, limit, go_on, x, side):
    """Solve; returns (code, iterations). Level 0 is the hard rows (rows 0 ... hard_rows - 1; may be empty).

    x (n,): where to start, then the answer. side (M,): the bound at which a row is thought to be active (-1, 0, +1), then
    the bounds at which rows are active; when INFEASIBLE, 1 for each hard row of the contradiction and 0 for others. The answer
    is then the point of least violation, and the levels are optimized over such points only with `go_on`. DELICATE: solved
    near a singularity, or near a contradiction of hard rows, where the answer should be verified.
    """
    M, n = A.shape
    p = len(offsets) - 1
    largest = NONE
    for k in range(p):
        largest = max(largest, offsets[k + 1] - offsets[k])
    needed = words(M, n, p, largest)
    block = small_block() if needed <= SMALL else np.empty(needed, np.int64)
    address = lay_out(block, side, M, n, p, largest)
    return search(block, address, A, lower, upper, offsets, hard_rows, z, tol, limit, go_on, x)


@inlined
def name_conflict(rows):
    """side <- 1 for each hard row of the contradiction, 0 for others."""
    for i in range(len(rows.side)):
        rows.side[i] = rows.flags[CONFLICT, i]


@inlined
def load_vectors(vectors, x, z):
    """Fill `POINT` and `GOAL`."""
    for j in range(vectors.shape[1]):
        vectors[POINT, j] = x[j] if j < len(x) else 0.0
        vectors[GOAL, j] = z[j] if j < len(x) else 0.0


@lean
def search(block, address, A, lower, upper, offsets, hard_rows, z, tol, limit, go_on, x):
    """`hierarchical_active_set` with the arrays that are laid out in the block."""
    rows, room = at(address)
    if not load_rows(rows, A, lower, upper, offsets):
        return NOT_FINITE, 0
    load_vectors(room.vectors, x, z)
    code, iterations = search_levels(address, offsets, hard_rows, tol, limit, go_on)
    for j in range(len(x)):
        x[j] = room.vectors[POINT, j]
    if code == INFEASIBLE:
        name_conflict(rows)
    elif code != LIMIT and not finite(x):
        return NOT_FINITE, iterations
    return code, iterations


@lean
def search_levels(address, offsets, hard_rows, tol, limit, go_on):
    """The levels one after the other; returns (code, iterations)."""
    rows, room = at(address)
    n = room.turns.shape[1]
    M = rows.R.shape[0]
    p = len(offsets) - 1
    depends = max(tol, 1e-12)  # a kept row whose free part is smaller than this depends on the working set
    iterations = contradicting = NONE
    smallest = np.inf
    size = length_of(room.vectors, POINT)
    nW = c0 = NONE
    for k in range(p + 1):
        last = k == p
        r0 = offsets[k] if not last else M
        r1 = offsets[k + 1] if not last else M
        if c0 == n:
            break
        set_values(rows, room.vectors, POINT, r0, r1)
        counts = enter_level(address, r0, r1, size)
        if not counts and not last:  # met where the search stands
            settle(address, r0, r1, nW, hard_rows, 0.0, size)
            keep_turns(address, k, NONE, NONE, c0)
            continue
        turn_rows(address, r0, r1, k)
        nW = enter_guessed(address, r0, nW, n - c0)
        started = nW
        factored = nB = r = rank = turned = NONE
        residual, pivot = 0.0, np.inf
        met = False
        if not last:
            met, tried, nW, nB, pivot, size, finite_point = meet_level(
                address, k, r0, r1, nW, c0, tol, depends, limit - iterations
            )
            iterations += tried
            if not finite_point:
                return NOT_FINITE, iterations
            r, rank = nB, nB
        if not met:
            code, tried, nW, factored, nB, r, rank, turned, residual, pivot, size = search_level(
                address, k, r0, r1, last, nW, c0, tol, depends, nW > started, limit - iterations
            )
            iterations += tried
            if code != SOLVED:
                return code, iterations
        if last:
            break
        smallest = min(smallest, pivot)
        nW, held, count, more = settle(address, r0, r1, nW, hard_rows, residual, size)
        contradicting += more
        if contradicting and not go_on:
            return INFEASIBLE, iterations
        if count == 0:
            factored = r = rank = turned = NONE
        elif held < factored or count - held < nB:  # not the set of the last factorization
            factored, r, rank, turned = factor_determined(address, k, r0, r1, held, count, c0, tol, depends)
        c0 += factored + rank
        if c0 < n:
            keep_turns(address, k, factored + r, turned, c0 - rank)
    if contradicting:
        return INFEASIBLE, iterations
    for i in range(hard_rows):
        if rows.flags[CONFLICT, i]:  # by so little that it is no proof
            smallest = 0.0
    return DELICATE if smallest < 1e-6 else SOLVED, iterations
