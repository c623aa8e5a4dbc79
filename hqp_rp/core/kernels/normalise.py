"""Rows of length one and the weights that undo it, for solvers that measure a row's violation in its own length."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import kernel


@kernel
def unit_rows(A, lower, upper, offsets, zeta, rho, lowest, rows, low, up, softness, equality):
    """rows (M, n) = A with rows of length one, bounds of rows (x - zeta) in low, up; True when everything is finite.

    softness_i = rho * (longest row of the level / length of row i)^2, so that sum_i v_i^2 / softness_i of the normalised
    violations is the level's own sum of squares over (rho * longest^2). A row is never softer than rho / lowest^2. A row of
    zeros stays one, without bounds. equality (M,): whether the bounds coincide.
    """
    n = A.shape[1]
    for k in range(len(offsets) - 1):
        longest = 0.0
        for i in range(offsets[k], offsets[k + 1]):
            big = 0.0
            for j in range(n):
                a = abs(A[i, j])
                if not a < np.inf:
                    return False
                big = max(big, a)
            s = 0.0
            if big > 0.0:
                e = math.ldexp(1.0, max(-1000, min(1000, -math.frexp(big)[1])))
                for j in range(n):
                    s += (A[i, j] * e) ** 2
                s = math.sqrt(s) / e
            softness[i] = s  # its length, for now
            longest = max(longest, s)
        for i in range(offsets[k], offsets[k + 1]):
            length = softness[i]
            softness[i] = rho
            equality[i] = lower[i] == upper[i]
            if length == 0.0:
                rows[i] = 0.0
                low[i] = -np.inf
                up[i] = np.inf
                equality[i] = False
                continue
            shift = 0.0
            for j in range(n):
                rows[i, j] = A[i, j] / length
                shift += rows[i, j] * zeta[j]
            low[i] = lower[i] / length - shift
            up[i] = upper[i] / length - shift
            if equality[i]:
                up[i] = low[i]
            if np.isnan(low[i]) or np.isnan(up[i]) or low[i] == np.inf or up[i] == -np.inf:
                return False
            softness[i] = rho / max(length / longest, lowest) ** 2
    return True


@kernel
def stack_rows(hard, hard_lower, hard_upper, matrix, lower, upper, A, low, up):
    """Fill A (M, n), low, up (M,) with the hard rows and, below them, the levels' rows."""
    h = len(hard)
    A[:h] = hard
    low[:h] = hard_lower
    up[:h] = hard_upper
    A[h:] = matrix
    low[h:] = lower
    up[h:] = upper
