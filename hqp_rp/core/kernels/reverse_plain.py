"""Reverse priority (29) without damping, where triangles prove every rank: no SVD, and nothing allocated.

The same steps as in `reverse`, which takes over where a rank is not proven.
"""

from __future__ import annotations

import numpy as np

from hqp_rp.core.kernels.cascade import finite
from hqp_rp.core.kernels.compile import lean
from hqp_rp.core.kernels.householder import padded
from hqp_rp.core.kernels.orthogonal import (
    frobenius,
    level_least_squares,
    load,
    tall_transposed,
    triangle,
    turn_back_reflectors,
)
from hqp_rp.core.kernels.room import as_counts, as_matrix
from hqp_rp.core.kernels.vector_load import copy_scaled_row

UNPROVEN = -1
NOT_FINITE = 0
DONE = 1

LARGEST_RATIO = 2.0**50
"""Levels further apart in size than this weigh as this: the difference is below rounding error."""


@lean
def row_weights(scale, offsets, k, weight):
    """One weight for each row of levels k ... p - 1: loaded row * weight is proportional to the row as it was given."""
    p = len(offsets) - 1
    for row in range(offsets[p] - offsets[k]):
        weight[row] = 1.0
    last = 0.0
    value = 1.0
    for _ in range(k, p):
        following = np.inf
        for i in range(k, p):
            if scale[i] > last:
                following = min(following, scale[i])
        if following == np.inf:
            break
        if last > 0.0:
            value /= min(following / last, LARGEST_RATIO)
        for i in range(k, p):
            if scale[i] == following:
                for row in range(offsets[i] - offsets[k], offsets[i + 1] - offsets[k]):
                    weight[row] = value
        last = following


@lean
def plain_room(M, n, p):
    """How many numbers `plain_columns` needs for M rows, n unknowns and p levels."""
    return (2 * M + 1) * padded(n) + (n + 1) * padded(M) + 9 * M + n + p


@lean
def by_weight(weight, count, order):
    """order[:count] <- positions of `weight` by falling weight, equal ones as they stand."""
    for i in range(count):
        at = i
        while at > 0 and weight[order[at - 1]] < weight[i]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = i


@lean
def plain_columns(room, A, b, offsets, z, tol, x):
    """x <- x + T_k (J_k T_k)^# (b_k - J_k x) for k = p, ..., 1, from x = z: (29). Returns `DONE`, `NOT_FINITE` or `UNPROVEN`.

    Where a step cancels most of what lower levels had put into x, its residual is corrected once more.
    """
    M, n = A.shape
    p = len(offsets) - 1
    N = padded(n)
    W0 = as_matrix(room, M, N)
    W = as_matrix(room[M * N :], M, N)
    y = room[2 * M * N : (2 * M + 1) * N]
    tall = room[(2 * M + 1) * N :]
    heavy = tall[n * padded(M) : (n + 1) * padded(M)]
    vectors = tall[(n + 1) * padded(M) :]
    rhs = vectors[:M]
    right = vectors[M : 2 * M]
    t = vectors[2 * M : 3 * M]
    weight = vectors[3 * M : 4 * M]
    moved = vectors[4 * M : 5 * M]
    ref_tau = vectors[5 * M : 6 * M]
    scale = vectors[6 * M : 6 * M + p]
    counts = as_counts(vectors[6 * M + p :], 3 * M + n)
    ref_row = counts[:M]
    ref_col = counts[M : 2 * M]
    order = counts[2 * M : 3 * M]
    turn = counts[3 * M : 3 * M + n]
    if not load(A, b, offsets, W0, rhs, scale):
        return NOT_FINITE
    for j in range(n):
        x[j] = z[j]
    for k in range(p - 1, -1, -1):
        r0 = offsets[k]
        r1 = offsets[k + 1]
        m = r1 - r0
        below = M - r1
        if m == 0:
            continue
        for _ in range(2):
            for i in range(M - r0):
                copy_scaled_row(W, i, W0, r0 + i, 1.0)
                right[i] = i - m
            for i in range(m):
                s = rhs[r0 + i]
                for j in range(n):
                    s -= W0[r0 + i, j] * x[j]
                right[i] = s
            for j in range(N):
                y[j] = 0.0
            norm = frobenius(W0, r0, r1)
            r, proven = triangle(W, 0, m, 0, m + below, right, norm, tol, 0, ref_row, ref_col, ref_tau)
            if not proven:
                return UNPROVEN
            for i in range(m):
                t[i] = right[i]
            if r:
                level_least_squares(W, 0, m, 0, r, t)
            for j in range(r):
                y[j] = t[j]
            low = 0
            if below and 0 < r < n:
                norm = frobenius(W0, r1, M)
                low, proven = triangle(W, m, m + below, r, m + below, right, norm, tol, r, ref_row, ref_col, ref_tau)
                if not proven:
                    return UNPROVEN
                for i in range(below):  # what the lower rows must be given back for the step y
                    s = 0.0
                    for j in range(r):
                        s -= W[m + i, j] * y[j]
                    t[i] = s
                if low == below:
                    level_least_squares(W, m, m + below, r, low, t)
                elif low:
                    row_weights(scale, offsets, k, weight)
                    for i in range(below):
                        moved[i] = weight[m + int(right[m + i])]
                    by_weight(moved, below, order)
                    T = as_matrix(tall, low, padded(below))
                    for j in range(low):
                        for i in range(padded(below)):
                            T[j, i] = 0.0
                    for i in range(padded(below)):
                        heavy[i] = 0.0
                    for i in range(below):
                        row = order[i]
                        heavy[i] = t[row] * moved[row]
                        for j in range(min(row + 1, low)):
                            T[j, i] = W[m + row, r + j] * moved[row]
                    tall_transposed(T, low, heavy, turn, t)
                for j in range(low):
                    y[r + j] = t[j]
            turn_back_reflectors(W, y, 0, r + low, ref_row, ref_col, ref_tau)
            before = 0.0
            after = 0.0
            for j in range(n):
                before = max(before, abs(x[j]))
                x[j] += y[j]
                after = max(after, abs(x[j]))
            if not before > 4.0 * after:
                break
    return DONE if finite(x) else NOT_FINITE
