"""What is said first of scenarios with limits."""

from __future__ import annotations

from collections.abc import Sequence

from hqp_rp.compare.limits.cases import LimitCase
from hqp_rp.compare.report.opening import advised
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number
from hqp_rp.core.words import listing

say = Sentences(__file__)


def limits_advice(limits: Sequence[LimitCase]) -> list[tuple[str, str]]:
    """(need, which solver), of cases that measure violations of limits."""
    told = [case for case in limits if case.told and case.answered]
    took: dict[str, list[bool]] = {}
    open_room: dict[str, bool] = {}
    for case in told:
        for own in case.answered:
            took.setdefault(own.label, []).append(own.kept)
            open_room[own.label] = open_room.get(own.label, False) or own.wasteful
    kept = [label for label, held in took.items() if all(held) and len(held) == len(told)]
    full = [label for label in kept if not open_room[label]]
    advice = [(say("need_all"), advised(full))]
    if len(kept) > len(full):
        advice.append((say("need_limits"), listing([label for label in kept if label not in full])))
    broke = [label for label, held in took.items() if not all(held)]
    if broke:
        advice.append((say("need_another"), listing(broke)))
    return advice


def limits_numbers(limits: Sequence[LimitCase]) -> list[tuple[str, str]]:
    """(number, what it is): the largest violation, and the peaks of a step's change."""
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
        most, unit, kind, label = worst
        found.append((f"{number(most)} {unit}", say("figure_violation", kind=kind, label=label)))
    changes = [(o.changes[2], o.label) for case in limits for o in case.answered if o.changes is not None]
    if changes:
        for pick in (max, min):
            value, label = pick(changes)
            found.append((f"{number(value)} rad/s", say("figure_change", largest=pick is max, label=label)))
    return found
