"""Chiaverini's singularity-robust priority (13) on N levels: each level's own pseudo-inverse, projected once."""

from __future__ import annotations

import numpy as np

from hqp_rp.core.kernels.cascade import finite, null_space
from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import factor, load, turn_back


@kernel
def singularity_robust(A, b, offsets, z, tol, kind, first, second, x):
    """x = sum_k N_{k-1} A_k^# b_k + N_p z, with N_k the projector on null([A_1; ...; A_k]). True when x is finite.

    The pseudo-inverse of a level never sees the levels before it, so it stays bounded at an algorithmic singularity, at
    the price of an error in every level but the first.
    """
    M, n = A.shape
    p = len(offsets) - 1
    W = np.empty((M + p + 1, n))
    rhs = np.empty(M)
    scale = np.empty(p)
    if not load(A, b, offsets, W, rhs, scale):
        return False
    for k in range(p):
        m = offsets[k + 1] - offsets[k]
        own = np.array([0, m])
        null_space(
            A[offsets[k] : offsets[k + 1]],
            b[offsets[k] : offsets[k + 1]],
            own,
            np.zeros(n),
            tol,
            kind,
            first,
            second,
            W[M + k],
        )
    W[M + p] = z
    ref_row = np.empty(M, np.int64)
    ref_col = np.empty(M, np.int64)
    ref_tau = np.empty(M)
    start = np.zeros(p + 1, np.int64)
    column = np.zeros(p + 1, np.int64)
    turns = [np.empty((0, 0)) for _ in range(p)]
    for k in range(p):
        r, rank, V, _, _ = factor(
            W, offsets[k], offsets[k + 1], column[k], len(W), rhs, A, offsets[k], offsets[k + 1], scale[k], tol, False,
            start[k], ref_row, ref_col, ref_tau,
        )  # fmt: skip
        turns[k] = V
        start[k + 1] = start[k] + r
        column[k + 1] = column[k] + rank
    x[:] = 0.0
    for k in range(p + 1):
        for j in range(column[k], n):
            x[j] += W[M + k, j]
    for k in range(p - 1, -1, -1):
        turn_back(W, x, column[k], turns[k], start[k], start[k + 1], ref_row, ref_col, ref_tau)
    return finite(x)
