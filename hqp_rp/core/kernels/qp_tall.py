"""What is left to do with the factor L (m, r) of a level: its triangle where m > r, its singular values where they decide."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import kernel, lean
from hqp_rp.core.kernels.householder import (
    householder,
    longest_row,
    padded,
    reflect_rows,
    swap_any_rows,
    turn_vector,
)
from hqp_rp.core.kernels.orthogonal import lower_block, turn_forward_by
from hqp_rp.core.kernels.room import as_matrix


@lean
def lay_down(W, r0, r1, c0, r, room, right, pivot):
    """R and `Q_L^T right` of the factor L (m, r) that `lq` left in rows r0:r1 of W: `L P = Q_L R`, m > r.

    Householder's reflectors with column pivoting, stable row by row (Cox and Higham 1998). `room` takes T (r, padded m) with
    R_ij = T[j, i] for i <= j; right (padded m,) <- Q_L^T right; pivot (r,): column j of L P is column pivot[j] of L.
    """
    m = r1 - r0
    wide = padded(m)
    T = as_matrix(room[: r * wide], r, wide)
    for i in range(m, wide):
        right[i] = 0.0
    for j in range(r):
        pivot[j] = j
        for i in range(wide):
            T[j, i] = W[r0 + i, c0 + j] if j <= i < m else 0.0
    for j in range(r):
        best, longest = longest_row(T, j, r, j)
        if best != j:
            swap_any_rows(T, j, best)
            other = pivot[j]
            pivot[j] = pivot[best]
            pivot[best] = other
        norm = math.sqrt(longest)
        if norm > 0.0:
            tau = householder(T, j, j, norm)
            reflect_rows(T, j + 1, r, T, j, j, tau)
            turn_vector(right, T, j, j, tau)


@kernel
def by_singular_values(W, m, c0, r, zero, residual, V, S, c):
    """L = U S V^T for the factor L that `lq` left in the first m rows of W: V (r, r), S (r,), c (r,) = U^T residual.

    Returns how many singular values exceed `zero`.
    """
    U, s, Vt = np.linalg.svd(lower_block(W, 0, m, c0, r), False)
    rank = 0
    while rank < r and s[rank] > zero:
        rank += 1
    for j in range(r):
        S[j] = s[j]
        c[j] = 0.0
        for i in range(m):
            c[j] += U[i, j] * residual[i]
        for i in range(r):
            V[i, j] = Vt[j, i]
    return rank


@lean
def turn_columns(W, i0, i1, c0, V, r):
    """Columns c0:c0 + r of rows i0:i1 of W <- themselves times V (r, r)."""
    for i in range(i0, i1):
        turn_forward_by(V, r, W[i], c0)
