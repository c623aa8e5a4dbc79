"""Lexicographic least squares with two-sided rows at any level: an active set searched level by level.

Every row is carried in the coordinates of the freedom that finished levels left: R (M + n, n), whose last n rows are the
basis Z itself, so that x moves by Z d and row i's value by R_i d. Level k minimizes the squared violation of its rows over
the points that keep what earlier levels reached. Its working set holds kept rows at their bounds (W, equalities of a
step) and its own rows that count (B: equalities and violated rows, the least squares of a step). Each step factors [W; B]
afresh by orthogonal transformations, moves until a row blocks, and ends when every multiplier has its sign. Rows that are
then determined (equalities, violated rows, rows held by a multiplier) leave for good together with the directions they
determine; satisfied rows are kept as rows.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.cascade import solve_level
from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import EPS, factor, lq, turn_back, turn_forward

WAITING = 0  # of a level that has not been reached
KEPT = 1  # must stay within its bounds
FIXED = 2  # determined: its value stays as it is

SOLVED = 0
LIMIT = 1
INFEASIBLE = 2
NOT_FINITE = 3


@kernel
def load_two_sided(A, lower, upper, offsets, R, low, up, norms):
    """Copy rows and bounds, each level scaled by a power of two to entries in [1/2, 1), identity below; False if not finite."""
    M, n = A.shape
    finite = True
    for k in range(len(offsets) - 1):
        big = 0.0
        for i in range(offsets[k], offsets[k + 1]):
            for j in range(n):
                a = abs(A[i, j])
                if not a < np.inf:
                    finite = False
                big = max(big, a)
        s = 1.0
        if big > 0.0 and finite:
            s = math.ldexp(1.0, max(-1000, min(1000, -math.frexp(big)[1])))
        for i in range(offsets[k], offsets[k + 1]):
            total = 0.0
            for j in range(n):
                R[i, j] = A[i, j] * s
                total += R[i, j] * R[i, j]
            norms[i] = np.sqrt(total)
            low[i] = lower[i] * s
            up[i] = upper[i] * s
            if np.isnan(low[i]) or np.isnan(up[i]) or low[i] == np.inf or up[i] == -np.inf:
                finite = False
    for i in range(M, M + n):
        for j in range(n):
            R[i, j] = 1.0 if i - M == j else 0.0
    return finite


@kernel
def gather(R, rows, count, c0, out, at):
    """Copy the free columns of the listed rows of R to out[at:]."""
    for i in range(count):
        for j in range(c0, R.shape[1]):
            out[at + i, j - c0] = R[rows[i], j]


@kernel
def gather_unit(R, norms, rows, count, c0, out):
    """Copy the free columns of the listed rows of R to `out`, each divided by the norm of its whole row."""
    for i in range(count):
        for j in range(c0, R.shape[1]):
            out[i, j - c0] = R[rows[i], j] / norms[rows[i]]


@kernel
def bound_of(side, low, up, i):
    """The bound at which row i is active: side -1 lower, +1 upper (an equality has both)."""
    return up[i] if side[i] > 0 else low[i]


@kernel
def miss(value, low, up, side, norms, size, i):
    """How far row i is from its active bound, signed; what rounding error can explain at an x of this size is 0."""
    bound = bound_of(side, low, up, i)
    w = value[i] - bound
    return w if abs(w) > 64.0 * EPS * (norms[i] * size + abs(bound)) else 0.0


@kernel
def move(R, value, x, M, c0, step, length):
    """x += length * Z step, and every row's value with it."""
    d = len(step)
    for i in range(M):
        s = 0.0
        for j in range(d):
            s += R[i, c0 + j] * step[j]
        value[i] += length * s
    for i in range(len(x)):
        s = 0.0
        for j in range(d):
            s += R[M + i, c0 + j] * step[j]
        x[i] += length * s


