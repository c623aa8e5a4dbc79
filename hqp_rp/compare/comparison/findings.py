"""The answer in sentences, computed from the data: nothing here knows how a comparison should end."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

from hqp_rp.compare.comparison.record import ComparisonResult
from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.limits.findings import limits_answer
from hqp_rp.compare.measure.cases import BOUNDED, CLEAR, PARTING, Case, Outcome
from hqp_rp.compare.report.words import counted, listing, number, share
from hqp_rp.core.damping import NoDamping


def answer_of_comparison(comparison: ComparisonResult) -> tuple[str, ...]:
    """The answer in a few sentences: first on singularities, then on limits, where scenarios of that kind were run."""
    others = comparison.without_limits
    return (
        *(answer(others) if others or not comparison.limits else ()),
        *(limits_answer(comparison.limits) if comparison.limits else ()),
    )


def answer(cases: Sequence[Case]) -> tuple[str, ...]:
    """The question's answer in a few sentences, over all cases."""
    measured = [case for case in cases if any(outcome.distance is not None for outcome in case.outcomes)]
    if not measured:
        return ("No solver returned an answer that could be measured.",)
    sentences = [
        _closest(measured),
        _both(measured),
        _lost(measured),
        claims_summary(claims(measured)),
        _honesty(measured),
    ]
    return tuple(sentence for sentence in sentences if sentence)


def _everywhere(cases: Sequence[Case], holds: Callable[[Case, Outcome], bool]) -> list[str]:
    """The labels for which something holds in every case that the solver takes."""
    by_label: dict[str, bool] = {}
    for case in cases:
        for outcome in case.outcomes:
            if outcome.refused:
                continue
            by_label[outcome.label] = by_label.get(outcome.label, True) and holds(case, outcome)
    return [label for label, held in by_label.items() if held]


def exact_everywhere(cases: Sequence[Case]) -> list[str]:
    """Within `PARTING` of the optimum wherever every sigma is at least `CLEAR`, in every case that they take."""

    def exact(case: Case, outcome: Outcome) -> bool:
        return outcome.clear_distance is not None and outcome.clear_distance <= PARTING

    return _everywhere(cases, exact)


def safe_everywhere(cases: Sequence[Case]) -> list[str]:
    """Level 1 kept and |x| bounded, in every case that they take."""
    return _everywhere(cases, lambda case, outcome: outcome.keeps(1) and case.bounded(outcome))


def losers_of_level_1(cases: Sequence[Case]) -> list[tuple[str, float]]:
    """(label, largest excess error), worst first, of those that lose level 1 somewhere."""
    worst: dict[str, float] = {}
    for case in cases:
        for outcome in case.outcomes:
            excess = outcome.excess[0] if outcome.excess else None
            if excess is not None and not outcome.keeps(1):
                worst[outcome.label] = max(worst.get(outcome.label, 0.0), excess)
    return sorted(worst.items(), key=lambda item: -item[1])


def _closest(cases: Sequence[Case]) -> str:
    found = exact_everywhere(cases)
    if not found:
        return (
            f"Accuracy: no solver stayed within {number(PARTING)} of the lexicographic optimum in every case, even where "
            f"every sigma was at least {number(CLEAR)}."
        )
    return (
        f"Accuracy: {listing(found)} {_verb(found, 'stays', 'stay')} within {number(PARTING)} of the lexicographic optimum "
        f"in every case {_verb(found, 'it takes', 'they take')}, at every distance of at least {number(CLEAR)} from the "
        "singularity."
    )


def _both(cases: Sequence[Case]) -> str:
    found = safe_everywhere(cases)
    if not found:
        return f"No solver kept level 1 and |x| within {BOUNDED:g} times what is needed far from the singularity in every case."
    return (
        f"Through the singularity: {listing(found)} {_verb(found, 'keeps', 'keep')} level 1 to rounding error and |x| "
        f"within {BOUNDED:g} times what is needed far from the singularity, in every case "
        f"{_verb(found, 'it takes', 'they take')}; what it costs is level 2."
    )


def _lost(cases: Sequence[Case]) -> str:
    """Who loses level 1, worst first, with the figure."""
    worst = losers_of_level_1(cases)
    if not worst:
        return "Level 1 was kept to rounding error by every solver that answered."
    named = [f"{label} ({number(value)})" for label, value in worst]
    return f"Level 1 is lost somewhere by {listing(named)}: the largest excess error, in the unit of the task."


