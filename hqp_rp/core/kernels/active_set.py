"""Lexicographic least squares with two-sided rows at any level: an active set searched level by level.

Level k minimizes the squared violation of its rows over the points that keep what earlier levels reached. Its working set
holds kept rows at their bounds (W, equalities of a step) and its own rows that count (B: equalities and violated rows, the
least squares of a step). Each step factors [W; B] afresh by orthogonal transformations, moves until a row blocks, and ends
when every multiplier has its sign. Rows that are then determined (equalities, violated rows, rows held by a multiplier)
leave for good together with the directions they determine; satisfied rows are kept as rows.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hqp_rp.core.kernels.cascade import finite, solve_level
from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import EPS, factor, lq, turn_back, turn_forward
from hqp_rp.core.kernels.rows import (
    FIXED,
    KEPT,
    activate,
    bound_of,
    compress,
    first_to_block,
    gather,
    gather_unit,
    load_rows,
    miss,
    move,
    release,
    turn_rows,
)

SOLVED = 0
LIMIT = 1
INFEASIBLE = 2
NOT_FINITE = 3
DELICATE = 4  # solved, but a level was kept by a pivot so small that multipliers near rounding error decided


class Room(NamedTuple):
    """Arrays that every step of a search writes anew: lists of rows, the matrix to be factored, its reflectors.

    W: kept rows in the working set. B: rows of the level that count. F: rows that a finished level determined. others: the
    rest. matrix: flat. origin: which listed row stands where after the factorization's swaps. target, multiplier: one for
    each row. ref_row, ref_col, ref_tau: the reflectors. step, gradient: (n,).
    """

    W: np.ndarray
    B: np.ndarray
    F: np.ndarray
    others: np.ndarray
    matrix: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    multiplier: np.ndarray
    ref_row: np.ndarray
    ref_col: np.ndarray
    ref_tau: np.ndarray
    step: np.ndarray
    gradient: np.ndarray


@kernel
def make_room(M, n):
    """Room for a search over M rows and n unknowns."""
    return Room(
        np.empty(n + 1, np.int64),
        np.empty(M, np.int64),
        np.empty(M, np.int64),
        np.empty(M + n, np.int64),
        np.empty((M + n) * n),
        np.empty(M + n),
        np.empty(M + n),
        np.empty(M + n),
        np.empty(M + n, np.int64),
        np.empty(M + n, np.int64),
        np.empty(M + n),
        np.empty(n),
        np.empty(n),
    )


@kernel
def enter_level(rows, room, guess, r0, r1, nW, most):
    """Working set to start a level with: what is violated or guessed of its rows, and the kept rows that are guessed.

    Returns (size of W, whether a kept row was guessed that need not be at its bound).
    """
    for i in range(r0, r1):
        if rows.low[i] == rows.up[i] or rows.value[i] > rows.up[i] or (guess[i] > 0 and rows.up[i] < np.inf):
            activate(rows, i, 1)
        elif rows.value[i] < rows.low[i] or (guess[i] < 0 and rows.low[i] > -np.inf):
            activate(rows, i, -1)
    hoped = False
    for i in range(r0):
        if rows.state[i] != KEPT or rows.working[i] or guess[i] == 0 or nW >= most:
            continue
        if abs(rows.up[i] if guess[i] > 0 else rows.low[i]) < np.inf:
            activate(rows, i, guess[i])
            room.W[nW] = i
            nW += 1
            hoped = True
    return nW, hoped


@kernel
def step_to_minimizer(rows, room, z, r0, r1, nW, nB, rW, c0, tol, work, step, gradient, size):
    """Complete the factorization of [W; B] and fill `step` (d,), which leads to the minimizer over the working set.

    W (the first nW rows of `work`) is factored already, rW = nW. With r0 = r1 = M, after the last level, what is minimized
    is ||x - z||. `gradient` (rW,) then is its gradient along W. Returns (reflectors, rank, V, what the step is after as a
    length, smallest pivot of the kept rank).
    """
    M = len(rows.value)
    last = r0 == M
    d = len(step)
    empty = np.empty((0, 0))
    sought = 0.0
    if last:
        for j in range(d):
            s = 0.0
            for i in range(len(rows.x)):
                s += rows.R[M + i, c0 + j] * (z[i] - rows.x[i])
            step[j] = s
            sought += abs(s)
        turn_forward(work, step, 0, rW, room.ref_row, room.ref_col, room.ref_tau)
        for j in range(rW):
            gradient[j] = -step[j]
    for i in range(rW):  # rows of W go (back) to their bounds
        row = room.W[int(room.origin[i])]
        s = -miss(rows, size, row) / rows.norms[row]
        for j in range(i):
            s -= work[i, j] * step[j]
        step[i] = s / work[i, i]
    r = 0
    rank = 0
    V = empty
    pivot = np.inf
    if not last:
        r, rank, V, U, S = factor(
            work, nW, nW + nB, rW, nW + nB, room.origin, rows.loaded, r0, r1, 1.0, tol, False, rW,
            room.ref_row, room.ref_col, room.ref_tau,
        )  # fmt: skip
        for i in range(rank):
            pivot = min(pivot, S[i] if len(S) else abs(work[nW + i, rW + i]))
        if rank < r:  # a direction was cut by the rank rule
            pivot = 0.0
        for i in range(nB):
            row = room.B[int(room.origin[nW + i]) - nW]
            s = bound_of(rows, row) - rows.value[row]
            sought = max(sought, abs(s))
            for j in range(rW):
                s -= work[nW + i, j] * step[j]
            room.target[i] = s
        solve_level(work, nW, nW + nB, rW, r, rank, U, S, room.target, 0.0, 1.0, 0, 0.0, 0.0, step)
        turn_back(work, step, rW, V, rW, rW + r, room.ref_row, room.ref_col, room.ref_tau)
    turn_back(work, step, 0, empty, 0, rW, room.ref_row, room.ref_col, room.ref_tau)
    return r, rank, V, sought, pivot


@kernel
def worse(wrong, row, worst_size, worst, bland):
    """Whether this row should leave rather than the worst so far: the larger multiplier, or by Bland's rule the first row."""
    return worst < 0 or (row < worst if bland else wrong > worst_size)


