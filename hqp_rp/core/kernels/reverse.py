"""Reverse priority (20)-(29) on N levels: lowest level first, each higher one corrected along T_k.

For level k and the rows B = [J_{k+1}; ...; J_p] of all lower levels, T_k holds the first columns of [J_k; B]^+ (25), so
range(T_k) = { S^+ J_k^T mu } with S = J_k^T J_k + B^T B, and the step T_k (J_k T_k)^# r of (29) is the solution of

    min ||B d||^2 + lambda^2 ||d||^2     subject to     J_k d = r (in the least-squares sense),  d of least norm,

the correction that disturbs all lower levels least, jointly; lambda is the damping of the pseudo-inverse that gives T_k.
That problem is what is factored here: J_k by orthogonal transformations, d = Y y + Z w, then the lower rows in the
freedom Z that J_k leaves. It never squares a matrix, and J_k d = r holds to rounding error at any condition.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.cascade import finite, pseudo_inverse, solve_level
from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import (
    damped_inverse,
    factor,
    forward_substitution,
    load,
    lower_block,
    spectral,
    tall_least_squares,
    turn_back,
)

LARGEST_RATIO = 2.0**50
"""Levels further apart in size than this weigh as this: the difference is below rounding error."""


@kernel
def level_weights(scale, k, p):  # type: ignore[no-untyped-def]
    """Weight of each level's loaded rows relative to the largest level of k ... p - 1, so that loaded * weight ~ original."""
    weight = np.ones(p)
    last = 0.0
    previous = 0.0
    for _ in range(k, p):
        nearest = np.inf
        for i in range(k, p):
            if scale[i] > last:
                nearest = min(nearest, scale[i])
        if nearest == np.inf:
            break
        value = 1.0 if last == 0.0 else previous / min(nearest / last, LARGEST_RATIO)
        for i in range(k, p):
            if scale[i] == nearest:
                weight[i] = value
        last = nearest
        previous = value
    return weight


@kernel
def weighted_rows(C, T, row_weight, order):  # type: ignore[no-untyped-def]
    """Copies of C (m, r) and T (m,) with rows weighted and taken in the given order."""
    m, r = C.shape
    Cw = np.empty((m, r))
    Tw = np.empty(m)
    for i in range(m):
        source = order[i]
        for j in range(r):
            Cw[i, j] = C[source, j] * row_weight[source]
        Tw[i] = T[source] * row_weight[source]
    return Cw, Tw


@kernel
def smallest_singular_value(C, rows):  # type: ignore[no-untyped-def]
    """The min(rows, n)-th singular value of C."""
    _, S, _ = np.linalg.svd(C, False)
    return S[min(rows, C.shape[1]) - 1]