def _honesty(cases: Sequence[Case]) -> str:
    false: dict[str, int] = {}
    for case in cases:
        for outcome in case.outcomes:
            if outcome.false_claims:
                false[outcome.label] = false.get(outcome.label, 0) + outcome.false_claims
    if not false:
        return (
            "Statuses were honest: the certificate confirmed every step that a method which claims to be lexicographic "
            "called SOLVED."
        )
    named = [f"{label} on {counted(count, 'step')}" for label, count in false.items()]
    return f"The certificate refuted SOLVED, from a method that claims to be lexicographic there, by {listing(named)}."


def case_sentences(case: Case) -> tuple[str, ...]:
    """What one case shows: who stays with the optimum how long, who keeps level 1, whose answer grows."""
    sentences = [
        *_order_of_leaving(case),
        _levels_kept(case),
        _growth(case),
    ]
    if case.ambiguous:
        sentences.append(
            f"On {share(case.ambiguous)} of the steps the rank itself is ambiguous; these are not counted."
        )
    return tuple(sentence for sentence in sentences if sentence)


def _order_of_leaving(case: Case) -> list[str]:
    seen = [outcome for outcome in case.outcomes if outcome.distance is not None]
    stayed = [outcome.label for outcome in seen if not outcome.parted]
    sentences = [f"Never more than {number(PARTING)} from the optimum: {listing(stayed)}."] if stayed else []
    left = [outcome for outcome in seen if outcome.parts_at is not None]
    if case.scenario.log_abscissa and left:
        places = sorted({outcome.parts_at or 0.0 for outcome in left})
        last, first = places[0], places[-1]
        long = [outcome for outcome in left if (outcome.parts_at or 0.0) <= 10.0 * last and outcome.parts_at != first]
        between = [outcome for outcome in left if outcome not in long and outcome.parts_at != first]
        at_once = [outcome.label for outcome in left if outcome.parts_at == first]
        if long:
            names = listing([outcome.label for outcome in long])
            sentences.append(
                f"Longest at the optimum, to distances of {number(last)} to {number(10.0 * last)}: {names}."
            )
        if between:
            ordered = sorted(between, key=lambda outcome: outcome.parts_at or 0.0)
            named = listing([f"{outcome.label} ({number(outcome.parts_at)})" for outcome in ordered])
            sentences.append(f"They leave it before: {named}.")
        sentences.append(f"Away from it from {number(first)} on: {listing(at_once)}.")
    elif left:
        ordered = sorted(left, key=lambda outcome: -(outcome.within or 0.0))
        named = listing([f"{outcome.label} ({share(outcome.within)})" for outcome in ordered])
        sentences.append(f"Share of the steps within {number(PARTING)} of the optimum: {named}.")
    return sentences


def _levels_kept(case: Case) -> str:
    kept = [outcome.label for outcome in case.outcomes if outcome.keeps(1)]
    if not kept:
        return "No solver kept level 1 to rounding error at every step."
    if len(kept) == len([outcome for outcome in case.outcomes if outcome.distance is not None]):
        return "Every solver kept level 1 to rounding error at every step."
    return f"Level 1 kept to rounding error at every step: {listing(kept)}."


def _growth(case: Case) -> str:
    grown = sorted(
        (outcome for outcome in case.outcomes if outcome.x_max is not None and not case.bounded(outcome)),
        key=lambda outcome: -(outcome.x_max or 0.0),
    )
    if not case.far_norm:
        return ""
    if not grown:
        return (
            f"|x| stayed within {BOUNDED:g} times what is needed far from the singularity ({number(case.far_norm)}) with "
            "every solver."
        )
    named = [f"{outcome.label} ({number(outcome.x_max)})" for outcome in grown]
    return (
        f"|x| grew beyond {BOUNDED:g} times what is needed far from the singularity ({number(case.far_norm)}) with "
        f"{listing(named)}."
    )


@dataclasses.dataclass(frozen=True, slots=True)
class Verdict:
    """Whether one claim of the paper held in one case: `holds` in a word or two, `evidence` with the figures."""

    claim: str
    case: str
    holds: str
    evidence: str


SAME = "Undamped, it gives the answer of task priority (the lexicographic optimum)"
UNDISTURBED = "Lower levels do not disturb level 1"
FREE = "It has no algorithmic singularity: |x| stays bounded without damping"
DAMPED = "Damped, it passes the singularity with level 1 exact"


