"""Saturation in the null space (SNS) on N levels, with orthonormal null-space bases in the place of projectors.

Level k, in the freedom Z that earlier levels left, with the saturated unknowns S held at their bounds:

    x~   = x_{k-1} + Z Z_S^# (bound_S - x_{k-1,S})          move S to its bounds
    x(s) = x~ + Z V (J_k Z V)^# (s b_k - J_k x~) = b + s a    V a basis of the null space of Z_S

Where s = 1 leaves the box, the unknown that allows the least scale s is saturated next, until the level would lose rank;
then the largest scale that was found is taken.
"""

from __future__ import annotations

import numpy as np

from hqp_rp.core.kernels.cascade import finite
from hqp_rp.core.kernels.compile import kernel

SLACK = 1e-12  # of the size of an unknown: what rounding may add to it


@kernel
def split(B, zero):
    """(rank, U, S, Vt) of B (m, d) with the full Vt (d, d); singular values <= zero do not count."""
    U, S, Vt = np.linalg.svd(B, True)
    rank = 0
    while rank < len(S) and S[rank] > zero:
        rank += 1
    return rank, U, S, Vt


@kernel
def least_squares(rank, U, S, Vt, t):
    """The least-norm y of min ||B y - t|| from the factors of B."""
    y = np.zeros(Vt.shape[0])
    for l in range(rank):
        s = 0.0
        for i in range(len(t)):
            s += U[i, l] * t[i]
        s /= S[l]
        for j in range(len(y)):
            y[j] += s * Vt[l, j]
    return y


@kernel
def outside(v, low, high):
    """How far v is outside [low, high] beyond rounding; 0 inside."""
    miss = max(low - v, v - high)
    return miss if miss > SLACK * (1e-30 + abs(v)) else 0.0


@kernel
def scale_range(a, b, low, high, held):
    """(least, most, first to block from above, first from below) of the s for which b + s a is inside the box."""
    least = -np.inf
    most = np.inf
    above = -1
    below = -1
    for j in range(len(a)):
        if held[j]:
            continue
        if abs(a[j]) <= 1e-300:
            if outside(b[j], low[j], high[j]) > 0.0:
                return np.inf, -np.inf, j, j
            continue
        s0 = (low[j] - b[j]) / a[j]
        s1 = (high[j] - b[j]) / a[j]
        if s0 > s1:
            s0, s1 = s1, s0
        if s1 < most:
            most = s1
            above = j
        if s0 > least:
            least = s0
            below = j
    return least, most, above, below


@kernel
def basic_level(J, t, full, zero, Z, low, high, x):
    """Execute one level of rank `full` as the basic algorithm does, x (n,) updated.

    Returns (finite, scale, saturations tried); the scale is negative, and x unchanged, where none was found.
    """
    n = Z.shape[0]
    held = np.zeros(n, np.bool_)
    which = np.empty(n, np.int64)
    bound = np.empty(n)
    count = 0
    tried = 0
    best = -1.0
    answer = x.copy()
    while True:
        start = x.copy()
        basis = Z
        if count:
            rows = np.empty((count, Z.shape[1]))
            gap = np.empty(count)
            for i in range(count):
                rows[i] = Z[which[i]]
                gap[i] = bound[i] - x[which[i]]
            rank, U, S, Vt = split(rows, 1e-10)
            if rank < count:  # the last unknown cannot be brought to its bound beside the others
                break
            start += np.dot(Z, least_squares(rank, U, S, Vt, gap))
            if rank == Z.shape[1]:
                break
            basis = np.dot(Z, np.ascontiguousarray(Vt[rank:].T))
        rank, U, S, Vt = split(np.dot(J, basis), zero)
        if rank < full:
            break
        a = np.dot(basis, least_squares(rank, U, S, Vt, t))
        b = start - np.dot(basis, least_squares(rank, U, S, Vt, np.dot(J, start)))
        if not finite(a) or not finite(b):
            return False, best, tried
        inside = True
        for j in range(n):
            if not held[j] and outside(a[j] + b[j], low[j], high[j]) > 0.0:
                inside = False
        if inside:
            best = 1.0
            answer = a + b
            break
        least, most, above, below = scale_range(a, b, low, high, held)
        if least <= most and most >= 0.0 and least <= 1.0 and min(most, 1.0) > best:
            best = min(most, 1.0)
            answer = b + best * a
        critical = above if most < 1.0 else below
        high_side = a[critical] + b[critical] > high[critical]
        if critical < 0 or count == n:
            break
        if outside(a[critical] + b[critical], low[critical], high[critical]) == 0.0:
            break  # only rounding is left
        which[count] = critical
        bound[count] = high[critical] if high_side else low[critical]
        held[critical] = True
        count += 1
        tried += 1
    for j in range(n):
        x[j] = min(max(answer[j], low[j]), high[j])
    return True, best, tried


@kernel
def box_of(A, lower, upper, low, high, origin):
    """The box that rows of one non-zero entry each put on x; origin (n, 2): the rows that give its sides, -1 for none.

    Returns (-2, -1) when all is well, (row, -1) for a row of zeros that cannot be met, (row, row) for two rows in conflict,
    (-1, row) for a row with more than one entry.
    """
    m, n = A.shape
    low[:] = -np.inf
    high[:] = np.inf
    origin[:] = -1
    for i in range(m):
        at = -1
        for j in range(n):
            if A[i, j] != 0.0:
                if at >= 0:
                    return -1, i
                at = j
        if at < 0:
            if lower[i] > 0.0 or upper[i] < 0.0:
                return i, -1
            continue
        first = lower[i] / A[i, at]
        second = upper[i] / A[i, at]
        if first > second:
            first, second = second, first
        if first > low[at]:
            low[at] = first
            origin[at, 0] = i
        if second < high[at]:
            high[at] = second
            origin[at, 1] = i
    for j in range(n):
        if low[j] > high[j]:
            if low[j] - high[j] > 1e-12 * (abs(low[j]) + abs(high[j])):
                return min(origin[j, 0], origin[j, 1]), max(origin[j, 0], origin[j, 1])
            low[j] = high[j]  # two rows that meet up to rounding
    return -2, -1
