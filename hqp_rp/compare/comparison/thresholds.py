"""Which verdicts of a comparison hang on a threshold: each is made again with every threshold moved down and up."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

from hqp_rp.compare.measure.cases import BOUNDED, CLEAR, FAR, KEPT, MOVED, PARTING, Case, Outcome
from hqp_rp.compare.report.sentences import Sentences

say = Sentences(__file__)

KEEPS, BOUND, EXACT = "level 1 is kept", "|x| is bounded", "the answer is exact"
QUESTIONS = (KEEPS, BOUND, EXACT)
_FACTORS = (1.0 / MOVED, MOVED)


@dataclasses.dataclass(frozen=True, slots=True)
class Fragile:
    """One verdict that another choice of a threshold turns round.

    Attributes:
        question: one of `QUESTIONS`. case: its title. label: the contestant's. holds: the verdict as reported.
        threshold: the name of what was moved. value: what was measured; limit: what it was compared with.
    """

    question: str
    case: str
    label: str
    holds: bool
    threshold: str
    value: float
    limit: float


def fragile(cases: Sequence[Case]) -> tuple[Fragile, ...]:
    """Every verdict of these cases that changes when one of its thresholds is moved by `MOVED`."""
    return tuple(item for case in cases for outcome in case.outcomes for item in _of(case, outcome))


def _of(case: Case, outcome: Outcome) -> Iterator[Fragile]:
    kept = outcome.proven[0] if outcome.proven else None
    if kept is not None:
        yield from _moved(KEEPS, case, outcome, kept, KEPT, "KEPT")
    if outcome.x_max is not None and case.far_norm:
        yield from _moved(BOUND, case, outcome, outcome.x_max, BOUNDED * case.far_norm, "BOUNDED")
        holds = case.bounded(outcome)
        if any(far and (outcome.x_max <= BOUNDED * far) != holds for far in case.far_norm_moved):
            yield Fragile(BOUND, case.title, outcome.label, holds, "FAR", outcome.x_max, BOUNDED * case.far_norm)
    if outcome.clear_distance is not None:
        yield from _moved(EXACT, case, outcome, outcome.clear_distance, PARTING, "PARTING")
        holds = outcome.clear_distance <= PARTING
        if any(value is not None and (value <= PARTING) != holds for value in outcome.clear_distance_moved):
            yield Fragile(EXACT, case.title, outcome.label, holds, "CLEAR", outcome.clear_distance, PARTING)


def _moved(
    question: str, case: Case, outcome: Outcome, value: float, limit: float, threshold: str
) -> Iterator[Fragile]:
    holds = value <= limit
    if any((value <= factor * limit) != holds for factor in _FACTORS):
        yield Fragile(question, case.title, outcome.label, holds, threshold, value, limit)


def fragile_sentences(cases: Sequence[Case]) -> tuple[str, ...]:
    """What the thresholds are, and for each question and threshold who hangs on it."""
    stated = say("thresholds", kept=KEPT, bounded=BOUNDED, far=FAR, parting=PARTING, clear=CLEAR, moved=MOVED)
    groups: dict[tuple[str, bool, str], list[Fragile]] = {}
    for item in fragile(cases):
        groups.setdefault((item.question, item.holds, item.threshold), []).append(item)
    if not groups:
        return (stated, say("nothing_hangs"))
    return (
        stated,
        *(
            say("hangs", question=question, holds=holds, threshold=threshold, found=found)
            for (question, holds, threshold), found in groups.items()
        ),
    )
