"""The point of an affine space with inequalities that a small strictly convex least-squares problem asks for."""

from __future__ import annotations

import numpy as np

from hqp_rp.core.diagnostics import norm, row_norms, two_norm
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.tolerances import MULTIPLIER, SHORT_NORMAL, STANDSTILL

_EPS = float(np.finfo(np.float64).eps)


def nearest_point(
    x: FloatArray, Z: FloatArray, G: FloatArray, h: FloatArray, B: FloatArray, c: FloatArray
) -> FloatArray:
    """The x + Z y that minimizes ||B y + c|| subject to G (x + Z y) <= h, rows of G (k, n) of length one, x allowed."""
    rows = G @ Z
    lengths = row_norms(rows)
    free = lengths > SHORT_NORMAL
    room = np.maximum(h[free] - G[free] @ x, 0.0) / lengths[free]
    return x + Z @ _nearest(B, c, rows[free] / lengths[free, None], room)


def _nearest(B: FloatArray, c: FloatArray, G: FloatArray, h: FloatArray) -> FloatArray:
    """The y (d,) that minimizes ||B y + c|| subject to G y <= h, h >= 0, rows of G of length one; B (r, d) of full column rank.

    A primal active-set search from y = 0, which is allowed. It leaves the row of the smallest number once it has stood still
    for d steps (Bland's rule). Source: Nocedal and Wright 2006, algorithm 16.3.
    """
    y, held, idle = np.zeros(B.shape[1]), np.zeros(len(G), dtype=bool), 0
    for _ in range(50 + 10 * len(G)):
        N = np.linalg.qr(G[held].T, mode="complete")[0][:, int(held.sum()) :] if held.any() else np.eye(len(y))
        slope = np.asarray(B @ y + c, dtype=np.float64)
        step = np.zeros(len(y))
        if N.shape[1]:
            step = np.asarray(-N @ np.linalg.lstsq(B @ N, slope, rcond=None)[0], dtype=np.float64)
        length = norm(step)
        if length > STANDSTILL * (norm(y) + norm(c) / two_norm(B)):
            change = G @ step
            blocks = ~held & (change > MULTIPLIER * length)
            with np.errstate(divide="ignore", invalid="ignore"):
                parts = np.where(blocks, np.maximum(h - G @ y, 0.0) / change, np.inf)
            first = int(parts.argmin()) if len(parts) else -1
            part = min(1.0, float(parts[first])) if first >= 0 else 1.0
            y = y + part * step
            idle = 0 if part > 0.0 else idle + 1
            if part < 1.0:
                held[first] = True
                continue
            slope = B @ y + c
        which = np.flatnonzero(held)
        if not len(which):
            return y
        multipliers = np.linalg.lstsq(G[which].T, -(B.T @ slope), rcond=None)[0]
        wrong = which[multipliers < -MULTIPLIER * max(float(np.abs(multipliers).max()), _EPS)]
        if not len(wrong):
            return y
        held[wrong[0] if idle > len(y) else which[multipliers.argmin()]] = False
    return y
