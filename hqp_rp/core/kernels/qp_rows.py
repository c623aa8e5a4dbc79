"""The small QP of one stage of a cascade, in the free directions (`hqp_rp.core.qp_descent` has the formula)."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import lean
from hqp_rp.core.kernels.orthogonal import EPS
from hqp_rp.core.kernels.qp_desk import (
    DENSE,
    INFINITE,
    KEPT,
    QP_ROWS,
    RANK,
    RANK_TOLERANCE,
    SIZE,
    SOFT,
    STAGE,
    TAKEN,
    M,
    N,
    P,
    T,
    desk_of,
    qp_parts,
)
from hqp_rp.core.kernels.qp_factor import factor_equalities, keep_felt, length_of, over_triangle, power_of_two, times_Q
from hqp_rp.core.kernels.qp_slacks import fill_slacks
from hqp_rp.core.kernels.room import as_matrix
from hqp_rp.core.kernels.vector import add_multiple, dot_row, sum_of_squares

FLAT = 1e-3  # Singular values are preconditioned away down to this fraction of the largest one.


@lean
def sort_rows(desk, r0, r1, last):
    """Fill E and S with the stage's equalities and two-sided rows; (how many of each, whether x meets them all)."""
    mE = 0
    mS = 0
    for i in range(r0, r1):
        if desk.low[i] == desk.up[i]:
            desk.E[mE] = i
            mE += 1
        elif desk.low[i] > -np.inf or desk.up[i] < np.inf:
            desk.S[mS] = i
            mS += 1
    met = mE == 0 and not last
    for i in range(mS):
        if met:
            value = dot_row(desk.A, desk.S[i], desk.x, 0)
            met = desk.low[desk.S[i]] <= value <= desk.up[desk.S[i]]
    return mE, mS, met


@lean
def stage_qp(numbers, counts):
    """Put the QP of the stage on the desk, with SIZE, T, RANK, SOFT and QP_ROWS; SIZE 0: nothing is left to do.

    Returns whether there is a guess.
    """
    desk = desk_of(numbers, counts)
    n = counts[N]
    k = counts[STAGE]
    last = k == counts[P] + 1
    r0 = desk.offsets[k] if not last else counts[M]
    r1 = desk.offsets[k + 1] if not last else counts[M]
    K = counts[KEPT]
    c0 = counts[TAKEN]
    mE, mS, met = sort_rows(desk, r0, r1, last)
    count = mS + K
    numbers[SIZE] = 0.0
    counts[SOFT] = mS
    counts[QP_ROWS] = count
    counts[T] = 0
    counts[RANK] = 0
    for i in range(mS):
        times_Q(desk.A[desk.S[i]], desk, desk.turned[n + K + i])
    if met:
        return False
    noise = 0.0
    rank = 0
    if last:  # A Q is orthonormal as it is
        rank = n - c0
        for j in range(len(desk.z)):
            desk.z[j] = 0.0
        for i in range(n):
            add_multiple(desk.z, desk.turned, i, desk.start[i] - desk.x[i])
        for j in range(rank):
            desk.c[j] = desk.z[c0 + j]
            desk.sharp[j] = 1.0
        noise = 8.0 * EPS * (length_of(desk.start) + length_of(desk.x))
    elif mE > 0:
        rank = factor_equalities(desk, mE, n + count, c0, r0, r1, numbers[RANK_TOLERANCE], FLAT if count > 0 else 0.0)
        b = 0.0
        square = 0.0
        for i in range(mE):
            b += desk.low[desk.E[i]] ** 2
            square += sum_of_squares(desk.A, desk.E[i], 0)
        noise = 8.0 * EPS * (math.sqrt(b) + math.sqrt(square) * length_of(desk.x))
    t = rank + keep_felt(desk, count, mS, K, c0 + rank)
    counts[RANK] = rank
    if t == 0:
        return False
    counts[T] = t
    q = desk.qp
    a, b, c, e, f, g, H, gs, C, lo, hi, s, end = qp_parts(t, count, mS)
    rows = as_matrix(q[b:c], count, t)
    largest = 0.0
    total = 0.0
    for j in range(rank):
        total += desk.c[j] * desk.c[j]
    if math.sqrt(total) > noise:
        for j in range(rank):
            largest = max(largest, abs(desk.c[j]))
    for i in range(count):
        row = n + K + i if i < mS else n + i - mS
        for j in range(t):
            rows[i, j] = desk.turned[row, c0 + j]
        if not last:
            over_triangle(rows, i, desk.B, rank)
        if i < mS:
            own = desk.S[i]
            value = dot_row(desk.A, own, desk.x, 0)
            within = math.sqrt(sum_of_squares(desk.turned, row, c0))
            # Earlier levels have used the row up: nothing here may follow it.
            if within <= numbers[RANK_TOLERANCE] * math.sqrt(sum_of_squares(desk.A, own, 0)):
                for j in range(t):
                    rows[i, j] = 0.0
            q[c + i] = desk.low[own] - value
            q[e + i] = desk.up[own] - value
            desk.lengths[i] = 1.0
            largest = max(largest, q[c + i], -q[e + i])
        else:
            value = dot_row(desk.kept, i - mS, desk.x, 0)
            length = 0.0
            for j in range(t):
                length += rows[i, j] * rows[i, j]
            length = math.sqrt(length)
            desk.lengths[i] = length
            if length > 0.0:
                for j in range(t):
                    rows[i, j] /= length
            else:
                length = 1.0
            # The start is feasible by construction: a bound passed by rounding moves to where the point is.
            q[c + i] = min(desk.kept_lower[i - mS] - value, 0.0) / length
            q[e + i] = max(desk.kept_upper[i - mS] - value, 0.0) / length
    size = power_of_two(largest)
    numbers[SIZE] = size
    if not size > 0.0:
        return False
    for j in range(t):
        curved = desk.sharp[j] if j < rank else 0.0
        q[j] = curved * curved
        q[a + j] = -curved * desk.c[j] / size if j < rank else 0.0
    for i in range(count):
        q[c + i] /= size
        q[e + i] /= size
    guessed = desk.known[k] == 1 and guess(desk, k, K, mS, c0, t, rank, last, size, q[f:g], q[g:H])
    if not guessed:
        for j in range(f, H):
            q[j] = 0.0
    if counts[DENSE] and count > 0:
        full = t + mS
        fill_slacks(
            q[:a], q[a:b], rows, q[c:e], q[e:f], mS, numbers[INFINITE], q[f:g], q[g:H],
            as_matrix(q[H:gs], full, full), q[gs:C], as_matrix(q[C:lo], count, full), q[lo:hi], q[hi:s], q[s:end],
        )  # fmt: skip
    return guessed


@lean
def guess(desk, k, K, mS, c0, t, rank, last, size, guess_t, guess_y):
    """What an earlier answer of stage k says of this QP's answer; False when that is not finite."""
    total = 0.0
    for j in range(len(desk.z)):
        desk.z[j] = 0.0
    for i in range(len(desk.guess_x[k])):
        add_multiple(desk.z, desk.turned, i, (desk.guess_x[k, i] - desk.x[i]) / size)
    for j in range(t):
        s = desk.z[c0 + j]
        if j < rank and not last:
            s = 0.0
            for i in range(j + 1):
                s += desk.B[j, i] * desk.z[c0 + i]
        guess_t[j] = s
        total += s
    for i in range(mS + K):
        y = desk.guess_y[k, desk.S[i]] if i < mS else desk.guess_y[k, desk.kept_ids[i - mS]] * desk.lengths[i]
        guess_y[i] = y / size
        total += guess_y[i]
    return math.isfinite(total)
