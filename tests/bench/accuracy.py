"""How accurate an entrant's answers are, judged from (problem, x) alone, so that speeds are compared at equal accuracy."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hqp_rp.core.certificate import certify
from hqp_rp.core.distance import distance
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.truth import Truth, truth

ACCEPTED = 1e-6
"""An entrant is compared when `certify` accepts every one of its answers at this relative tolerance."""

_DISTANT = 5  # instances of a family whose distance from the optimum is taken
_EXACT_UNKNOWNS = 10  # with inequalities, the exact optimum is computed up to this many unknowns


@dataclasses.dataclass(frozen=True, slots=True)
class Accuracy:
    """One entrant on one family.

    Attributes:
        asked, answered, certified: how many instances; how many got a finite x; how many of those `certify` accepts.
        error: the largest relative excess of a level, relative violation of a hard row, or relative deviation from least
            norm; nan without answers.
        distance: the largest `||x - x*|| / (1 + ||x*||)` on the first instances; nan where x* was not computed.
        fault: the first verdict that is not "optimal", or "".
    """

    asked: int
    answered: int
    certified: int
    error: float
    distance: float
    fault: str = ""

    @property
    def ok(self) -> bool:
        """Whether every answer was certified."""
        return self.certified == self.asked


References = Sequence[Truth | str | None]
"""For each instance: its truth, "auto" for a double-precision optimum, or None where no distance is taken."""


def references(problems: Sequence[Problem]) -> list[Truth | str | None]:
    """What distances are taken from, for the first instances."""
    found: list[Truth | str | None] = [None] * len(problems)
    for i, problem in enumerate(problems[:_DISTANT]):
        if problem.is_equality and problem.hard is None:
            found[i] = "auto" if problem.n <= 4 * _EXACT_UNKNOWNS else None
        elif problem.n <= _EXACT_UNKNOWNS:
            found[i] = truth(problem, np.zeros(problem.n), RANK_TOLERANCE)  # by the rank rule, as `distance` has it
    return found


def judge(
    problems: Sequence[Problem],
    calls: Sequence[Callable[[], Any]],
    answer: Callable[[Any], FloatArray | None],
    known: References,
) -> Accuracy:
    """Call once for each problem, in order, and certify what comes back."""
    error, far, fault = math.nan, math.nan, ""
    answered = certified = 0
    for i, (problem, call) in enumerate(zip(problems, calls, strict=True)):
        x = answer(call())
        if x is None or not np.isfinite(x).all():
            fault = fault or "There is no answer."
            continue
        answered += 1
        found = certify(problem, x, tolerance=ACCEPTED)
        certified += found.ok
        fault = fault or ("" if found.ok else found.sentence)
        worst = max(found.relative_excess, found.relative_hard_violation, found.relative_deviation)
        error = worst if math.isnan(error) else max(error, worst)
        reference = known[i]
        if reference is not None:
            off = distance(problem, x, reference=reference).value
            far = off if math.isnan(far) else max(far, off)
    return Accuracy(len(problems), answered, certified, error, far, fault)
