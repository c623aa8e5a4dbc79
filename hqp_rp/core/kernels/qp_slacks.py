"""A QP with softened rows as one with slacks among its unknowns, for back ends that take dense matrices."""

from __future__ import annotations

import numpy as np

from hqp_rp.core.kernels.compile import kernel


@kernel
def fill_slacks(hessian, gradient, rows, lower, upper, soft, infinite, t, y, H, g, C, low, up, start):
    """Fill (H, g, C, low, up) of a `SlackQP` on (t, s), bounds cut at `infinite`, and start = (t, s = -y)."""
    n = len(gradient)
    m = len(lower)
    H[:] = 0.0
    g[:] = 0.0
    C[:] = 0.0
    for j in range(n):
        H[j, j] = hessian[j]
        g[j] = gradient[j]
        start[j] = t[j]
    for i in range(m):
        for j in range(n):
            C[i, j] = rows[i, j]
        if i < soft:
            H[n + i, n + i] = 1.0
            C[i, n + i] = 1.0
            start[n + i] = -y[i]
        low[i] = max(lower[i], -infinite)
        up[i] = min(upper[i], infinite)


@kernel
def with_slacks(hessian, gradient, rows, lower, upper, soft, infinite, t, y):
    """(H, g, C, low, up, start) as `fill_slacks` fills them."""
    n = len(gradient) + soft
    m = len(lower)
    H = np.empty((n, n))
    g = np.empty(n)
    C = np.empty((m, n))
    low = np.empty(m)
    up = np.empty(m)
    start = np.empty(n)
    fill_slacks(hessian, gradient, rows, lower, upper, soft, infinite, t, y, H, g, C, low, up, start)
    return H, g, C, low, up, start
