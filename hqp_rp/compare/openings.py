"""What a report says first: which solver to take for what, one picture, three numbers. All of it from the measured results.

Times are not among it: they differ from run to run, and stand in their own section.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hqp_rp.compare.findings import exact_everywhere, losers_of_level_1, safe_everywhere
from hqp_rp.compare.report import Opening, Section, listing, number
from hqp_rp.compare.stress_findings import growth, level_error
from hqp_rp.compare.stress_plan import KINDS, LIMITS, RANDOM
from hqp_rp.compare.study import BOUNDED, KEPT, PARTING

if TYPE_CHECKING:
    from hqp_rp.compare.comparison import Comparison
    from hqp_rp.compare.limits_study import LimitCase
    from hqp_rp.compare.stress import Stress

NOBODY = "no solver here: see the tables for who comes near"
_SHOWN = 3


def opening_of_comparison(comparison: Comparison, sections: Sequence[Section]) -> Opening:
    """Of a comparison; `sections` hold its charts."""
    cases, limits = comparison.without_limits, comparison.limits
    advice: list[tuple[str, str]] = []
    numbers: list[tuple[str, str]] = []
    if cases:
        exact, through = exact_everywhere(cases), safe_everywhere(cases)
        advice.append((f"The exact answer (within {number(PARTING)} of it away from singularities)", _names(exact)))
        advice.append(("A path through a singularity, level 1 exact and |x| bounded", _names(through)))
        lost = losers_of_level_1(cases)
        if lost:
            advice.append(("Avoid, where level 1 matters", _named(lost)))
            numbers.append(
                (number(lost[0][1]), f"the most that level 1 lost, by {lost[0][0]}, in the unit of the task")
            )
        grown = [(o, case) for case in cases for o in case.outcomes if o.x_max is not None and case.far_norm]
        if grown:
            worst, case = max(grown, key=lambda pair: (pair[0].x_max or 0.0) / (pair[1].far_norm or 1.0))
            times = (worst.x_max or 0.0) / (case.far_norm or 1.0)
            numbers.append(
                (f"{number(times)} times", f"|x| of {worst.label} over what is needed far from the singularity")
            )
        if exact:
            everybody = {outcome.label for case in cases for outcome in case.outcomes}
            numbers.append((f"{len(exact)} of {len(everybody)}", "solvers are exact in every case that they take"))
    if limits:
        advice += _of_limits(limits)
        if not numbers:
            numbers = _numbers_of_limits(limits)
    return Opening(tuple(advice), tuple(numbers[:3]), first_chart(sections))


def opening_of_stress(test: Stress, sections: Sequence[Section]) -> Opening:
    """Of a stress test; `sections` hold its charts."""
    summary = test.summary
    kinds = [KINDS.index(kind) for kind in (RANDOM, LIMITS)]
    judged = int(summary.judged[kinds].sum())
    advice: list[tuple[str, str]] = []
    numbers: list[tuple[str, str]] = []
    if judged:
        right = summary.right[:, kinds].sum(axis=1)
        exact = [label for k, label in enumerate(summary.labels) if right[k] == judged]
        advice.append(
            (f"Anywhere but near singularities (within {number(PARTING)} in all {judged} samples)", _names(exact))
        )
        numbers.append((f"{len(exact)} of {len(summary.labels)}", "solvers were right in all of these"))
    cases = range(len(summary.cases))
    if summary.cases:
        error = {
            label: max((e for c in cases if not math.isnan(e := level_error(summary, c, k, 0))), default=math.nan)
            for k, label in enumerate(summary.labels)
        }
        times = {
            label: max((g for c in cases if not math.isnan(g := growth(summary, c, k))), default=math.nan)
            for k, label in enumerate(summary.labels)
        }
        kept = [label for label in error if error[label] <= KEPT and times[label] <= BOUNDED]
        need = f"A path through a singularity, level 1 to {number(KEPT)} and |x| within {BOUNDED:g} times"
        if any(not math.isnan(value) for value in times.values()):
            advice.append((need, _names(kept)))
            label, most = max(times.items(), key=lambda item: -1.0 if math.isnan(item[1]) else item[1])
            numbers.append((f"{number(most)} times", f"|x| of {label} over what is needed far from the singularity"))
        lost = sorted(((label, e) for label, e in error.items() if e > KEPT), key=lambda item: -item[1])
        if lost:
            advice.append(("Avoid, where level 1 matters", _named(lost)))
            numbers.append((number(lost[0][1]), f"the largest relative error of level 1, by {lost[0][0]}"))
    return Opening(tuple(advice), tuple(numbers[:3]), first_chart(sections))


def first_chart(sections: Sequence[Section]) -> str:
    """The name of the first chart there is, "" for none."""
    for section in sections:
        if section.charts:
            return section.charts[0].name
        inner = first_chart(section.sections)
        if inner:
            return inner
    return ""


def _names(labels: Sequence[str]) -> str:
    return listing(labels) or NOBODY


def _named(found: Sequence[tuple[str, float]]) -> str:
    more = len(found) - _SHOWN
    names = listing([f"{label} ({number(value)})" for label, value in found[:_SHOWN]])
    return f"{names}{f' and {more} more' if more > 0 else ''}"


def _of_limits(limits: Sequence[LimitCase]) -> list[tuple[str, str]]:
    told = [case for case in limits if case.told and case.answered]
    took: dict[str, list[bool]] = {}
    open_room: dict[str, bool] = {}
    for case in told:
        for own in case.answered:
            took.setdefault(own.label, []).append(own.kept)
            open_room[own.label] = open_room.get(own.label, False) or own.wasteful
    kept = [label for label, held in took.items() if all(held) and len(held) == len(told)]
    full = [label for label in kept if not open_room[label]]
    advice = [("Limits kept at every step, and no level served less than they allow", _names(full))]
    if len(kept) > len(full):
        advice.append(("Limits kept, some level left short", listing([label for label in kept if label not in full])))
    broke = [label for label, held in took.items() if not all(held)]
    if broke:
        advice.append(("Broke a limit that was in the problem", listing(broke)))
    return advice


def _numbers_of_limits(limits: Sequence[LimitCase]) -> list[tuple[str, str]]:
    found = []
    worst = max(
        (
            (v.largest, v.unit, v.kind, o.label)
            for case in limits
            if case.told
            for o in case.answered
            for v in o.violations
        ),
        default=None,
    )
    if worst is not None and worst[0] > 0.0:
        found.append(
            (f"{number(worst[0])} {worst[1]}", f"the most by which a limit ({worst[2]}) was passed, by {worst[3]}")
        )
    changes = [(o.changes[2], o.label) for case in limits for o in case.answered if o.changes is not None]
    if changes:
        for pick, words in ((max, "largest"), (min, "smallest")):
            value, label = pick(changes)
            found.append(
                (f"{number(value)} rad/s", f"the {words} peak of a step's change of joint velocities, by {label}")
            )
    return found
