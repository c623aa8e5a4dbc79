"""What scenarios with limits show, in sentences computed from the data: nothing here knows who should win."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

from hqp_rp.compare.limits.cases import COUNTS, LimitCase, LimitOutcome, Violation
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number
from hqp_rp.core.solution import Status

say = Sentences(__file__)

NEAR = 0.02
"""RMS errors that differ by no more than this share are called equal."""


def limits_answer(cases: Sequence[LimitCase]) -> tuple[str, ...]:
    """The answer in a few sentences, over all cases."""
    told = [case for case in cases if case.told and case.answered]
    if not told:
        return (say("nobody_took_one"),)
    sentences = [
        _keepers(told),
        _breakers(told),
        _refusals(told),
        _stopped(told),
        _price(told),
        _untold(cases),
        say("honesty", refuted=_refuted(told)),
    ]
    return tuple(sentence for sentence in sentences if sentence)


def limit_sentences(case: LimitCase) -> tuple[str, ...]:
    """What one case shows."""
    if not case.answered:
        return (say("everyone_refused"),)
    sentences = [
        *_kept_here(case),
        _way_back(case),
        _not_solved(case),
        *_levels(case),
        _shaking(case),
        _room(case),
    ]
    return tuple(sentence for sentence in sentences if sentence)


def _keepers(cases: Sequence[LimitCase]) -> str:
    """In how many of the cases that it took each solver kept every limit."""
    took = _by_label(cases, lambda outcome: outcome.kept)
    groups: dict[tuple[int, int], list[str]] = {}
    for label, held in took.items():
        groups.setdefault((sum(held), len(held)), []).append(label)
    ordered = sorted(groups.items(), key=lambda item: (-item[0][0] / item[0][1], -item[0][1]))
    found = [(kept, taken, labels) for (kept, taken), labels in ordered]
    return say("keepers", cases=len(cases), groups=found, counts=COUNTS)


def _breakers(cases: Sequence[LimitCase]) -> str:
    broke: dict[tuple[str, str], list[tuple[LimitOutcome, Violation]]] = {}
    for case in cases:
        for outcome in case.answered:
            for violation in outcome.violations:
                if not violation.kept:
                    broke.setdefault((case.case.title, violation.kind), []).append((outcome, violation))
    return say("breakers", found=[(title, kind, _alike(who)) for (title, kind), who in broke.items()])


def _refusals(cases: Sequence[LimitCase]) -> str:
    took = {outcome.label for case in cases for outcome in case.answered}
    never = list(dict.fromkeys(o.label for case in cases for o in case.outcomes if o.label not in took))
    partly: dict[str, list[str]] = {}
    for case in cases:
        for outcome in case.outcomes:
            if outcome.label in took and outcome.outcome.refused:
                partly.setdefault(case.case.title, []).append(outcome.label)
    return say("refusals", always=never, sometimes=list(partly.items()))


def _stopped(cases: Sequence[LimitCase]) -> str:
    """Cases in which the hard rows contradicted each other, and what came of it."""
    found = []
    for case in cases:
        stopped = [o for o in case.answered if o.statuses.get(Status.INFEASIBLE.name)]
        if stopped:
            most = max(o.statuses[Status.INFEASIBLE.name] for o in stopped)
            worst = [_worst(o) for o in stopped if not o.kept]
            beyond = dataclasses.replace(worst[0], largest=max(v.largest for v in worst)) if worst else None
            found.append((case.case.title, most, [o.label for o in stopped], beyond))
    return say("contradictions", found=found) if found else ""


def _price(cases: Sequence[LimitCase]) -> str:
    """Who could have served a level better, over all cases."""
    worst: dict[str, tuple[float, str]] = {}
    clean: dict[str, bool] = {}
    honest: dict[str, bool] = {}
    for case in cases:
        for outcome in case.answered:
            clean[outcome.label] = clean.get(outcome.label, True) and not outcome.wasteful
            honest[outcome.label] = honest.get(outcome.label, True) and outcome.admitted
            for level in outcome.denied if outcome.wasteful else ():
                if level.open is not None and level.open > worst.get(outcome.label, (0.0, ""))[0]:
                    worst[outcome.label] = (level.open, level.name)
    exact = [label for label, held in clean.items() if held]
    wasteful = [(label, room, level, honest[label]) for label, (room, level) in worst.items()]
    return say("price", exact=exact, wasteful=sorted(wasteful, key=lambda item: -item[1]))


def _untold(cases: Sequence[LimitCase]) -> str:
    found = []
    for case in cases:
        broke = [outcome for outcome in case.answered if not outcome.kept]
        if broke and not case.told:
            found.append((len(broke), len(case.answered), case.case.title))
    return say("untold", found=found) if found else ""


def _refuted(cases: Sequence[LimitCase]) -> list[tuple[str, int]]:
    """(label, steps) that were called SOLVED by a method which claims to be lexicographic, and refuted."""
    false: dict[str, int] = {}
    for case in cases:
        for outcome in case.answered:
            if outcome.outcome.false_claims:
                false[outcome.label] = false.get(outcome.label, 0) + outcome.outcome.false_claims
    return list(false.items())


def _kept_here(case: LimitCase) -> list[str]:
    kept = [outcome.label for outcome in case.answered if outcome.kept]
    sentences = []
    if len(kept) == len(case.answered):
        return [say("everyone_kept")]
    if kept:
        sentences.append(say("kept", found=kept))
    for i, violation in enumerate(case.answered[0].violations):
        broke = [outcome for outcome in case.answered if not outcome.violations[i].kept]
        if broke:
            broke.sort(key=lambda outcome: -float(f"{outcome.violations[i].largest:.1e}"))  # ties stay in line
            who = _alike([(outcome, outcome.violations[i]) for outcome in broke])
            sentences.append(say("broken", kind=violation.kind, who=who))
    return sentences


def _way_back(case: LimitCase) -> str:
    started = [outcome for outcome in case.answered if outcome.outside]
    if not started:
        return ""
    never = [outcome.label for outcome in started if outcome.back is None]
    came = sorted({number(outcome.back) for outcome in started if outcome.back is not None}, key=float)
    seeds = max(outcome.outside for outcome in started)
    span = came if len(came) < 2 else [came[0], came[-1]]
    return say("way_back", seeds=seeds, span=span, never=never)


def _not_solved(case: LimitCase) -> str:
    found = []
    for status in Status:
        if status in (Status.SOLVED, Status.REFUSED):
            continue
        shares = [(o.label, o.statuses[status.name]) for o in case.answered if status.name in o.statuses]
        if shares:
            found.append((status.name, shares))
    return say("statuses", found=found) if found else ""


def _levels(case: LimitCase) -> list[str]:
    """For each task, who of those that kept every limit missed it least, and who most."""
    among = [outcome for outcome in case.answered if outcome.kept] or list(case.answered)
    keepers = any(outcome.kept for outcome in among)
    sentences = []
    for i, error in enumerate(among[0].errors):
        misses = {outcome.label: outcome.errors[i].rms for outcome in among}
        least, most = min(misses.values()), max(misses.values())
        task = {"task": error.name, "unit": error.unit, "keepers": keepers}
        if most <= (1.0 + NEAR) * least:
            sentences.append(say("missed_alike", least=least, **task))
            continue
        best = [label for label, rms in misses.items() if rms <= (1.0 + NEAR) * least]
        worst = [label for label, rms in misses.items() if rms >= most / (1.0 + NEAR)]
        sentences.append(say("missed", best=best, least=least, worst=worst, most=most, **task))
    return sentences


def _shaking(case: LimitCase) -> str:
    """Whose joint velocities changed least and most from one step to the next."""
    known = [(outcome.changes[1], outcome.label) for outcome in case.answered if outcome.changes is not None]
    if not known:
        return ""
    least, most = min(known)[0], max(known)[0]
    if most <= (1.0 + NEAR) * least:
        return say("changes_alike", most=most)
    calm = [label for value, label in known if value <= (1.0 + NEAR) * least]
    wild = [label for value, label in known if value >= most / (1.0 + NEAR)]
    return say("changes", calm=calm, least=least, wild=wild, most=most)


def _room(case: LimitCase) -> str:
    wasteful = [
        (outcome.label, [level for level in outcome.denied if level.left], outcome.admitted)
        for outcome in case.answered
        if outcome.wasteful
    ]
    return say("room", wasteful=wasteful, others=[o.label for o in case.answered if not o.wasteful])


def _by_label(cases: Sequence[LimitCase], holds: Callable[[LimitOutcome], bool]) -> dict[str, list[bool]]:
    """For each contestant, what held in the cases that it took."""
    found: dict[str, list[bool]] = {}
    for case in cases:
        for outcome in case.answered:
            found.setdefault(outcome.label, []).append(holds(outcome))
    return found


def _alike(who: Sequence[tuple[LimitOutcome, Violation]]) -> list[tuple[list[str], str, str, str]]:
    """(labels, largest, unit, s in violation) as printed, those of equal figures together."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for outcome, violation in who:
        figures = number(violation.largest), violation.unit, number(violation.time)
        groups.setdefault(figures, []).append(outcome.label)
    return [(labels, *figures) for figures, labels in groups.items()]


def _worst(outcome: LimitOutcome) -> Violation:
    """Its largest violation, beside the units: the last kind that was broken, which is distance where one is watched."""
    return [violation for violation in outcome.violations if not violation.kept][-1]