@kernel
def first_to_block(R, value, low, up, norms, state, working, k, level, c0, step, slack, tol):
    """(length, row, side): how far in [0, 1] the step goes, and what stops it, a kept row or a row that starts to count.

    Of rows nearer to their bounds than `slack` times their size the first stops it at once, whatever rounding says of
    their order: with slack > 0 as Bland's rule needs it.
    """
    best = 1.0
    row = -1
    which = 0
    step_norm = 0.0
    for j in range(len(step)):
        step_norm += step[j] * step[j]
    step_norm = np.sqrt(step_norm)
    for i in range(len(state)):
        watched = (state[i] == KEPT and not working[i]) or (state[i] == WAITING and level[i] == k and not working[i])
        if not watched:
            continue
        s = 0.0
        for j in range(len(step)):
            s += R[i, c0 + j] * step[j]
        if abs(s) <= 2.0 * tol * norms[i] * step_norm:  # depends on the working set, as its factorization sees it
            continue
        if s > 0.0 and up[i] < np.inf:
            room = up[i] - value[i]
            room = 0.0 if room <= slack * (norms[i] + 1e-3 * abs(up[i])) else room / s
            if room < best:
                best, row, which = room, i, 1
        elif s < 0.0 and low[i] > -np.inf:
            room = value[i] - low[i]
            room = 0.0 if room <= slack * (norms[i] + 1e-3 * abs(low[i])) else -room / s
            if room < best:
                best, row, which = room, i, -1
    return best, row, which


@kernel
def worse(wrong, row, worst_size, worst, bland):
    """Whether this row should leave rather than the worst so far: the larger multiplier, or by Bland's rule the first row."""
    return worst < 0 or (row < worst if bland else wrong > worst_size)


@kernel
def compress(W, nW, working):
    """Drop the rows of W that are no longer working; returns how many remain."""
    still = 0
    for i in range(nW):
        if working[W[i]]:
            W[still] = W[i]
            still += 1
    return still


@kernel
def apply_reflectors(R, rows, count, c0, work, V, v0, t0, t1, ref_row, ref_col, ref_tau):
    """Turn the listed rows of R by reflectors t0:t1 stored in `work`, then by V at column v0, as `factor` turned its own."""
    d = R.shape[1] - c0
    r = len(V)
    turned = np.empty(r)
    for i in range(count):
        row = rows[i]
        for t in range(t0, t1):
            c = ref_col[t]
            w = ref_row[t]
            dot = R[row, c0 + c]
            for j in range(c + 1, d):
                dot += R[row, c0 + j] * work[w, j]
            dot *= ref_tau[t]
            R[row, c0 + c] -= dot
            for j in range(c + 1, d):
                R[row, c0 + j] -= dot * work[w, j]
        for j in range(r):
            s = 0.0
            for col in range(r):
                s += R[row, c0 + v0 + col] * V[col, j]
            turned[j] = s
        for j in range(r):
            R[row, c0 + v0 + j] = turned[j]


