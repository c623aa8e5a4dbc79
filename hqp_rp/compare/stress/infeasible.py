"""Samples whose hard rows contradict each other: how many, which limits against which, and one problem of each kind to keep."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from hqp_rp.compare.stress.plan import Plan, Samples
from hqp_rp.core.conflict import Conflict, conflict_of
from hqp_rp.core.problem import Problem
from hqp_rp.core.row_names import row_names

LOOKED_AT = 64
"""So many of the samples that a solver calls infeasible are asked which hard rows contradict each other."""

_KEPT = 8  # problems in the report's folder


@dataclasses.dataclass(frozen=True, slots=True)
class Contradiction:
    """Limits that contradict each other, those that weigh most first.

    Attributes:
        groups: names of the limits, or of rows where nobody named limits. count: in how many of the samples looked at.
        sample: number of the first of them. conflict: what contradicts each other there.
    """

    groups: tuple[str, ...]
    count: int
    sample: int
    conflict: Conflict


@dataclasses.dataclass(frozen=True, slots=True)
class Infeasibility:
    """What stands behind the status INFEASIBLE.

    Attributes:
        samples: how many samples some solver calls infeasible. looked_at: how many of them were asked why.
        found: what contradicts what, the most frequent first.
    """

    samples: int
    looked_at: int
    found: tuple[Contradiction, ...]

    @property
    def kept(self) -> tuple[Contradiction, ...]:
        """Those of which the report keeps a problem."""
        return self.found[:_KEPT]

    @property
    def proven(self) -> int:
        """In how many of those looked at a contradiction is proven."""
        return sum(item.count for item in self.found)


def infeasibility(plan: Plan, samples: int, numbers: Sequence[int]) -> Infeasibility | None:
    """What contradicts what; None where no sample is called infeasible.

    Args:
        plan: of the test. samples: how many samples a solver calls infeasible.
        numbers: of some of them, which are looked at, `LOOKED_AT` at most, evenly.
    """
    if not samples:
        return None
    chosen = sorted({numbers[len(numbers) * i // LOOKED_AT] for i in range(LOOKED_AT)})
    found: dict[frozenset[str], Contradiction] = {}
    for number, problem in problems_of(plan, chosen):
        conflict = conflict_of(problem, None)
        if conflict is None:
            continue
        names = row_names(problem)
        groups = tuple(dict.fromkeys(names[row].group or names[row].row for row in conflict.rows))
        known = found.get(frozenset(groups), Contradiction(groups, 0, number, conflict))
        found[frozenset(groups)] = dataclasses.replace(known, count=known.count + 1)
    ordered = sorted(found.values(), key=lambda item: (-item.count, item.sample))
    return Infeasibility(samples, len(chosen), tuple(ordered))


def problems_of(plan: Plan, numbers: Sequence[int]) -> list[tuple[int, Problem]]:
    """(number, problem) of these samples, made anew."""
    found = []
    for chunk in plan.chunks:
        own = [number for number in numbers if chunk.first <= number < chunk.first + chunk.count]
        if own:
            samples: Samples = plan.samples_of(chunk)
            found += [(number, samples.problems[number - chunk.first]) for number in own]
    return found
