"""What rounding may leave of an answer that should be zero, which no judge may hold against it."""

from __future__ import annotations

import numpy as np

from hqp_rp.core.diagnostics import norm, normalised, row_norms, two_norm, violation
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.tolerances import ACTIVE, NEAR_ZERO, PULLS_CANCEL, RANK

_EPS = float(np.finfo(np.float64).eps)


def rounding_at_zero(problem: Problem, x: FloatArray) -> FloatArray:
    """(n, r) what rounding may leave of an x (n,) that should be zero: orthogonal directions, of that length in the unit of x;
    r = 0 where x is not that short.

    Along the directions that a level determines that is 8 eps times the size that its bounds ask of x, the largest
    |bound_i| / ||a_i|| of a row that is an equality or violated; x must be shorter than 1e-12 of that size. Where a level's
    rows pull in vain, against rows that are kept, it is that along every direction, unless a row is met at a bound that is not
    zero: that one tells the size of x.
    """
    levels = [level for level in (problem.hard, *problem.levels) if level is not None and level.m]
    asked = [_asked_by(level, x) for level in levels]
    own, largest = norm(x), max(asked, default=0.0)
    found = np.zeros((problem.n, 0))
    if largest == 0.0 or not own <= NEAR_ZERO * largest:
        return found
    sized = any(_met_away_from_zero(level, x) for level in levels)
    Z = np.eye(problem.n)
    for level, ask in zip(levels, asked, strict=True):
        error = violation(level, x)
        with np.errstate(all="ignore"):
            chosen = (level.lower == level.upper) | (np.abs(error) > 8.0 * _EPS * largest * row_norms(level.A))
        if not chosen.any():
            continue
        A, exponent = normalised(level.A[chosen])
        v = np.ldexp(error[chosen], -exponent)
        B = A @ Z
        rank, Vt = 0, np.eye(Z.shape[1])
        if Z.shape[1]:
            _, sigma, Vt = np.linalg.svd(B)
            rank = int((sigma > RANK * two_norm(A)).sum())
        with np.errstate(all="ignore"):
            cancel = rank > 0 and norm(v @ B) <= PULLS_CANCEL * float(np.abs(v) @ row_norms(A))
        if own <= NEAR_ZERO * ask and (cancel or not sized):
            along = Z @ Vt[:rank].T if cancel else np.eye(problem.n)
            found = np.hstack((found, 8.0 * _EPS * ask * along))
        Z = Z @ Vt[rank:].T
    return found


def _met_away_from_zero(level: Level, x: FloatArray) -> bool:
    with np.errstate(all="ignore"):
        value = level.A @ x
        at_lower = np.abs(value - level.lower) <= ACTIVE * np.abs(level.lower)
        at_upper = np.abs(value - level.upper) <= ACTIVE * np.abs(level.upper)
        finite = np.isfinite(level.lower), np.isfinite(level.upper)
        return bool(((value != 0.0) & (at_lower & finite[0] | at_upper & finite[1])).any())


def _asked_by(level: Level, x: FloatArray) -> float:
    """The largest |bound_i| / ||a_i|| of the level's equalities and violated rows."""
    with np.errstate(all="ignore"):
        lengths = row_norms(level.A)
        value = level.A @ x
        target = np.clip(value, level.lower, level.upper)
        bound = (level.lower == level.upper) | (target != value)
        ask = np.abs(target[bound]) / lengths[bound]
        return float(ask[np.isfinite(ask)].max(initial=0.0))
