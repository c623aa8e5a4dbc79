"""The exact answers of the set, with the proof made once more where the search is too long for rational arithmetic."""

from __future__ import annotations

import dataclasses

import numpy as np

from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.solver import RANK_TOLERANCE, get_solver
from hqp_rp.core.truth import Truth, truth
from hqp_rp.core.truth_active_set import IntegerRows, Region
from hqp_rp.core.truth_exact import AffineSet, RationalVector, Unit

SEARCHED = 7
"""Up to this many unknowns the active set of an inequality problem is searched for in rational arithmetic from nothing."""

_NEAR = 1e-9  # relative distance to a bound at which a guess counts as on it; a wrong guess costs time, never truth


@dataclasses.dataclass(frozen=True, slots=True)
class Answer:
    """The exact answer, the answer by the library's rank rule where it differs (else None), and how both were found."""

    exact: Truth
    rule: Truth | None
    proof: str


def exact_answer(problem: Problem) -> Answer:
    """The lexicographic least-norm optimum of `problem`, known exactly."""
    if problem.is_equality and (problem.hard is None or not problem.hard.m):
        exact = truth(problem)
        rule = truth(problem, rank_rule=RANK_TOLERANCE) if exact.ambiguous else None
        return Answer(exact, rule, "Solved in exact rational arithmetic.")
    if problem.n > SEARCHED:
        found = from_guess(problem)
        if found is not None:
            return Answer(
                found, None, "Active rows guessed in double precision; optimality proven in rational arithmetic."
            )
    exact = truth(problem)
    how = "Solved by an active-set search in exact rational arithmetic, whose last step proves optimality."
    if not exact.feasible:
        how = "Proven in exact rational arithmetic: the least violation of the hard rows is not zero."
    return Answer(exact, None, how)


def from_guess(problem: Problem) -> Truth | None:
    """The exact optimum of a problem with inequality or hard rows, from the active rows of a double-precision answer.

    The rows that bind at the guess, as equalities, have one lexicographic optimum u, found by elimination in rationals. The
    exact active-set method then starts at u: it stops there at once when multipliers of the right sign prove it optimal at
    every level, and goes on to the optimum when the guess was wrong. None where there is no guess or no feasible point.
    """
    x = get_solver("hierarchical_active_set", warm_start=False).solve(problem).x
    if x is None:
        return None
    hard = problem.hard if problem.hard is not None else Level(np.zeros((0, problem.n)), [], [])
    levels = [hard, *problem.levels]
    guessed = [_binding(level, x) for level in levels]
    unit = Unit.fitting([(level.A, _bounds(level)) for level in levels], np.zeros(problem.n))
    optima = AffineSet(problem.n)
    for A, b in guessed:
        optima.minimize(unit.rows(A, b))
    zero = RationalVector([0] * problem.n, 1)
    u = optima.nearest(zero)
    region = Region(problem.n)
    rows = [IntegerRows.of(level, unit) for level in levels]
    for k, level in enumerate(rows):
        u = region.minimize(level, u)
        if k == 0 and level.square(u):
            return None
    identity = [[int(i == j) for j in range(problem.n)] for i in range(problem.n)]
    u = region.minimize(IntegerRows(identity, [0] * problem.n, [0] * problem.n, 0), u)
    residuals = np.array([row.residual(u) for row in rows[1:]])
    # Ranks are those of the rows that bind: the equality problem of these rows has them, and whether they are clear.
    binding = Problem([Level.equality(level.A[on], np.zeros(len(on))) for level, on in _exactly(levels, rows, u)])
    ranks = truth(binding)
    method = "exact rational active set from a guess"
    return Truth(unit.floats(u), residuals, ranks.ranks[1:], ranks.ambiguous, ranks.reason, method)


def _exactly(levels: list[Level], rows: list[IntegerRows], u: RationalVector) -> list[tuple[Level, list[int]]]:
    return [(level, row.binding(u)) for level, row in zip(levels, rows, strict=True)]


def _binding(level: Level, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rows that are equalities, violated or at a bound at x, and the bounds they bind to."""
    value = level.A @ x
    near = _NEAR * (np.linalg.norm(level.A, axis=1) * np.linalg.norm(x) + np.abs(value))
    above, below = value >= level.upper - near, value <= level.lower + near
    chosen = above | below
    target = np.where(above, level.upper, level.lower)
    return level.A[chosen], target[chosen]


def _bounds(level: Level) -> FloatArray:
    bounds = np.concatenate([level.lower, level.upper])
    finite: FloatArray = bounds[np.isfinite(bounds)]
    return finite
