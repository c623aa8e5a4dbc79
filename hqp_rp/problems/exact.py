"""The exact answers of the set, with the proof made once more where the search is too long for rational arithmetic."""

from __future__ import annotations

import dataclasses

import numpy as np

from hqp_rp.core.certificate import certify
from hqp_rp.core.distance import relative_distance
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.solver import RANK_TOLERANCE, get_solver
from hqp_rp.core.truth import Truth, truth
from hqp_rp.core.truth_active_set import IntegerRows, Region
from hqp_rp.core.truth_exact import AffineSet, RationalVector, Unit

SEARCHED = 7
"""Up to this many unknowns the active set of an inequality problem is searched for in rational arithmetic from nothing."""

_NEAR = 1e-9  # relative distance to a bound at which a guess counts as on it; a wrong guess costs time, never truth

_SAME = 1e-8  # relative distance of two answers that are one: both are exact but for rows guessed as binding, see _NEAR

_NOISE = (
    "Some rows are all but zero in the freedom that is left to them (below 1e-12 ||A_k||: rounding of the coefficients). In "
    "exact arithmetic they still decide; the rank rule leaves the decision to the levels after them."
)


@dataclasses.dataclass(frozen=True, slots=True)
class Answer:
    """The exact answer, the answer by the library's rank rule where it differs (else None), and how both were found."""

    exact: Truth
    rule: Truth | None
    proof: str


def exact_answer(problem: Problem) -> Answer:
    """The lexicographic least-norm optimum of `problem`, known exactly, and by the library's rank rule where it differs."""
    if problem.is_equality and (problem.hard is None or not problem.hard.m):
        exact = truth(problem)
        rule = truth(problem, rank_rule=RANK_TOLERANCE) if exact.ambiguous else None
        return Answer(exact, rule, "Solved in exact rational arithmetic.")
    guess = get_solver("hierarchical_active_set", warm_start=False).solve(problem).x
    found = None if guess is None or problem.n <= SEARCHED else from_guess(problem, guess)
    if found is not None:
        exact, how = found, "Active rows guessed in double precision; optimality proven in rational arithmetic."
    else:
        exact = truth(problem)
        how = "Solved by an active-set search in exact rational arithmetic, whose last step proves optimality."
    if exact.x is None:
        how = "Proven in exact rational arithmetic: the least violation of the hard rows is not zero."
        return Answer(exact, None, how)
    rule = None if guess is None else by_rule(problem, guess)
    if rule is None or rule.x is None or relative_distance(rule.x, exact.x) <= _SAME:
        return Answer(exact, None, how)
    exact = dataclasses.replace(exact, ambiguous=True, reason=_NOISE)
    return Answer(exact, rule, f"{how} The rank rule's answer: {rule.method}, accepted by the certificate.")


def by_rule(problem: Problem, guess: FloatArray) -> Truth | None:
    """The answer of a problem with inequality or hard rows where the rank rule cuts, in multi-precision.

    The rows that bind at the guess, as equalities, solved by the rule; None when `certify` does not accept that for the
    problem itself. It differs from the exact answer where a row is held, or released, by the rounding of its coefficients:
    ranks of the binding rows alone do not show that.
    """
    bound = [_binding(level, guess) for level in _levels(problem)]
    answer = truth(Problem([Level.equality(A, b) for A, b in bound]), rank_rule=RANK_TOLERANCE)
    if answer.x is None or not certify(problem, answer.x).ok:
        return None
    return dataclasses.replace(answer, residuals=answer.residuals[1:], ranks=answer.ranks[1:])


def from_guess(problem: Problem, guess: FloatArray) -> Truth | None:
    """The exact optimum of a problem with inequality or hard rows, from the rows that bind at a guess (n,).

    The rows that bind at the guess, as equalities, have one lexicographic optimum u, found by elimination in rationals. The
    exact active-set method then starts at u: it stops there at once when multipliers of the right sign prove it optimal at
    every level, and goes on to the optimum when the guess was wrong. None where no x meets the hard rows.
    """
    levels = _levels(problem)
    guessed = [_binding(level, guess) for level in levels]
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


def _levels(problem: Problem) -> list[Level]:
    """The hard rows, perhaps none, and the levels."""
    hard = problem.hard if problem.hard is not None else Level(np.zeros((0, problem.n)), [], [])
    return [hard, *problem.levels]


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