@kernel
def correction(W0, offsets, scale, k, t, tol, kind, first, second, basis):  # type: ignore[no-untyped-def]
    """The step T_k (J_k T_k)^# t of (29) (n,), and when `basis`, an orthonormal basis (n, d) of range(T_k) + null space.

    W0: the loaded rows; t: (m_k,) loaded residual of level k. Damping acts on the pseudo-inverse that gives T_k alone.
    """
    n = W0.shape[1]
    p = len(offsets) - 1
    r0 = offsets[k]
    m = offsets[k + 1] - r0
    W = W0[r0:].copy()
    rows = len(W)
    below = rows - m
    ref_row = np.empty(rows, np.int64)
    ref_col = np.empty(rows, np.int64)
    ref_tau = np.empty(rows)
    turns = np.empty((2, n, n))
    right = np.zeros(rows)
    right[:m] = t
    r, rank, V, U, S = factor(W, 0, m, 0, rows, right, W0, r0, r0 + m, 1.0, tol, False, 0, ref_row, ref_col, ref_tau)
    turned = len(V)
    if turned:
        turns[0, :r, :r] = V
    columns = 1 + rank if basis else 1
    Y = np.zeros((columns, n))
    solve_level(W, 0, m, 0, r, rank, U, S, right[:m].copy(), 0.0, 1.0, 0, 0.0, 0.0, Y[0])
    for j in range(1, columns):
        Y[j, j - 1] = 1.0
    t1 = r
    r2 = 0
    turned2 = 0
    low_rank = 0
    if below > 0 and rank > 0 and rank < n:
        weight = level_weights(scale, k + 1, p)
        row_weight = np.empty(below)
        for i in range(k + 1, p):
            for row in range(offsets[i], offsets[i + 1]):
                row_weight[row - r0 - m] = weight[i]
        if kind == 1 or kind == 2:
            largest = np.inf
            for i in range(k, p):
                largest = min(largest, scale[i])
            all_weight = level_weights(scale, k, p)
            stacked = W0[r0:].copy()
            for i in range(k, p):
                for row in range(offsets[i], offsets[i + 1]):
                    stacked[row - r0] *= all_weight[i]
            smallest = smallest_singular_value(stacked, rows) if kind == 2 else 0.0
            low = all_weight[k + 1] if k + 1 < p else 1.0
            for i in range(k + 1, p):
                low = max(low, all_weight[i])
            B = np.empty((below, n - rank))
            for i in range(below):
                for j in range(n - rank):
                    B[i, j] = W[m + i, rank + j] * row_weight[i] * low
            Ub, Sb, Vb = np.linalg.svd(B, False)
            for column in range(columns):
                y = Y[column]
                for l in range(len(Sb)):
                    s = 0.0
                    for i in range(below):
                        d = 0.0
                        for j in range(rank):
                            d -= W[m + i, j] * y[j]
                        s += Ub[i, l] * d * row_weight[i] * low
                    # The damping factor is that of the whole [J_k; B]: `smallest` is its sigma_m.
                    s *= damped_inverse(Sb[l], smallest, 0.0, kind, first * largest, second * largest)
                    for j in range(n - rank):
                        y[rank + j] += s * Vb[l, j]
        else:
            disturbance = np.zeros(rows)
            for i in range(below):
                disturbance[m + i] = float(i)
            r2, low_rank, V2, U2, S2 = factor(
                W,
                m,
                rows,
                rank,
                rows,
                disturbance,
                W0,
                r0 + m,
                r0 + rows,
                1.0,
                tol,
                False,
                t1,
                ref_row,
                ref_col,
                ref_tau,
            )
            turned2 = len(V2)
            if turned2:
                turns[1, :r2, :r2] = V2
            if low_rank > 0:
                for column in range(columns):
                    y = Y[column]
                    right_low = np.empty(below)
                    for i in range(below):
                        s = 0.0
                        for j in range(rank):
                            s -= W[m + i, j] * y[j]
                        right_low[i] = s
                    if turned2 == 0 and low_rank == below:
                        forward_substitution(W, m, rank, low_rank, right_low, y)
                    else:
                        if turned2:
                            C = U2[:, :low_rank] * S2[:low_rank]
                        else:
                            C = lower_block(W, m, rows, rank, low_rank)
                        heavy = np.empty(below)
                        for i in range(below):
                            heavy[i] = row_weight[int(disturbance[m + i])]
                        Cw, Tw = weighted_rows(C, right_low, heavy, np.argsort(-heavy))
                        tall_least_squares(Cw, Tw)
                        y[rank : rank + low_rank] = Tw[:low_rank]
    free = n - rank - low_rank if basis else 0
    out = np.zeros((columns + free, n))
    out[:columns] = Y
    for j in range(free):
        out[columns + j, rank + low_rank + j] = 1.0
    for column in range(columns + free):
        if t1 + r2 > t1 or turned2:
            turn_back(W, out[column], rank, turns, 1, turned2, t1, t1 + r2, ref_row, ref_col, ref_tau)
        turn_back(W, out[column], 0, turns, 0, turned, 0, t1, ref_row, ref_col, ref_tau)
    return out
