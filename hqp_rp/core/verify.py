"""A verdict on an answer that a control loop can afford: a quick native proof first, the full certificate where it fails."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hqp_rp.core import _native
from hqp_rp.core.closed_form import zeros
from hqp_rp.core.diagnostics import norm, one_sided, row_norms
from hqp_rp.core.metric import in_metric
from hqp_rp.core.nonnegative import nonnegative_least_squares
from hqp_rp.core.problem import FloatArray, IntArray, Level, Problem
from hqp_rp.core.rounding import rounding_at_zero
from hqp_rp.core.row_names import hard_rows_in_words
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.tolerances import CONTRADICTION, FARKAS_REACH, FARKAS_ROUNDING, FARKAS_WEIGHT


def fault_of(
    problem: Problem,
    x: FloatArray,
    secondary: FloatArray | None,
    tolerance: float,
    *,
    tried: bool = False,
    rank_tolerance: float = RANK_TOLERANCE,
) -> str:
    """ "" when x (n,) is the lexicographic optimum of `problem` to the relative `tolerance`, else a sentence that says why not.

    The same verdict as `certify(problem, x, secondary, tolerance)`: a native upper bound of each level's excess accepts
    most answers in a few microseconds, and what it does not accept goes to `certify`.

    Args:
        problem, x, secondary, tolerance, rank_tolerance: as for `certify`; not checked.
        tried: the quick proof has been tried already, and has not succeeded.
    """
    if problem.metric is not None:
        turned = in_metric(problem)
        there = turned.root @ x
        free = turned.forth(secondary)
        return fault_of(turned.problem, there, free, tolerance, tried=tried, rank_tolerance=rank_tolerance)
    if not tried and problem.damping is None:
        zeta = zeros(problem.n) if secondary is None else secondary
        if _native.proven_optimal(problem, x, zeta, tolerance, rank_tolerance):
            return ""
    from hqp_rp.core.certificate import certify

    try:
        with np.errstate(all="ignore"):
            certificate = certify(problem, x, secondary, tolerance, rank_tolerance=rank_tolerance)
    except (ValueError, np.linalg.LinAlgError):
        return "The answer could not be verified: its residuals overflow."
    return "" if certificate.ok else certificate.sentence


def hard_excess(hard: Level | None, x: FloatArray, rounding: FloatArray | None = None) -> float:
    """The largest violation of a hard row at x (n,), relative to `||a_i|| ||x|| + |bound_i|`; 0 without hard rows.

    rounding: (n, r) of x, see `hqp_rp.core.rounding.rounding_at_zero`; what it explains counts as none.
    """
    if hard is None or not hard.m:
        return 0.0
    value = hard.A @ x
    bound = np.minimum(np.maximum(value, hard.lower), hard.upper)
    error = np.abs(value - bound)
    reach = row_norms(hard.A) * np.linalg.norm(x) + np.abs(bound)
    noise = 0.0 if rounding is None else row_norms(hard.A @ rounding)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.max(np.where(error > noise, error / reach, 0.0)))


def breaks_hard_rows(problem: Problem, x: FloatArray, tolerance: float) -> bool:
    """Whether x (n,) breaks a hard row by more than the relative tolerance; what is not a number does."""
    with np.errstate(all="ignore"):
        return not hard_excess(problem.hard, x, rounding_at_zero(problem, x)) <= tolerance


class Contradiction(NamedTuple):
    """Hard rows (k,) of which every x misses one by at least `gap` of its length, and at which bound: +1 upper, -1 lower.

    weights: (k,) > 0, of the proof: the weighted sum of the one-sided rows of length one is 0, that of their bounds negative.
    """

    rows: IntArray
    sides: IntArray
    weights: FloatArray
    gap: float


def contradiction(problem: Problem, x: FloatArray) -> str:
    """A sentence that names the hard rows in conflict where they provably are, else ""; see `proven_contradiction`.

    They are as few as still contradict each other, in the order of their numbers.
    """
    hard = problem.hard
    found = None if hard is None else proven_contradiction(hard, x)
    if hard is None or found is None:
        return ""
    if found.gap == math.inf:
        shown, i = hard_rows_in_words(problem, found.rows), int(found.rows[0])
        return f"{shown} is a row of zeros that must be within [{hard.lower[i]:g}, {hard.upper[i]:g}]."
    found = fewest_rows(hard, x, found)
    rows = sorted(set(found.rows.tolist()))
    shown = hard_rows_in_words(problem, rows)
    if len(rows) == 1:
        return f"{shown} cannot be met: every x misses it by at least {found.gap:.3g} of its length."
    return (
        f"{shown} contradict each other: every x misses one of them by at least {found.gap:.3g} of its length. "
        "`conflict` of the solution says what would help."
    )


def proven_contradiction(hard: Level, x: FloatArray) -> Contradiction | None:
    """Hard rows that provably contradict each other, or None; some of them may contradict each other without the rest.

    The proof is Farkas': weights w >= 0 on one-sided rows `g_i . y <= h_i` of length one with `G^T w = 0` and `h . w < 0`, so
    that no y meets them all. They are those of the least-distance problem, `min ||G^T w||^2 + (h . w + 1)^2` over w >= 0,
    whose residual is zero where the rows contradict each other and only there (Lawson and Hanson 1974, chapter 23). Bounds
    are measured from x (n,), which may be anything finite and makes the proof the sharper the nearer it is to meeting the
    rows; what rounding leaves of `G^T w` must not matter for any y within 1e3 of the size of the bounds around x, and the
    least distance by which every y misses must be more than a relative 1e-9 of it.
    """
    lengths = row_norms(hard.A)
    outside = (lengths == 0.0) & ((hard.lower > 0.0) | (hard.upper < 0.0))
    if outside.any():
        i = int(outside.argmax())
        return Contradiction(np.array([i]), np.array([1 if hard.upper[i] < 0.0 else -1]), np.ones(1), math.inf)
    if not np.isfinite(x).all():
        return None
    G, h, rows, sides = one_sided(hard.A, hard.lower, hard.upper)
    size = float(np.linalg.norm(x)) + float(np.abs(h).max(initial=0.0))
    with np.errstate(over="ignore", invalid="ignore"):
        h = h - G @ x
    near = np.isfinite(h)
    G, h, rows, sides = G[near], h[near], rows[near], sides[near]
    least = float(h.min(initial=0.0))
    if not least < 0.0 or not math.isfinite(size):  # x meets every row
        return None
    unit = -least  # bounds in units of the largest miss
    w, _ = nonnegative_least_squares(np.vstack((G.T, h / unit)), np.append(np.zeros(len(x)), -1.0))
    chosen = w > FARKAS_WEIGHT * w.max(initial=0.0)
    w = np.where(chosen, w, 0.0)
    left = float(np.linalg.norm(G.T @ w))
    margin = -float(h @ w)
    rounding = FARKAS_ROUNDING * (float(np.abs(h) @ w) + float(w.sum()) * size)
    if not margin > left * FARKAS_REACH * (size + unit) + rounding or not margin > CONTRADICTION * size * float(
        w.sum()
    ):
        return None
    return Contradiction(rows[chosen], sides[chosen], w[chosen], margin / float(w.sum()))


def fewest_rows(hard: Level, x: FloatArray, found: Contradiction) -> Contradiction:
    """As few of the rows found as still contradict each other: each is left out in turn, the lightest first.

    Of the rows that are left the weights are unique but for their scale, so that the gap is the least largest miss itself.

    Source: Chinneck and Dravnieks 1991, the deletion filter.
    """
    for row, side in np.stack((found.rows, found.sides), axis=1)[np.argsort(found.weights, kind="stable")]:
        others = (found.rows != row) | (found.sides != side)
        rows, sides = found.rows[others], found.sides[others]
        if len(rows) == len(found.rows) or not len(rows):  # gone with an earlier one, or alone
            continue
        lower = np.where(sides < 0, hard.lower[rows], -np.inf)
        upper = np.where(sides > 0, hard.upper[rows], np.inf)
        fewer = proven_contradiction(Level(hard.A[rows], lower, upper), x)
        if fewer is None:
            continue
        fewer = fewer._replace(rows=rows[fewer.rows])
        # What meets far away only is a proof of contradiction too, but not one of which a row may be left out.
        signed = fewer.sides * fewer.weights / row_norms(hard.A[fewer.rows])
        if norm(signed @ hard.A[fewer.rows]) <= FARKAS_WEIGHT * float(fewer.weights.sum()):
            found = fewer
    return found
