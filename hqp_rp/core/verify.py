"""A verdict on an answer that a control loop can afford: a compiled proof first, the full certificate where it fails."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from hqp_rp.core.closed_form import zeros
from hqp_rp.core.diagnostics import row_norms
from hqp_rp.core.problem import FloatArray, Level, Problem, Stacked
from hqp_rp.core.solver import RANK_TOLERANCE


def fault_of(
    problem: Problem,
    x: FloatArray,
    secondary: FloatArray | None,
    tolerance: float,
    *,
    stacked: Stacked | None = None,
    tried: bool = False,
    rank_tolerance: float = RANK_TOLERANCE,
) -> str:
    """ "" when x (n,) is the lexicographic optimum of `problem` to the relative `tolerance`, else a sentence that says why not.

    The same verdict as `certify(problem, x, secondary, tolerance)`: a compiled upper bound of each level's excess accepts
    most answers in a few microseconds, and what it does not accept goes to `certify`.

    Args:
        problem, x, secondary, tolerance, rank_tolerance: as for `certify`; not checked.
        stacked: `problem.with_hard` as the caller has it already; None takes it from the problem.
        tried: the compiled proof has been tried already, and has not succeeded.
    """
    if not tried:
        matrix, lower, upper, offsets = problem.with_hard if stacked is None else stacked
        zeta = zeros(problem.n) if secondary is None else secondary
        try:
            if _proof()(matrix, lower, upper, offsets, x, zeta, tolerance, rank_tolerance):
                return ""
        except (ValueError, np.linalg.LinAlgError):  # numba's SVD meets an overflow: no proof
            pass
    from hqp_rp.core.certificate import certify

    try:
        with np.errstate(all="ignore"):
            certificate = certify(problem, x, secondary, tolerance, rank_tolerance=rank_tolerance)
    except (ValueError, np.linalg.LinAlgError):
        return "The answer could not be verified: its residuals overflow."
    return "" if certificate.ok else certificate.sentence


@functools.cache
def _proof() -> Callable[..., bool]:
    """The compiled proof, imported when first needed."""
    from hqp_rp.core.kernels.verify import proven_optimal

    return proven_optimal


def hard_excess(hard: Level | None, x: FloatArray) -> float:
    """The largest violation of a hard row at x (n,), relative to `||a_i|| ||x|| + |bound_i|`; 0 without hard rows."""
    if hard is None or not hard.m:
        return 0.0
    value = hard.A @ x
    bound = np.minimum(np.maximum(value, hard.lower), hard.upper)
    error = np.abs(value - bound)
    reach = row_norms(hard.A) * np.linalg.norm(x) + np.abs(bound)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.max(np.where(error > 0.0, error / reach, 0.0)))


def contradiction(hard: Level, x: FloatArray) -> str:
    """A sentence that names the hard rows in conflict when x (n,), near their least violation, proves that none meets them.

    The proof is Farkas': weights w on the rows violated at x, signed as their violations, with `A^T w = 0` and
    `w . bound < 0`, so that no y has `w . (A y - bound) <= 0`. They are the violations (rows at length one) less the part
    that rows can still reach. "" when that gives no proof, or one of less than a relative 1e-9.
    """
    lengths = row_norms(hard.A)
    outside = (lengths == 0.0) & ((hard.lower > 0.0) | (hard.upper < 0.0))
    if outside.any():
        i = int(outside.argmax())
        return f"Hard row {i} is a row of zeros that must be within [{hard.lower[i]:g}, {hard.upper[i]:g}]."
    rows = np.flatnonzero(lengths > 0.0)
    A = hard.A[rows] / lengths[rows, None]
    bounds = np.clip(A @ x, hard.lower[rows] / lengths[rows], hard.upper[rows] / lengths[rows])
    v = A @ x - bounds
    worst = float(np.abs(v).max(initial=0.0))
    if not worst > 1e-9 * (float(np.linalg.norm(x)) + float(np.abs(bounds).max(initial=0.0))):
        return ""
    chosen = np.abs(v) > 1e-4 * worst
    A, bounds, v, rows = A[chosen], bounds[chosen], v[chosen], rows[chosen]
    weights = v - A @ np.linalg.lstsq(A, v, rcond=1e-12)[0]
    if (weights * v < 0.0).any() or not np.abs(weights).max() > 0.0:
        return ""
    margin = -float(weights @ bounds)
    rounding = 1e-12 * (
        float(np.abs(weights) @ np.abs(bounds)) + float(np.linalg.norm(weights)) * float(np.linalg.norm(x))
    )
    if not margin > rounding:
        return ""
    named = ", ".join(str(int(i)) for i in rows[:8]) + (", ..." if len(rows) > 8 else "")
    return (
        f"Hard rows {named} contradict each other: the x of least violation still misses by "
        f"{float(np.abs(v * lengths[rows]).max()):.3g}. Loosen these rows, or move them to a level."
    )
