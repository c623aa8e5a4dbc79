"""The exact answers of the set, and a sentence on how each was found and proven."""

from __future__ import annotations

import dataclasses

import numpy as np

from hqp_rp.core.damping import ConstantDamping
from hqp_rp.core.distance import relative_distance
from hqp_rp.core.errors import ProblemError
from hqp_rp.core.problem import Problem
from hqp_rp.core.solver import RANK_TOLERANCE, get_solver
from hqp_rp.core.truth import SAME, Truth, truths

SEARCHED = 7
"""Up to this many unknowns the active set of an inequality problem is searched for in rational arithmetic from nothing."""


@dataclasses.dataclass(frozen=True, slots=True)
class Answer:
    """The exact answer, the answer by the library's rank rule where it differs (else None), and how both were found."""

    exact: Truth
    rule: Truth | None
    proof: str


def exact_answer(problem: Problem) -> Answer:
    """The lexicographic least-norm optimum of `problem`, known exactly, and by the library's rank rule where it differs."""
    if problem.damping is not None:
        return Answer(
            damped_answer(problem), None, "Solved in exact rational arithmetic, level by level with its damping."
        )
    if problem.is_equality and (problem.hard is None or not problem.hard.m):
        exact, rule = truths(problem, None, RANK_TOLERANCE)
        return Answer(exact, rule if exact.ambiguous else None, "Solved in exact rational arithmetic.")
    guess = None
    if problem.n > SEARCHED:
        guess = get_solver("hierarchical_active_set", warm_start=False).solve(problem).x
    exact, rule = truths(problem, None, RANK_TOLERANCE, start=guess)
    if exact.x is None:
        how = "Proven in exact rational arithmetic: the least violation of the hard rows is not zero."
    elif guess is None:
        how = "Solved by an active-set search in exact rational arithmetic, whose last step proves optimality."
    else:
        how = "Active rows guessed in double precision; optimality proven in rational arithmetic."
    if rule is not None and (exact.x is None or rule.x is None or relative_distance(rule.x, exact.x) <= SAME):
        rule = None  # the ranks are a matter of opinion, the answer is not
    if rule is not None:
        how += f" The rank rule's answer: {rule.method}, accepted by the certificate."
    return Answer(exact, rule, how)


def damped_answer(problem: Problem) -> Truth:
    """The answer of equalities with `ConstantDamping` on some levels, without a rounding before the last.

    Level k with damping eta picks the one x of the freedom left that minimizes ||A_k x - b_k||^2 + eta^2 ||x||^2; the levels
    after it keep A_k x. `hqp_rp.truth` rounds what a level reached; here it stays rational.

    Raises:
        ProblemError: inequality rows, hard rows, a metric, or another damping.
    """
    from hqp_rp.core.truth_exact import AffineSet, Rows, Unit, exact_norm

    plain = problem.is_equality and problem.hard is None and problem.metric is None
    if not plain or not all(isinstance(one, ConstantDamping | None) for one in problem.damping or ()):
        raise ProblemError(
            f"{problem!r}: exact answers of damped problems are for equalities with ConstantDamping, without hard rows and "
            "metric; take hqp_rp.truth."
        )
    n, levels = problem.n, list(problem.levels)
    beside = [
        (
            np.vstack((level.A, level.damping.factor * np.eye(n))),  # type: ignore[union-attr]
            np.concatenate((level.lower, np.zeros(n))),
        )
        if level.damping is not None
        else (level.A, level.lower)
        for level in levels
    ]
    unit = Unit.fitting([*beside, *((level.A, level.lower) for level in levels)], np.zeros(n))
    origin, optima, ranks = unit.vector(np.zeros(n)), AffineSet(n), []
    for level, (A, b) in zip(levels, beside, strict=True):
        rows = unit.rows(level.A, level.lower)
        if level.damping is not None:
            least = optima.copy()
            least.minimize(unit.rows(A, b))
            reached = least.nearest(origin)
            rows = Rows(rows.matrix, rows.matrix * reached.column, reached.denominator)
        ranks.append(optima.minimize(rows))
    u = optima.nearest(origin)
    residuals = np.array([exact_norm(level.A, level.lower, u, unit) for level in levels])
    return Truth(unit.floats(u), residuals, tuple(ranks), False, "", "exact rational arithmetic")