@kernel
def row_to_leave(rows, room, nW, nB, rW, work, gradient, last, size, bland):
    """(row, residual): the row whose multiplier is most wrong at the minimizer over the working set, or -1 at the optimum.

    A row of the level has its own miss as multiplier; those of W follow from L^T multiplier = -gradient.
    """
    worst = -1
    worst_size = 0.0
    residual = 0.0
    for i in range(nB):
        row = room.B[i]
        w = miss(rows, size, row)
        residual = max(residual, abs(w))
        wrong = -w * rows.side[row] if rows.low[row] < rows.up[row] else 0.0
        if wrong > 0.0 and worse(wrong, row, worst_size, worst, bland):
            worst_size, worst = wrong, row
    for i in range(nW):
        room.multiplier[i] = 0.0
    if last and rW > 0:
        residual = math.sqrt(np.sum(gradient * gradient))
    if rW == 0 or residual == 0.0:
        return worst, residual
    if not last:
        for i in range(nB):
            w = miss(rows, size, room.B[int(room.origin[nW + i]) - nW])
            for j in range(rW):
                gradient[j] += w * work[nW + i, j]
    for i in range(rW - 1, -1, -1):
        s = -gradient[i]
        for j in range(i + 1, rW):
            s -= work[j, i] * room.multiplier[int(room.origin[j])]
        room.multiplier[int(room.origin[i])] = s / work[i, i]
    for i in range(nW):
        row = room.W[i]
        wrong = -room.multiplier[i] * rows.side[row]
        if wrong > 1e-13 * max(residual, EPS * size) and worse(wrong, row, worst_size, worst, bland):
            worst_size, worst = wrong, row
    return worst, residual


@kernel
def leave(rows, worst):
    """Release a row, or turn it to its other bound when a step carried it across a narrow band."""
    if rows.state[worst] != KEPT and rows.value[worst] < rows.low[worst]:
        rows.side[worst] = -1
    elif rows.state[worst] != KEPT and rows.value[worst] > rows.up[worst]:
        rows.side[worst] = 1
    else:
        release(rows, worst)


@kernel
def settle(rows, room, r0, r1, nW, hard_rows, residual, size, conflict):
    """Sort the rows of a finished level into those it determined (F, rows of W held by a multiplier first) and kept ones.

    Returns (size of W, rows of W in F, size of F, contradicting hard rows).
    """
    nF = 0
    still = 0
    for i in range(nW):
        if residual > 0.0 and room.multiplier[i] * rows.side[room.W[i]] > 1e-13 * residual:
            room.F[nF] = room.W[i]
            nF += 1
        else:
            room.W[still] = room.W[i]
            still += 1
    nW = still
    held = nF
    contradicting = 0
    for i in range(r0, r1):
        w = miss(rows, size, i) if rows.working[i] else 0.0
        if rows.working[i] and (rows.low[i] == rows.up[i] or w != 0.0):
            room.F[nF] = i
            nF += 1
        else:
            rows.state[i] = KEPT
            rows.low[i] = min(rows.low[i], rows.value[i])
            rows.up[i] = max(rows.up[i], rows.value[i])
            if rows.working[i] and nW < len(rows.x):
                room.W[nW] = i
                nW += 1
            elif rows.working[i]:
                release(rows, i)
        if i < hard_rows and w != 0.0:
            conflict[i] = 1
            if abs(w) > 1e-9 * (rows.norms[i] * (size + 1.0) + abs(bound_of(rows, i))):
                contradicting += 1
    for i in range(nF):
        rows.state[room.F[i]] = FIXED
    return nW, held, nF, contradicting


