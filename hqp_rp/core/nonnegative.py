"""Least squares with non-negative unknowns, small and dense: multipliers of the right sign."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.diagnostics import norm
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.tolerances import EXACT_MULTIPLIERS, PULL


def nonnegative_least_squares(C: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The w >= 0 (k,) that minimizes ||C w - y||, C (m, k), and y - C w (m,).

    Source: Lawson and Hanson, Solving Least Squares Problems, 1974, algorithm NNLS.
    """
    k = C.shape[1]
    # At an optimum with independent active rows the unconstrained multipliers already have the right signs.
    w = np.maximum(np.linalg.lstsq(C, y, rcond=None)[0], 0.0)
    rest = y - C @ w
    if norm(rest) <= EXACT_MULTIPLIERS * norm(y):
        return w, rest
    first = w, rest
    w = np.zeros(k)
    passive = np.zeros(k, dtype=bool)
    rest = y
    least = PULL * norm(y)
    for _ in range(3 * k + 10):
        pull = np.where(passive, 0.0, C.T @ rest)
        entering = int(pull.argmax())
        if not pull[entering] > least:
            break
        passive[entering] = True
        best: NDArray[np.floating] = np.zeros(0)
        for _ in range(k + 1):
            best = np.linalg.lstsq(C[:, passive], y, rcond=None)[0]
            if (best > 0.0).all():
                break
            old = w[passive]
            falling = best <= 0.0
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = np.where(falling, old / (old - best), np.inf)
            ratio[falling & (old <= best)] = 0.0  # 0 / 0: a column that enters with weight 0
            step = float(ratio.min())
            moved = old + step * (best - old)
            moved[falling & (ratio <= step)] = 0.0
            w[:] = 0.0
            w[passive] = np.maximum(moved, 0.0)
            passive &= w > 0.0
            if not passive.any():
                best = np.zeros(0)
                break
        w[:] = 0.0
        w[passive] = best
        following = y - C @ w
        if not norm(following) < norm(rest):  # the last digits are reached
            break
        rest = following
    # A small weight may have been rounding error beside large ones of nearly parallel columns, and right at first.
    return (w, rest) if norm(rest) <= norm(first[1]) else first
