"""A QP's answer refined on its active rows: see `polish`."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.householder import padded
from hqp_rp.core.kernels.orthogonal import lower_block, lq, tall_least_squares, turn_back_reflectors, turn_forward
from hqp_rp.core.problem import FloatArray

ACTIVE = 1e-7  # Multipliers and violations of a scaled QP above this count as nonzero at first.
FEASIBLE = 1e-13  # Rounding of a scaled QP's rows, relative to their terms.
PASSES = 12


@kernel
def outside(value, lower, upper):
    """Signed violation of lower <= value <= upper."""
    return max(value - upper, 0.0) if value > upper else min(value - lower, 0.0)


@kernel
def objective(hessian, gradient, rows, lower, upper, soft, t):
    """1/2 ||(S w - c, violation of the soft rows)||^2 at t."""
    total = 0.0
    for j in range(len(t)):
        if hessian[j] > 0.0:
            root = math.sqrt(hessian[j])
            total += (root * t[j] + gradient[j] / root) ** 2
    for i in range(soft):
        value = 0.0
        for j in range(len(t)):
            value += rows[i, j] * t[j]
        total += outside(value, lower[i], upper[i]) ** 2
    return 0.5 * total


@kernel
def active_answer(M, target, G, bound, t, multipliers):
    """min ||M t - target|| subject to G t = bound as a least correction of t, and the multipliers of G's rows.

    Rows of G that depend on others get the multiplier 0. Rounding below 1e-10 (G, rows of length one) and 1e-12 counts as 0.
    """
    nt = len(t)
    a = len(G)
    m = len(M)
    work = np.zeros((a + m, padded(nt)))
    work[:a, :nt] = G
    work[a:, :nt] = M
    order = np.arange(a + m) * 1.0
    ref_row = np.empty(a + m, np.int64)
    ref_col = np.empty(a + m, np.int64)
    ref_tau = np.empty(a + m)
    rW = lq(work, 0, a, 0, a + m, order, 1e-10, 0, ref_row, ref_col, ref_tau)
    r = 0
    if m and rW < nt:
        longest = 1.0
        for i in range(a, a + m):
            longest = max(longest, math.sqrt(np.sum(work[i] ** 2)))
        r = lq(work, a, a + m, rW, a + m, order, 1e-12 * longest, rW, ref_row, ref_col, ref_tau)
    L = lower_block(work, a, a + m, rW, r)
    new = t.copy()
    for _ in range(2):  # The second pass refines what the factorization lost.
        step = np.zeros(work.shape[1])
        for i in range(rW):
            row = int(order[i])
            s = bound[row]
            for j in range(nt):
                s -= G[row, j] * new[j]
            for j in range(i):
                s -= work[i, j] * step[j]
            step[i] = s / work[i, i]
        if r:
            residual = np.empty(m)
            for i in range(m):
                row = int(order[a + i]) - a
                s = target[row]
                for j in range(nt):
                    s -= M[row, j] * new[j]
                for j in range(rW):
                    s -= work[a + i, j] * step[j]
                residual[i] = s
            tall_least_squares(L.copy(), residual)
            step[rW : rW + r] = residual[:r]
        turn_back_reflectors(work, step, 0, rW + r, ref_row, ref_col, ref_tau)
        new += step[:nt]
    multipliers[:] = 0.0
    if rW:
        gradient = np.zeros(work.shape[1])
        for i in range(m):
            s = -target[i]
            for j in range(nt):
                s += M[i, j] * new[j]
            for j in range(nt):
                gradient[j] += s * M[i, j]
        turn_forward(work, gradient, 0, rW, ref_row, ref_col, ref_tau)
        for i in range(rW - 1, -1, -1):
            s = -gradient[i]
            for j in range(i + 1, rW):
                s -= work[j, i] * multipliers[int(order[j])]
            multipliers[int(order[i])] = s / work[i, i]
    return new


@kernel
def polish_in_place(hessian, gradient, rows, lower, upper, soft, t, y):
    """(t, y) <- `polish`."""
    nt = len(t)
    m = len(y)
    length = np.empty(m)
    side = np.zeros(m, np.int64)
    curved = 0
    for j in range(nt):
        if hessian[j] > 0.0:
            curved += 1
    for i in range(m):
        value = 0.0
        s = 0.0
        for j in range(nt):
            value += rows[i, j] * t[j]
            s += rows[i, j] ** 2
        length[i] = math.sqrt(s)
        signal = outside(value, lower[i], upper[i]) if i < soft else y[i]
        if signal > ACTIVE and upper[i] < np.inf:
            side[i] = 1
        elif signal < -ACTIVE and lower[i] > -np.inf:
            side[i] = -1
    seen = np.empty((PASSES, m), np.int64)
    slack_y = np.zeros(m)
    for turn in range(PASSES):
        for old in range(turn):
            if np.all(seen[old] == side):
                return
        seen[turn] = side
        v = 0
        a = 0
        for i in range(m):
            if side[i] != 0:
                if i < soft:
                    v += 1
                else:
                    a += 1
        M = np.zeros((curved + v, nt))
        target = np.empty(curved + v)
        G = np.empty((a, nt))
        bound = np.empty(a)
        q = 0
        for j in range(nt):
            if hessian[j] > 0.0:
                root = math.sqrt(hessian[j])
                M[q, j] = root
                target[q] = -gradient[j] / root
                q += 1
        g = 0
        for i in range(m):
            if side[i] == 0:
                continue
            b = upper[i] if side[i] > 0 else lower[i]
            if i < soft:
                M[q] = rows[i]
                target[q] = b
                q += 1
            else:
                G[g] = rows[i]
                bound[g] = b
                g += 1
        multipliers = np.empty(a)
        new = active_answer(M, target, G, bound, t, multipliers)
        size = 0.0
        largest = 0.0
        for j in range(nt):
            size += new[j] * new[j]
            largest = max(largest, abs(new[j]))
        size = math.sqrt(size)
        missed = 0.0
        weakest = -1
        least = np.inf
        g = 0
        wrong_hard = -1
        most_wrong = 0.0
        missing_hard = False
        changed = False
        following = side.copy()
        for i in range(m):
            value = 0.0
            for j in range(nt):
                value += rows[i, j] * new[j]
            rounding = FEASIBLE * (1.0 + abs(value) + length[i] * size)
            slack_y[i] = 0.0
            if side[i] == 0:
                beyond = outside(value, lower[i], upper[i])
                if abs(beyond) > rounding:
                    following[i] = 1 if beyond > 0.0 else -1
                    changed = True
                    missing_hard = missing_hard or i >= soft
                continue
            b = upper[i] if side[i] > 0 else lower[i]
            if i < soft:
                slack_y[i] = value - b
                if slack_y[i] * side[i] < -rounding:
                    following[i] = 0
                    changed = True
                continue
            slack_y[i] = multipliers[g]
            g += 1
            missed = max(missed, abs(value - b))
            if abs(y[i]) < least:
                least = abs(y[i])
                weakest = i
            if slack_y[i] * side[i] < -rounding:
                changed = True
                if slack_y[i] * side[i] < most_wrong:
                    most_wrong = slack_y[i] * side[i]
                    wrong_hard = i
        if weakest >= 0 and missed > 1e-11 * (1.0 + largest):
            # More rows than can be met at once: the one that mattered least to the back end goes.
            side = side.copy()
            side[weakest] = 0
            continue
        if not changed:
            # On rows that are nearly dependent the factorization may run away: then the back end's answer is the better.
            before = objective(hessian, gradient, rows, lower, upper, soft, t)
            after = objective(hessian, gradient, rows, lower, upper, soft, new)
            if after <= before + 1e-7 * (1.0 + before):
                t[:] = new
                y[:] = slack_y
            return
        if wrong_hard >= 0 and not missing_hard:
            # One at a time: letting several hard rows go at once may lose one that is needed.
            following[wrong_hard] = 0
        side = following


def polish(
    hessian: FloatArray,
    gradient: FloatArray,
    rows: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    soft: int,
    t: FloatArray,
    y: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """The exact answer on the active rows that (t, y) points at, or (t, y) when those rows are not the right ones.

    With hard rows G at their bounds and soft rows M violated, solves `min ||S w - c||^2 + ||M t - bounds||^2` subject
    to `G t = bounds` by orthogonal factorization, as a least correction of t. Rows that turn out violated, or held by a
    multiplier of the wrong sign, change sides; after a bounded number of passes without agreement the answer stays as it was.

    Source: solution polishing, Stellato, Banjac, Goulart, Bemporad and Boyd 2020, with changes of the set.

    Args:
        hessian, gradient, rows, lower, upper, soft: of a `SlackQP`. t: (n,), y: (m,), what a back end answered.
    """
    t, y = t.copy(), y.copy()
    polish_in_place(hessian, gradient, rows, lower, upper, soft, t, y)
    return t, y
