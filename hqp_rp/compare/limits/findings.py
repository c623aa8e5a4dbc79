"""What scenarios with limits show, in sentences computed from the data: nothing here knows who should win."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hqp_rp.compare.limits.cases import COUNTS, LimitCase, LimitOutcome, Violation
from hqp_rp.compare.report.words import counted, listing, number, share
from hqp_rp.core.solution import Status

OPEN = (
    "The figure is the largest part of a level's residual that points where the limits reached and the levels before leave "
    "room, in the unit of its rates: 0 at the exact optimum only, and no less than what could have been avoided."
)
NEAR = 0.02
"""RMS errors that differ by no more than this share are called equal."""


def limits_answer(cases: Sequence[LimitCase]) -> tuple[str, ...]:
    """The answer in a few sentences, over all cases."""
    told = [case for case in cases if case.told and case.answered]
    if not told:
        return ("No solver took a problem with limits.",)
    sentences = [
        _keepers(told),
        _breakers(told),
        _refusals(told),
        _stopped(told),
        _price(told),
        _untold(cases),
        _honesty(told),
    ]
    return tuple(sentence for sentence in sentences if sentence)


def limit_sentences(case: LimitCase) -> tuple[str, ...]:
    """What one case shows."""
    if not case.answered:
        return ("Every solver refused this problem.",)
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
    parts = []
    for (kept, taken), labels in sorted(groups.items(), key=lambda item: (-item[0][0] / item[0][1], -item[0][1])):
        some = "all" if kept == taken else f"{kept} of" if kept else "none of"
        which = f"{some} {taken}" if taken == len(cases) else f"{some} the {taken} that they take"
        parts.append(f"in {which} by {listing(labels)}")
    return (
        f"Of {counted(len(cases), 'case')} whose problem holds the limits, all limits were kept, to {number(COUNTS)} at every "
        f"step, {'; '.join(parts)}."
    )


def _breakers(cases: Sequence[LimitCase]) -> str:
    broke: dict[tuple[str, str], list[tuple[LimitOutcome, Violation]]] = {}
    for case in cases:
        for outcome in case.answered:
            for violation in outcome.violations:
                if not violation.kept:
                    broke.setdefault((case.case.title, violation.kind), []).append((outcome, violation))
    if not broke:
        return "Nobody who took a problem with limits broke one."
    parts = [f"{title}: {kind} by {_broken(who)}" for (title, kind), who in broke.items()]
    return f"Limits broken although they were in the problem: {'; '.join(parts)}."


def _refusals(cases: Sequence[LimitCase]) -> str:
    took = {outcome.label for case in cases for outcome in case.answered}
    never = list(dict.fromkeys(o.label for case in cases for o in case.outcomes if o.label not in took))
    partly: dict[str, list[str]] = {}
    for case in cases:
        for outcome in case.outcomes:
            if outcome.label in took and outcome.outcome.refused:
                partly.setdefault(case.case.title, []).append(outcome.label)
    sentence = f"Refused every problem with limits, and say so: {listing(never)}." if never else ""
    more = "; ".join(f"{where} by {listing(who)}" for where, who in partly.items())
    return f"{sentence} Refused: {more}.".strip() if more else sentence


def _stopped(cases: Sequence[LimitCase]) -> str:
    """Cases in which the hard rows contradicted each other, and what came of it."""
    found = []
    for case in cases:
        stopped = [o for o in case.answered if o.statuses.get(Status.INFEASIBLE.name)]
        if stopped:
            most = max(o.statuses[Status.INFEASIBLE.name] for o in stopped)
            worst = [_worst(o) for o in stopped if not o.kept]
            found.append(
                f"in {case.case.title}, on up to {share(most)} of the steps of {listing([o.label for o in stopped])}"
                + (f"; the robot then brakes, and ends up to {number(max(v.largest for v in worst))} "
                   f"{worst[0].unit} beyond a {worst[0].kind} limit" if worst else "")
            )  # fmt: skip
    return f"Hard rows contradicted each other {'; '.join(found)}." if found else ""


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
    parts = []
    if exact:
        parts.append(f"every level was served as well as the limits and the levels before it allow by {listing(exact)}")
    if worst:
        ordered = sorted(worst.items(), key=lambda item: -item[1][0])
        named = [
            f"{label} ({number(value)}, {name}{', only on steps not called SOLVED' if honest[label] else ''})"
            for label, (value, name) in ordered
        ]
        parts.append(f"room was left unused by {listing(named)}")
    sentence = f"Price: {'; '.join(parts)}."
    return sentence + (f" {OPEN}" if worst else "")


def _untold(cases: Sequence[LimitCase]) -> str:
    free = [case for case in cases if not case.told and case.answered]
    parts = []
    for case in free:
        broke = [outcome for outcome in case.answered if not outcome.kept]
        if broke:
            parts.append(f"{len(broke)} of {len(case.answered)} in {case.case.title}")
    return f"Not told of the limits, these solvers broke some: {listing(parts)}." if parts else ""


def _honesty(cases: Sequence[LimitCase]) -> str:
    false: dict[str, int] = {}
    for case in cases:
        for outcome in case.answered:
            if outcome.outcome.false_claims:
                false[outcome.label] = false.get(outcome.label, 0) + outcome.outcome.false_claims
    if not false:
        return "The certificate refuted no SOLVED of a method that claims to be lexicographic."
    named = [f"{label} on {counted(count, 'step')}" for label, count in false.items()]
    return f"The certificate refuted SOLVED, from a method that claims to be lexicographic there, by {listing(named)}."


def _kept_here(case: LimitCase) -> list[str]:
    kept = [outcome.label for outcome in case.answered if outcome.kept]
    sentences = []
    if len(kept) == len(case.answered):
        return ["Every solver that took the problem kept every limit."]
    if kept:
        sentences.append(f"Kept every limit at every step: {listing(kept)}.")
    for i, violation in enumerate(case.answered[0].violations):
        broke = [outcome for outcome in case.answered if not outcome.violations[i].kept]
        if broke:
            broke.sort(key=lambda outcome: -float(f"{outcome.violations[i].largest:.1e}"))  # ties stay in line
            named = _broken([(outcome, outcome.violations[i]) for outcome in broke])
            sentences.append(f"{violation.kind.capitalize()} limits broken by {named}.")
    return sentences


def _way_back(case: LimitCase) -> str:
    started = [outcome for outcome in case.answered if outcome.outside]
    if not started:
        return ""
    never = [outcome.label for outcome in started if outcome.back is None]
    came = sorted({number(outcome.back) for outcome in started if outcome.back is not None}, key=float)
    seeds = max(outcome.outside for outcome in started)
    sentence = f"{seeds} of the seeds start outside a position limit."
    if came:
        span = came[0] if len(came) == 1 else f"{came[0]} to {came[-1]}"
        sentence += f" Those who come back are inside again after {span} s."
    return sentence + (f" Never back inside: {listing(never)}." if never else "")


def _not_solved(case: LimitCase) -> str:
    parts = []
    for status in Status:
        if status in (Status.SOLVED, Status.REFUSED):
            continue
        named = [
            f"{outcome.label} ({share(outcome.statuses[status.name])})"
            for outcome in case.answered
            if status.name in outcome.statuses
        ]
        if named:
            parts.append(f"{status.name} from {listing(named)}")
    return f"Other than SOLVED: {'; '.join(parts)}, of the steps." if parts else ""


def _levels(case: LimitCase) -> list[str]:
    """For each task, who of those that kept every limit missed it least, and who most."""
    among = [outcome for outcome in case.answered if outcome.kept] or list(case.answered)
    whose = "all solvers" if not any(outcome.kept for outcome in among) else "those who kept every limit"
    sentences = []
    for i, error in enumerate(among[0].errors):
        ordered = sorted(among, key=lambda outcome: outcome.errors[i].rms)
        least, most = ordered[0].errors[i].rms, ordered[-1].errors[i].rms
        if most <= (1.0 + NEAR) * least:
            sentences.append(
                f"{error.name.capitalize()}: {whose} missed it alike, by {number(least)} {error.unit} RMS."
            )
            continue
        best = [outcome.label for outcome in among if outcome.errors[i].rms <= (1.0 + NEAR) * least]
        worst = [outcome.label for outcome in among if outcome.errors[i].rms >= most / (1.0 + NEAR)]
        sentences.append(
            f"{error.name.capitalize()}: of {whose}, {listing(best)} missed it least ({number(least)} {error.unit} RMS), "
            f"{listing(worst)} most ({number(most)})."
        )
    return sentences


def _shaking(case: LimitCase) -> str:
    """Whose joint velocities changed least and most from one step to the next."""
    known = [(outcome.changes[1], outcome.label) for outcome in case.answered if outcome.changes is not None]
    if not known:
        return ""
    least, most = min(known)[0], max(known)[0]
    if most <= (1.0 + NEAR) * least:
        return f"Joint velocities change by up to {number(most)} rad/s in 99 % of the steps with everyone."
    calm = [label for value, label in known if value <= (1.0 + NEAR) * least]
    wild = [label for value, label in known if value >= most / (1.0 + NEAR)]
    return (
        f"In 99 % of the steps joint velocities change by no more than {number(least)} rad/s with {listing(calm)}, "
        f"{number(most)} with {listing(wild)}."
    )


def _room(case: LimitCase) -> str:
    wasteful = [outcome for outcome in case.answered if outcome.wasteful]
    if not wasteful:
        return "Every level was served as well as the limits and the levels before it allow, by everyone."
    named = []
    for outcome in wasteful:
        found = [f"{level.name} {number(level.open)}" for level in outcome.denied if level.left]
        admitted = "; only on steps not called SOLVED" if outcome.admitted else ""
        named.append(f"{outcome.label} ({', '.join(found)}{admitted})")
    others = [outcome.label for outcome in case.answered if not outcome.wasteful]
    sentence = f"Room left unused, the largest of any step: {listing(named)}."
    return sentence + (f" None beyond rounding: {listing(others)}." if others else "")


def _by_label(cases: Sequence[LimitCase], holds: Callable[[LimitOutcome], bool]) -> dict[str, list[bool]]:
    """For each contestant, what held in the cases that it took."""
    found: dict[str, list[bool]] = {}
    for case in cases:
        for outcome in case.answered:
            found.setdefault(outcome.label, []).append(holds(outcome))
    return found


def _broken(who: Sequence[tuple[LimitOutcome, Violation]]) -> str:
    """Names with their figures, those of equal figures together."""
    groups: dict[str, list[str]] = {}
    for outcome, violation in who:
        figures = f"{number(violation.largest)} {violation.unit}, for {number(violation.time)} s"
        groups.setdefault(figures, []).append(outcome.label)
    return "; ".join(f"{listing(labels)} ({figures})" for figures, labels in groups.items())


def _worst(outcome: LimitOutcome) -> Violation:
    """Its largest violation, beside the units: the last kind that was broken, which is distance where one is watched."""
    return [violation for violation in outcome.violations if not violation.kept][-1]
