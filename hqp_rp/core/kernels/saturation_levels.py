"""Saturation in the null space on N levels, level by level: the basic algorithm or the optimal one."""

from __future__ import annotations

import numpy as np

from hqp_rp.core.kernels.cascade import finite
from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import load, spectral
from hqp_rp.core.kernels.saturation import basic_level, split
from hqp_rp.core.kernels.saturation_optimal import optimal_level

MISSED = 1e-9  # of ||A_k||_F ||x|| + ||b_k||: what a solved level may be off, the tolerance that the solver declares


@kernel
def size_of(J, t, x):
    """||J||_F ||x|| + ||t||."""
    return np.sqrt((J * J).sum() * np.dot(x, x)) + np.sqrt(np.dot(t, t))


@kernel
def saturation_null_space(A, rhs_given, offsets, low, high, zeta, tol, optimal, x, scales):
    """x (n,) and the scale of each level, from zeta clipped to the box.

    Returns (finite, iterations, unfinished, missed). unfinished: the first level whose optimum was not found within the
    iterations, and which the basic algorithm executed like all levels below it; missed: the first level that rounding, or
    x put back onto its bounds after it, kept from its scaled task by more than `MISSED`. -1 for none.
    """
    M, n = A.shape
    p = len(offsets) - 1
    W = np.empty((M, n))
    rhs = np.empty(M)
    unfinished = -1
    missed = -1
    made = np.zeros(M)
    done = np.zeros(p, np.bool_)
    if not load(A, rhs_given, offsets, W, rhs, np.empty(p)):
        return False, 0, unfinished, missed
    side = np.zeros(n, np.int64)
    mu = np.zeros(n)
    for j in range(n):
        x[j] = min(max(zeta[j], low[j]), high[j])
        mu[j] = x[j] - zeta[j]
        side[j] = 1 if mu[j] < 0.0 else -1 if mu[j] > 0.0 else 0
    scales[:] = 1.0
    Z = np.eye(n)
    tried = 0
    for k in range(p):
        r0 = offsets[k]
        r1 = offsets[k + 1]
        if r0 == r1 or Z.shape[1] == 0:
            continue
        J = W[r0:r1].copy()
        t = rhs[r0:r1].copy()
        zero = tol * spectral(W, r0, r1)
        full, U, S, Vt = split(np.dot(J, Z), zero)
        if full == 0:
            continue
        scale = 0.0
        if optimal and unfinished < 0:
            scale, more = optimal_level(J, t, full, U, S, Vt, Z, low, high, zeta, side, mu, x)
            tried += more
            if not np.isfinite(scale):
                return False, tried, unfinished, missed
            if scale < 0.0:
                unfinished = k
        if not optimal or unfinished >= 0:
            sound, scale, more = basic_level(J, t, full, zero, Z, low, high, x)
            tried += more
            if not sound:
                return False, tried, unfinished, missed
        made[r0:r1] = np.dot(J, x)
        done[k] = scale > 0.0
        if done[k] and missed < 0:
            miss = np.dot(np.ascontiguousarray(U[:, :full].T), made[r0:r1] - scale * t)
            if np.sqrt(np.dot(miss, miss)) > MISSED * size_of(J, t, x):
                missed = k
        scales[k] = max(scale, 0.0)
        Z = np.dot(Z, np.ascontiguousarray(Vt[full:].T)) if full < Z.shape[1] else np.empty((n, 0))
    for k in range(p):
        r0 = offsets[k]
        r1 = offsets[k + 1]
        if done[k] and (missed < 0 or k < missed):
            J = W[r0:r1]
            drift = np.dot(J, x) - made[r0:r1]
            if np.sqrt(np.dot(drift, drift)) > MISSED * size_of(J, rhs[r0:r1], x):
                missed = k
    return finite(x), tried, unfinished, missed
