"""The exact answers of the set, and a sentence on how each was found and proven."""

from __future__ import annotations

import dataclasses

from hqp_rp.core.distance import relative_distance
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
