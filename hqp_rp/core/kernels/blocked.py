"""Many rows turned at once by the reflectors of a small factorization: R <- R Q in the compact WY form."""

from __future__ import annotations

import numpy as np

from hqp_rp.core.kernels.compile import kernel

WORTHWHILE = 4000  # multiplications below which row by row is faster than matrix products


@kernel
def turned_rows(R, L, r, tau, V):
    """R Q (rows, d), as an array of its own.

    Q is the product of the r reflectors that `lq` or `factor` left right of the diagonal of L (m, d), begun at its first row
    and column, with tau (r,), times V on the first columns where V is not empty.

    Source: Schreiber and Van Loan 1989: Q = I - Y^T T Y with T upper triangular.
    """
    rows, d = R.shape
    if rows * d * r < WORTHWHILE:
        turned = R.copy()
        for j in range(r):
            for i in range(rows):
                dot = turned[i, j]
                for col in range(j + 1, d):
                    dot += turned[i, col] * L[j, col]
                dot *= tau[j]
                turned[i, j] -= dot
                for col in range(j + 1, d):
                    turned[i, col] -= dot * L[j, col]
    else:
        Y = np.zeros((r, d))
        for j in range(r):
            Y[j, j] = 1.0
            for col in range(j + 1, d):
                Y[j, col] = L[j, col]
        products = np.dot(Y, Y.T)
        T = np.zeros((r, r))
        for j in range(r):
            T[j, j] = tau[j]
            for i in range(j):
                s = 0.0
                for q in range(i, j):
                    s += T[i, q] * products[q, j]
                T[i, j] = -tau[j] * s
        turned = R - np.dot(np.dot(np.dot(R, Y.T), T), Y)
    if len(V):
        k = len(V)
        turned[:, :k] = np.dot(np.ascontiguousarray(turned[:, :k]), V)
    return turned
