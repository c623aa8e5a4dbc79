"""A level with more rows than directions to take: its triangle by a second factorization, kept for an answer to come."""

from __future__ import annotations

import math

from hqp_rp.core.kernels.compile import lean
from hqp_rp.core.kernels.householder import (
    householder,
    longest_row,
    padded,
    reflect_rows,
    swap_any_rows,
    turn_vector,
)


@lean
def lay_down(W, r0, r1, c0, r, room, right, pivot):
    """R and `Q_L^T right` of the factor L (m, r) that `lq` left in rows r0:r1 of W: `L P = Q_L R`, m > r.

    Householder's reflectors with column pivoting, stable row by row (Cox and Higham 1998). `room` takes T (r, padded m) with
    R_ij = T[j, i] for i <= j; right (padded m,) <- Q_L^T right; pivot (r,): column j of L P is column pivot[j] of L.
    """
    m = r1 - r0
    wide = padded(m)
    T = room[: r * wide].reshape((r, wide))
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