@kernel
def hierarchical_active_set(A, lower, upper, offsets, hard_rows, z, tol, limit, go_on, x, side, conflict):
    """Solve; returns (code, iterations). Level 0 is the hard rows (rows 0 ... hard_rows - 1; may be empty).

    x (n,): where to start, then the answer. side (M,): the bound at which a row is thought to be active (-1, 0, +1), then
    the bounds at which rows are active. conflict (M,): 1 for each hard row of a contradiction when INFEASIBLE; the answer is
    then the point of least violation, and the levels are optimized over such points only with `go_on`. DELICATE: solved near
    a singularity, where the answer should be verified.
    """
    M, n = A.shape
    p = len(offsets) - 1
    guess = side.copy()
    rows, all_finite = load_rows(A, lower, upper, offsets, side, x)
    if not all_finite:
        return NOT_FINITE, 0
    room = make_room(M, n)
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
            continue
        nW, hoped = enter_level(rows, room, guess, r0, r1, nW, n - c0)
        d = n - c0
        idle = 0
        bland = False
        while True:
            iterations += 1
            if iterations > limit:
                return LIMIT, iterations
            nB = 0
            for i in range(r0, r1):
                if rows.working[i]:
                    room.B[nB] = i
                    nB += 1
            work = room.matrix[: (nW + nB) * d].reshape((nW + nB, d))
            gather_unit(rows, room.W, nW, c0, work)
            gather(rows, room.B, nB, c0, work, nW)
            for i in range(nW + nB):
                room.origin[i] = i
            rW = lq(work, 0, nW, 0, nW + nB, room.origin, depends, 0, room.ref_row, room.ref_col, room.ref_tau)
            if rW < nW:  # a row that depends on others of W holds nothing that they do not hold
                for i in range(rW, nW):
                    release(rows, room.W[int(room.origin[i])])
                nW = compress(room.W, nW, rows)
                continue
            step = room.step[:d]
            step[:] = 0.0
            gradient = room.gradient[:rW]
            gradient[:] = 0.0
            size = math.sqrt(np.sum(x * x))
            r, rank, V, sought, pivot = step_to_minimizer(
                rows, room, z, r0, r1, nW, nB, rW, c0, tol, work, step, gradient, size
            )
            size += sought  # the rounding error of what the step is after counts like that of x
            span = math.sqrt(np.sum(step * step))
            length, blocking, which = 1.0, -1, 0
            if span > 4.0 * EPS * size:  # else the step is rounding error
                slack = 1e-12 * size if bland else 0.0
                length, blocking, which = first_to_block(rows, k, c0, step, span, slack, depends)
                if not move(rows, c0, step, length):
                    return NOT_FINITE, iterations
            size = math.sqrt(np.sum(x * x)) + sought
            idle = idle + 1 if length * span <= 1e-13 * size else 0
            bland = idle > n
            if blocking >= 0:
                if hoped:  # the guess is not reached: keep only what is at its bound
                    for i in range(nW):
                        if miss(rows, size, room.W[i]) != 0.0:
                            release(rows, room.W[i])
                    nW = compress(room.W, nW, rows)
                    hoped = False
                activate(rows, blocking, which)
                if rows.state[blocking] == KEPT:
                    room.W[nW] = blocking
                    nW += 1
                continue
            hoped = False
            worst, residual = row_to_leave(rows, room, nW, nB, rW, work, gradient, last, size, bland)
            if worst < 0:
                break
            leave(rows, worst)
            nW = compress(room.W, nW, rows)
        if last:
            break
        smallest = min(smallest, pivot)
        entered = nW
        nW, held, nF, more = settle(rows, room, r0, r1, nW, hard_rows, residual, size, conflict)
        contradicting += more
        if contradicting and not go_on:
            return INFEASIBLE, iterations
        if nF == 0:
            continue
        if held < entered or nF - held < nB:  # not the set of the last factorization
            work = room.matrix[: nF * d].reshape((nF, d))
            gather_unit(rows, room.F, held, c0, work)
            gather(rows, room.F[held:], nF - held, c0, work, held)
            rW = lq(work, 0, held, 0, nF, room.origin, depends, 0, room.ref_row, room.ref_col, room.ref_tau)
            r, rank, V, _, _ = factor(
                work, held, nF, rW, nF, room.origin, rows.loaded, r0, r1, 1.0, tol, False, rW,
                room.ref_row, room.ref_col, room.ref_tau,
            )  # fmt: skip
        count = 0
        for i in range(M + n):
            if i >= M or rows.state[i] != FIXED:
                room.others[count] = i
                count += 1
        turn_rows(rows, room.others, count, c0, work, V, rW, rW + r, room.ref_row, room.ref_col, room.ref_tau)
        c0 += rW + rank
    if not finite(x):
        return NOT_FINITE, iterations
    if contradicting:
        return INFEASIBLE, iterations
    return DELICATE if smallest < 1e-6 else SOLVED, iterations
