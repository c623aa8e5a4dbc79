"""A lexicographic descent by QPs: everything between two QPs is one call, on arrays that are kept between problems.

`begin` and `resume` go on until a back end has to solve a QP, and say which: (code, t, m, soft, guessed). The QP lies in
`Desk.qp`, cut by `qp_parts`. Stages: 0 the hard rows (maybe none), 1 ... p the levels, p + 1 the distance to the start.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import EPS
from hqp_rp.core.kernels.qp import finish_plain, plain_level, scaled_rows
from hqp_rp.core.kernels.qp_desk import (
    CODE,
    DENSE,
    FREE,
    FREE_AFTER,
    INFINITE,
    KEPT,
    POLISH,
    QP_ROWS,
    RANK_TOLERANCE,
    SIZE,
    SOFT,
    STAGE,
    TOLERANCE,
    M,
    N,
    P,
    T,
    desk_of,
    qp_parts,
)
from hqp_rp.core.kernels.qp_polish import polish
from hqp_rp.core.kernels.qp_rows import finish_with_rows, level_with_rows
from hqp_rp.core.kernels.qp_slacks import fill_slacks
from hqp_rp.core.kernels.verify import proven_optimal

PROVEN = 0  # done, x is proven optimal
UNPROVEN = 1  # done, x may or may not be optimal
NOT_FINITE = 2
PLAIN = 3  # asks for the QP without rows, 1/2 ||w||^2 + gradient . w
ROWS = 4  # asks for a QP with rows
VIOLATED = 5  # hard rows remain violated beyond the tolerance after their stage: `resume` goes on all the same


@kernel
def begin(hard, hard_lower, hard_upper, matrix, lower, upper, offsets, numbers, counts):
    """Take up a problem; `numbers` and `counts` hold its sizes, the settings and the start already."""
    desk = desk_of(numbers, counts)
    h, n = hard.shape
    desk.raw[:h] = hard
    desk.lower[:h] = hard_lower
    desk.upper[:h] = hard_upper
    desk.raw[h:] = matrix
    desk.lower[h:] = lower
    desk.upper[h:] = upper
    desk.offsets[0] = 0
    for k in range(len(offsets)):
        desk.offsets[k + 1] = h + offsets[k]
    desk.side[:] = 0
    desk.x[:] = desk.start
    desk.least[:] = desk.start
    desk.Z[:] = 0.0
    for i in range(n):
        desk.Z[i * n + i] = 1.0
    counts[FREE] = n
    counts[KEPT] = 0
    counts[STAGE] = -1
    counts[CODE] = PROVEN
    return advance(numbers, counts)


@kernel
def resume(numbers, counts, t, y):
    """Go on with the answer to the QP that was asked for: t (T or more,), y (QP_ROWS,); t is empty when there is none."""
    code = counts[CODE]
    if code == PLAIN:
        finish_without_rows(numbers, counts, t)
    elif code == ROWS:
        answer(numbers, counts, t, y)
    if code != VIOLATED and left_violated(numbers, counts):
        counts[CODE] = VIOLATED
        return VIOLATED, 0, 0, 0, 0
    return advance(numbers, counts)


@kernel
def left_violated(numbers, counts):
    """After the stage of the hard rows: remember where they left x, and say whether one is violated beyond the tolerance."""
    desk = desk_of(numbers, counts)
    if counts[STAGE] != 0:
        return False
    n = counts[N]
    desk.least[:] = desk.x
    x_size = math.sqrt(np.sum(desk.x * desk.x))
    for i in range(desk.offsets[1]):
        value = 0.0
        s = 0.0
        for j in range(n):
            value += desk.raw[i, j] * desk.x[j]
            s += desk.raw[i, j] ** 2
        bound = min(max(value, desk.lower[i]), desk.upper[i])
        # Not "a > b": what is not a number counts as violated.
        if value != bound and not abs(value - bound) <= numbers[TOLERANCE] * (math.sqrt(s) * x_size + abs(bound)):
            return True
    return False


@kernel
def advance(numbers, counts):
    """The stages that need no QP, up to one that does or to the end."""
    desk = desk_of(numbers, counts)
    n = counts[N]
    last = counts[P] + 1
    while counts[STAGE] < last:
        counts[STAGE] += 1
        k = counts[STAGE]
        d = counts[FREE]
        if d == 0:
            break  # Nothing can move any more: what a level finds is what it gets.
        Z = desk.Z[: n * d].reshape((n, d))
        K = counts[KEPT]
        r0 = desk.offsets[k] if k < last else 0
        m = desk.offsets[k + 1] - r0 if k < last else n
        if m == 0:
            continue
        if k == last and K == 0:
            if nearest(numbers, counts, Z):
                return PLAIN, counts[T], 0, 0, 0
            continue
        equalities = k < last
        for i in range(r0, r0 + m if equalities else r0):
            equalities = equalities and desk.lower[i] == desk.upper[i]
        if K == 0 and equalities:
            c, size, B, ZQ = plain_level(
                desk.raw[r0 : r0 + m], desk.lower[r0 : r0 + m], k == 0, Z, desk.x, numbers[RANK_TOLERANCE]
            )
            r = len(c)
            numbers[SIZE] = size
            counts[T] = r
            desk.T[: r * r] = B.ravel()
            desk.Z0[: n * d] = ZQ.ravel()
            if size < 0.0:
                return NOT_FINITE, 0, 0, 0, 0
            if size > 0.0:
                desk.qp[r : 2 * r] = c
                counts[CODE] = PLAIN
                return PLAIN, r, 0, 0, 0
            finish_without_rows(numbers, counts, c[:0])
            continue
        guessed = with_rows(numbers, counts, Z, k, r0, m)
        if guessed < -1:
            return NOT_FINITE, 0, 0, 0, 0
        if guessed >= 0:
            counts[CODE] = ROWS
            return ROWS, counts[T], counts[QP_ROWS], counts[SOFT], guessed
    if not math.isfinite(np.sum(desk.x)):
        return NOT_FINITE, 0, 0, 0, 0
    proven = proven_optimal(
        desk.raw, desk.lower, desk.upper, desk.offsets, desk.x, desk.start, numbers[TOLERANCE], numbers[RANK_TOLERANCE]
    )
    return (PROVEN if proven else UNPROVEN), 0, 0, 0, 0


@kernel
def nearest(numbers, counts, Z):
    """Ask for the QP of ||x - start|| where no row is kept; False when x is there already."""
    desk = desk_of(numbers, counts)
    n, d = Z.shape
    c = np.dot(desk.x - desk.start, Z)
    length = np.sum(c * c)
    noise = 8.0 * EPS
    counts[T] = d
    numbers[SIZE] = 0.0
    if not length > noise * noise * (np.sum(desk.start * desk.start) + np.sum(desk.x * desk.x)):
        return False
    size = np.max(np.abs(c))
    numbers[SIZE] = size
    desk.qp[d : 2 * d] = c / size
    desk.Z0[: n * d] = desk.Z[: n * d]
    B = desk.T[: d * d].reshape((d, d))
    B[:] = 0.0
    for j in range(d):
        B[j, j] = 1.0
    counts[CODE] = PLAIN
    return True


@kernel
def finish_without_rows(numbers, counts, t):
    """Move x by the answer of a QP without rows, and take the directions that the stage has used."""
    desk = desk_of(numbers, counts)
    n = counts[N]
    d = counts[FREE]
    r = counts[T]
    w = t[:r] if len(t) >= r and math.isfinite(np.sum(t)) else t[:0]
    ZQ = desk.Z0[: n * d].reshape((n, d))
    Z = finish_plain(w, numbers[SIZE], desk.T[: r * r].reshape((r, r)), ZQ, desk.x)
    counts[FREE] = d - r
    desk.Z[: n * (d - r)] = Z.ravel()


@kernel
def with_rows(numbers, counts, Z, k, r0, m):
    """Put the QP of a stage with rows on the desk; 1 with a guess, 0 without, -1: none is needed, -2: bounds overflow."""
    desk = desk_of(numbers, counts)
    n = counts[N]
    M_ = counts[M]
    K = counts[KEPT]
    last = k == counts[P] + 1
    A = desk.eye
    low = desk.start
    up = desk.start
    if not last:
        A, low, up, fits = scaled_rows(desk.raw[r0 : r0 + m], desk.lower[r0 : r0 + m], desk.upper[r0 : r0 + m], k == 0)
        if not fits:
            return -2  # A bound that overflows in scaled units puts x beyond what floats hold.
        desk.A[: m * n] = A.ravel()
        desk.low[:m] = low
        desk.up[:m] = up
    first = M_ if last else r0
    ids = np.arange(first, first + m)
    guess_x = desk.guess_x[k] if desk.known[k] else desk.x[:0]
    size, T_, Z0, hessian, gradient, rows, lower, upper, lengths, S, guess_t, guess = level_with_rows(
        A, low, up, Z, desk.x, desk.kept[:K], desk.kept_lower[:K], desk.kept_upper[:K], last, numbers[RANK_TOLERANCE],
        guess_x, desk.guess_y[k], ids, desk.kept_ids[:K],
    )  # fmt: skip
    soft = len(S)
    t = T_.shape[1]
    count = len(lower)
    numbers[SIZE] = size
    counts[T] = t
    counts[QP_ROWS] = count
    counts[SOFT] = soft
    counts[FREE_AFTER] = Z0.shape[1]
    desk.T[: n * t] = T_.ravel()
    desk.Z0[: n * Z0.shape[1]] = Z0.ravel()
    desk.S[:soft] = S
    desk.lengths[:count] = lengths
    if not size > 0.0 or t == 0:
        answer(numbers, counts, np.empty(0), np.empty(0))
        return -1
    a, b, c, e, f, g, H, gs, C, lo, hi, s, end = qp_parts(t, count, soft)
    q = desk.qp
    q[:a] = hessian
    q[a:b] = gradient
    q[b:c] = rows.ravel()
    q[c:e] = lower
    q[e:f] = upper
    guessed = len(guess_t) > 0
    if guessed:
        q[f:g] = guess_t
        q[g:H] = guess
    else:
        q[f:H] = 0.0
    if counts[DENSE]:
        N_ = t + soft
        fill_slacks(
            hessian, gradient, rows, lower, upper, soft, numbers[INFINITE], q[f:g], q[g:H],
            q[H:gs].reshape((N_, N_)), q[gs:C], q[C:lo].reshape((count, N_)), q[lo:hi], q[hi:s], q[s:end],
        )  # fmt: skip
    return 1 if guessed else 0


@kernel
def answer(numbers, counts, t, y):
    """Polish and take the answer of a QP with rows; without one (t empty) x stays."""
    desk = desk_of(numbers, counts)
    n = counts[N]
    k = counts[STAGE]
    K = counts[KEPT]
    size = numbers[SIZE]
    nt = counts[T]
    count = counts[QP_ROWS]
    soft = counts[SOFT]
    last = k == counts[P] + 1
    step = np.zeros(nt)
    multipliers = np.zeros(count if size > 0.0 else 0)
    if len(t) >= nt and len(y) == count and nt > 0 and math.isfinite(np.sum(t) + np.sum(y)):
        step[:] = t[:nt]
        multipliers[:] = y
        if counts[POLISH]:
            a, b, c, e, f, _, _, _, _, _, _, _, _ = qp_parts(nt, count, soft)
            q = desk.qp
            step, multipliers = polish(
                q[:a], q[a:b], q[b:c].reshape((count, nt)), q[c:e], q[e:f], soft, step, multipliers
            )
    r0 = desk.offsets[k] if not last else counts[M]
    m = desk.offsets[k + 1] - r0 if not last else n
    A = desk.eye if last else desk.A[: m * n].reshape((m, n))
    low = desk.start if last else desk.low[:m]
    up = desk.start if last else desk.up[:m]
    ids = np.arange(r0, r0 + m)
    S = desk.S[:soft]
    kept_ids = desk.kept_ids[:K]
    d0 = counts[FREE_AFTER]
    if size > 0.0:
        desk.known[k] = 1
        desk.guess_y[k, :] = 0.0
        for i in range(soft):
            desk.guess_y[k, ids[S[i]]] = multipliers[i] * size
        for i in range(K):
            length = desk.lengths[soft + i]
            desk.guess_y[k, kept_ids[i]] = multipliers[soft + i] * size / (length if length > 0.0 else 1.0)
    Z, kept, kept_lower, kept_upper, kept_ids = finish_with_rows(
        A, low, up, ids, S, desk.T[: n * nt].reshape((n, nt)), desk.Z0[: n * d0].reshape((n, d0)), step, multipliers,
        size, desk.x, desk.kept[:K], desk.kept_lower[:K], desk.kept_upper[:K], kept_ids, numbers[RANK_TOLERANCE], desk.side,
    )  # fmt: skip
    if size > 0.0:
        desk.guess_x[k] = desk.x
    d = Z.shape[1]
    counts[FREE] = d
    desk.Z[: n * d] = Z.ravel()
    K = len(kept)
    counts[KEPT] = K
    desk.kept[:K] = kept
    desk.kept_lower[:K] = kept_lower
    desk.kept_upper[:K] = kept_upper
    desk.kept_ids[:K] = kept_ids