@kernel
def hierarchical_active_set(A, lower, upper, offsets, hard_rows, z, tol, limit, go_on, x, side, conflict):
    """Solve; returns (code, iterations). Level 0 is the hard rows (rows 0 ... hard_rows - 1; may be empty).

    x (n,): where to start, then the answer. side (M,): the bound at which a row is thought to be active (-1, 0, +1), then
    the bounds at which rows are active. conflict (M,): 1 for each hard row of a contradiction when INFEASIBLE; the answer is
    then the point of least violation, and the levels are optimized over such points only with `go_on`.
    """
    M, n = A.shape
    p = len(offsets) - 1
    R = np.empty((M + n, n))
    low = np.empty(M)
    up = np.empty(M)
    norms = np.empty(M)
    if not load_two_sided(A, lower, upper, offsets, R, low, up, norms):
        return NOT_FINITE, 0
    loaded = R[:M].copy()
    level = np.empty(M, np.int64)
    for k in range(p):
        level[offsets[k] : offsets[k + 1]] = k
    state = np.zeros(M, np.int64)
    working = np.zeros(M, np.bool_)
    guess = side.copy()
    value = np.zeros(M)
    for i in range(M):
        s = 0.0
        for j in range(n):
            s += R[i, j] * x[j]
        value[i] = s
        side[i] = 0
    W = np.empty(n + 1, np.int64)  # kept rows in the working set
    nW = 0
    B = np.empty(M, np.int64)  # rows of the level that count
    F = np.empty(M, np.int64)  # rows that a finished level determined
    others = np.empty(M + n, np.int64)
    room = np.empty((n + M) * n)
    origin = np.empty(n + M)
    target = np.empty(n + M)
    ref_row = np.empty(n + M, np.int64)
    ref_col = np.empty(n + M, np.int64)
    ref_tau = np.empty(n + M)
    multiplier = np.zeros(n + 1)
    empty = np.empty((0, 0))
    iterations = 0
    infeasible = 0
    depends = max(tol, 1e-12)  # a kept row whose free part is smaller than this depends on the working set
    c0 = 0
    for k in range(p + 1):
        last = k == p
        r0 = offsets[k] if not last else M
        r1 = offsets[k + 1] if not last else M
        if c0 == n:
            break
        if r0 == r1 and not last:
            continue
        for i in range(r0, r1):
            if low[i] == up[i] or value[i] > up[i] or (guess[i] > 0 and up[i] < np.inf):
                side[i] = 1
                working[i] = True
            elif value[i] < low[i] or (guess[i] < 0 and low[i] > -np.inf):
                side[i] = -1
                working[i] = True
        hoped = False
        for i in range(r0):
            if state[i] == KEPT and guess[i] != 0 and not working[i] and nW < n - c0:
                side[i] = guess[i]
                if abs(bound_of(side, low, up, i)) == np.inf:
                    side[i] = 0
                    continue
                working[i] = True
                W[nW] = i
                nW += 1
                hoped = True
        idle = 0
        bland = False
        while True:
            iterations += 1
            if iterations > limit:
                return LIMIT, iterations
            d = n - c0
            nB = 0
            for i in range(r0, r1):
                if working[i]:
                    B[nB] = i
                    nB += 1
            work = room[: (nW + nB) * d].reshape((nW + nB, d))
            gather_unit(R, norms, W, nW, c0, work)
            gather(R, B, nB, c0, work, nW)
            for i in range(nW + nB):
                origin[i] = i
            rW = lq(work, 0, nW, 0, nW + nB, origin, depends, 0, ref_row, ref_col, ref_tau)
            if rW < nW:  # a row that depends on others of W holds nothing that they do not hold
                for i in range(rW, nW):
                    working[W[int(origin[i])]] = False
                    side[W[int(origin[i])]] = 0
                nW = compress(W, nW, working)
                continue
            step = np.zeros(d)
            size = math.sqrt(np.sum(x * x))
            missing = 0.0  # what the step is after, as a length: its rounding error counts like that of x
            gradient = np.zeros(rW)
            r = 0
            rank = 0
            V = empty
            if last:
                for j in range(d):
                    s = 0.0
                    for i in range(n):
                        s += R[M + i, c0 + j] * (z[i] - x[i])
                    step[j] = s
                    missing += abs(s)
                turn_forward(work, step, 0, rW, ref_row, ref_col, ref_tau)
                for j in range(rW):
                    gradient[j] = -step[j]
            for i in range(rW):  # rows of W go (back) to their bounds
                row = W[int(origin[i])]
                s = -miss(value, low, up, side, norms, size, row) / norms[row]
                for j in range(i):
                    s -= work[i, j] * step[j]
                step[i] = s / work[i, i]
            if not last:
                r, rank, V, U, S = factor(
                    work,
                    nW,
                    nW + nB,
                    rW,
                    nW + nB,
                    origin,
                    loaded,
                    r0,
                    r1,
                    1.0,
                    tol,
                    False,
                    rW,
                    ref_row,
                    ref_col,
                    ref_tau,
                )
                for i in range(nB):
                    row = B[int(origin[nW + i]) - nW]
                    s = bound_of(side, low, up, row) - value[row]
                    missing = max(missing, abs(s))
                    for j in range(rW):
                        s -= work[nW + i, j] * step[j]
                    target[i] = s
                solve_level(work, nW, nW + nB, rW, r, rank, U, S, target, 0.0, 1.0, 0, 0.0, 0.0, step)
                turn_back(work, step, rW, V, rW, rW + r, ref_row, ref_col, ref_tau)
            turn_back(work, step, 0, empty, 0, rW, ref_row, ref_col, ref_tau)
            span = math.sqrt(np.sum(step * step))
            length, blocking, which = 1.0, -1, 0
            size += missing
            if span > 4.0 * EPS * size:  # else the step is rounding error
                slack = 1e-12 * size if bland else 0.0
                length, blocking, which = first_to_block(
                    R, value, low, up, norms, state, working, k, level, c0, step, slack, depends
                )
                move(R, value, x, M, c0, step, length)
            for i in range(n):
                if not abs(x[i]) < np.inf:
                    return NOT_FINITE, iterations
            size = math.sqrt(np.sum(x * x)) + missing
            idle = idle + 1 if length * span <= 1e-13 * size else 0
            bland = idle > n
            if blocking >= 0:
                if hoped:  # the guess is not reached: keep only what is at its bound
                    for i in range(nW):
                        if miss(value, low, up, side, norms, size, W[i]) != 0.0:
                            working[W[i]] = False
                            side[W[i]] = 0
                    nW = compress(W, nW, working)
                    hoped = False
                side[blocking] = which
                working[blocking] = True
                if state[blocking] == KEPT:
                    W[nW] = blocking
                    nW += 1
                continue
            hoped = False
            # The minimizer over the working set: the row whose multiplier is most wrong leaves, or the level is done.
            worst = -1
            worst_size = 0.0
            residual_size = 0.0
            for i in range(nB):
                row = B[i]
                w = miss(value, low, up, side, norms, size, row)
                residual_size = max(residual_size, abs(w))
                wrong = -w * side[row] if low[row] < up[row] else 0.0
                if wrong > 0.0 and worse(wrong, row, worst_size, worst, bland):
                    worst_size, worst = wrong, row
            for i in range(nW):
                multiplier[i] = 0.0
            if last and rW > 0:
                residual_size = math.sqrt(np.sum(gradient * gradient))
            if rW > 0 and residual_size > 0.0:
                if not last:
                    for i in range(nB):
                        w = miss(value, low, up, side, norms, size, B[int(origin[nW + i]) - nW])
                        for j in range(rW):
                            gradient[j] += w * work[nW + i, j]
                for i in range(rW - 1, -1, -1):  # L^T multiplier = -gradient
                    s = -gradient[i]
                    for j in range(i + 1, rW):
                        s -= work[j, i] * multiplier[int(origin[j])]
                    multiplier[int(origin[i])] = s / work[i, i]
                for i in range(nW):
                    row = W[i]
                    wrong = -multiplier[i] * side[row]
                    if wrong > 1e-11 * max(residual_size, EPS * size) and worse(wrong, row, worst_size, worst, bland):
                        worst_size, worst = wrong, row
            if worst < 0:
                break
            if state[worst] != KEPT and value[worst] < low[worst]:
                side[worst] = -1  # a narrow band was crossed: violated on its other side
                continue
            if state[worst] != KEPT and value[worst] > up[worst]:
                side[worst] = 1
                continue
            working[worst] = False
            side[worst] = 0
            nW = compress(W, nW, working)
        if last:
            break
        # What the level determined is fixed for good; its satisfied rows are kept as rows.
        entered = nW
        nF = 0
        still = 0
        for i in range(nW):
            if residual_size > 0.0 and multiplier[i] * side[W[i]] > 1e-9 * residual_size:
                F[nF] = W[i]
                nF += 1
            else:
                W[still] = W[i]
                still += 1
        nW = still
        fixed_W = nF
        for i in range(r0, r1):
            w = miss(value, low, up, side, norms, size, i) if working[i] else 0.0
            if working[i] and (low[i] == up[i] or w != 0.0):
                F[nF] = i
                nF += 1
            else:
                state[i] = KEPT
                low[i] = min(low[i], value[i])
                up[i] = max(up[i], value[i])
                if working[i] and nW < n:
                    W[nW] = i
                    nW += 1
                elif working[i]:
                    working[i] = False
                    side[i] = 0
            if i < hard_rows and abs(w) > 1e-9 * (norms[i] * (size + 1.0) + abs(bound_of(side, low, up, i))):
                infeasible += 1
            if i < hard_rows and w != 0.0:
                conflict[i] = 1
        if infeasible and not go_on:
            return INFEASIBLE, iterations
        for i in range(nF):
            state[F[i]] = FIXED
        if nF == 0:
            continue
        if fixed_W < entered or nF - fixed_W < nB:  # not the set of the last factorization
            work = room[: nF * d].reshape((nF, d))
            gather_unit(R, norms, F, fixed_W, c0, work)
            gather(R, F[fixed_W:], nF - fixed_W, c0, work, fixed_W)
            rW = lq(work, 0, fixed_W, 0, nF, origin, depends, 0, ref_row, ref_col, ref_tau)
            r, rank, V, _, _ = factor(
                work, fixed_W, nF, rW, nF, origin, loaded, r0, r1, 1.0, tol, False, rW, ref_row, ref_col, ref_tau
            )
        count = 0
        for i in range(M + n):
            if i >= M or state[i] != FIXED:
                others[count] = i
                count += 1
        apply_reflectors(R, others, count, c0, work, V, rW, 0, rW + r, ref_row, ref_col, ref_tau)
        c0 += rW + rank
    for i in range(n):
        if not abs(x[i]) < np.inf:
            return NOT_FINITE, iterations
    return INFEASIBLE if infeasible else SOLVED, iterations