def claims(cases: Sequence[Case]) -> tuple[Verdict, ...]:
    """The paper's claims on reverse priority, in the order claim by claim, each with whether it held in each case."""
    found: list[Verdict] = []
    for claim, judge in ((SAME, _same_answer), (UNDISTURBED, _undisturbed), (FREE, _singularity_free)):
        for case in cases:
            plain = _one(case, is_reverse)
            verdict = None if plain is None or len(case.levels) < 2 else judge(case, plain)
            if verdict is not None:
                found.append(Verdict(claim, case.title, *verdict))
    for case in cases:
        found += [Verdict(DAMPED, case.title, *verdict) for verdict in _damped(case)] if len(case.levels) >= 2 else []
    return tuple(found)


def claims_summary(verdicts: Sequence[Verdict]) -> str:
    """One sentence on the claims: in how many cases each held."""
    parts = []
    for claim in dict.fromkeys(verdict.claim for verdict in verdicts if verdict.claim != DAMPED):
        of_claim = [verdict for verdict in verdicts if verdict.claim == claim and verdict.holds != "-"]
        held = [verdict for verdict in of_claim if verdict.holds == "yes"]
        words = f"{claim[0].lower()}{claim[1:]}"
        if not of_claim:
            parts.append(f"'{words}' could not be judged")
        elif len(held) == len(of_claim):
            parts.append(f"'{words}' holds in every case")
        elif held:
            parts.append(f"'{words}' holds in {len(held)} of {len(of_claim)} cases ({'; '.join(v.case for v in held)})")
        else:
            parts.append(f"'{words}' holds in no case")
    return f"Of what the paper claims for reverse priority, {listing(parts)}." if parts else ""


def is_reverse(contestant: Contestant) -> bool:
    """Reverse priority as the paper has it, undamped."""
    return contestant.name == "reverse_priority" and isinstance(getattr(contestant.solver, "damping", None), NoDamping)


def is_null_space(contestant: Contestant) -> bool:
    """Classical priority in its stable form, undamped."""
    solver = contestant.solver
    return (
        contestant.name == "null_space"
        and isinstance(getattr(solver, "damping", None), NoDamping)
        and getattr(solver, "variant", "") == "basis"
    )


def _one(case: Case, kind: Callable[[Contestant], bool]) -> Outcome | None:
    found = [outcome for outcome in case.outcomes if kind(outcome.contestant) and outcome.distance is not None]
    return found[0] if found else None


def _same_answer(case: Case, plain: Outcome) -> tuple[str, str] | None:
    others = [
        outcome.clear_distance
        for outcome in case.outcomes
        if (is_null_space(outcome.contestant) or outcome.contestant.name == "qp_cascade")
        and outcome.clear_distance is not None
    ]
    if plain.clear_distance is None:
        return None
    evidence = f"where sigma >= {number(CLEAR)} it is at most {number(plain.clear_distance)} |x*| from the optimum"
    if others:
        evidence += f", null space and QP cascades at most {number(max(others))}"
    if plain.clear_distance > PARTING and len(plain.excess) > 1:
        evidence += f"; up to {number(plain.excess[1])} of level 2's residual could be avoided"
    return ("yes" if plain.clear_distance <= PARTING else "no"), evidence


def _undisturbed(case: Case, plain: Outcome) -> tuple[str, str] | None:
    evidence = f"excess of level 1 at most {number(plain.excess[0])} (relative {number(plain.relative_excess[0])})"
    return ("yes" if plain.keeps(1) else "no"), evidence


def _singularity_free(case: Case, plain: Outcome) -> tuple[str, str] | None:
    growth, classic = case.growth(plain), _one(case, is_null_space)
    if growth is None:
        return None
    evidence = f"|x| at most {number(growth)} times the largest |x*| far from the singularity"
    if classic is not None:
        evidence += f"; null space: {number(case.growth(classic))} times"
    return ("yes" if case.bounded(plain) else "no"), evidence


def _damped(case: Case) -> list[tuple[str, str]]:
    found = []
    for outcome in case.outcomes:
        damped = outcome.contestant.name == "reverse_priority" and not is_reverse(outcome.contestant)
        if not damped or outcome.distance is None or not case.far_norm:
            continue
        holds = outcome.keeps(1) and case.bounded(outcome)
        evidence = (
            f"{outcome.label}: excess of level 1 at most {number(outcome.excess[0])}, of level 2 "
            f"{number(outcome.excess[1])}, |x| {number(case.growth(outcome))} times"
        )
        found.append(("yes" if holds else "no", evidence))
    return found


def _verb(names: Sequence[str], one: str, many: str) -> str:
    return one if len(names) == 1 else many
