"""The answer in sentences, computed from the data: nothing here knows how a comparison should end."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

from hqp_rp.compare.comparison.record import ComparisonResult
from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.limits.findings import limits_answer
from hqp_rp.compare.measure.cases import BOUNDED, CLEAR, PARTING, Case, Outcome
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.core.damping import NoDamping

say = Sentences(__file__)


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
        return (say("nobody_answered"),)
    sentences = [
        say("exact", found=exact_everywhere(measured), within=PARTING, clear=CLEAR),
        say("safe", found=safe_everywhere(measured), times=BOUNDED),
        say("level_1_lost", found=losers_of_level_1(measured)),
        claims_summary(claims(measured)),
        say("honesty", refuted=_refuted(measured)),
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


def _refuted(cases: Sequence[Case]) -> list[tuple[str, int]]:
    """(label, steps) that were called SOLVED by a method which claims to be lexicographic, and refuted."""
    false: dict[str, int] = {}
    for case in cases:
        for outcome in case.outcomes:
            if outcome.false_claims:
                false[outcome.label] = false.get(outcome.label, 0) + outcome.false_claims
    return list(false.items())


def case_sentences(case: Case) -> tuple[str, ...]:
    """What one case shows: who stays with the optimum how long, who keeps level 1, whose answer grows."""
    sentences = [
        *_order_of_leaving(case),
        _levels_kept(case),
        _growth(case),
    ]
    if case.ambiguous:
        sentences.append(say("ambiguous", part=case.ambiguous))
    return tuple(sentence for sentence in sentences if sentence)


def _order_of_leaving(case: Case) -> list[str]:
    seen = [outcome for outcome in case.outcomes if outcome.distance is not None]
    stayed = [outcome.label for outcome in seen if not outcome.parted]
    left = [(outcome.label, outcome.parts_at) for outcome in seen if outcome.parts_at is not None]
    sentences = [say("never_left", found=stayed, within=PARTING)] if stayed else []
    if left and case.scenario.log_abscissa:
        sentences += _places_of_leaving(left)
    elif left:
        shares = [(outcome.label, outcome.within) for outcome in seen if outcome.parts_at is not None]
        shares.sort(key=lambda item: -(item[1] or 0.0))
        sentences.append(say("shares_within", found=shares, within=PARTING))
    return sentences


def _places_of_leaving(left: Sequence[tuple[str, float]]) -> list[str]:
    """Of (label, distance at which it leaves the optimum): who within ten times of the last, who before, who at once."""
    places = [place for _, place in left]
    last, first = min(places), max(places)
    long = [label for label, place in left if place <= 10.0 * last and place < first]
    between = [(label, place) for label, place in left if 10.0 * last < place < first]
    sentences = [say("left_last", found=long, last=last)] if long else []
    if between:
        sentences.append(say("left_before", found=sorted(between, key=lambda item: item[1])))
    at_once = [label for label, place in left if place == first]
    return [*sentences, say("left_first", found=at_once, first=first)]


def _levels_kept(case: Case) -> str:
    kept = [outcome.label for outcome in case.outcomes if outcome.keeps(1)]
    answered = [outcome for outcome in case.outcomes if outcome.distance is not None]
    return say("level_1_kept", found=kept, everyone=len(kept) == len(answered))


def _growth(case: Case) -> str:
    if not case.far_norm:
        return ""
    sizes = [(o.label, o.x_max) for o in case.outcomes if o.x_max is not None and not case.bounded(o)]
    return say("growth", grown=sorted(sizes, key=lambda item: -item[1]), times=BOUNDED, needed=case.far_norm)


@dataclasses.dataclass(frozen=True, slots=True)
class Verdict:
    """Whether one claim of the paper held in one case: `holds` in a word or two, `evidence` with the figures.

    `claim` is one of `SAME`, `UNDISTURBED`, `FREE`, `DAMPED`, which `claim_sentence` spells.
    """

    claim: str
    case: str
    holds: str
    evidence: str


SAME, UNDISTURBED, FREE, DAMPED = "same answer", "undisturbed", "singularity-free", "damped"


def claim_sentence(claim: str) -> str:
    """The claim in words."""
    return say("claim", which=claim)


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
    judged = []
    for claim in dict.fromkeys(verdict.claim for verdict in verdicts if verdict.claim != DAMPED):
        of_claim = [verdict for verdict in verdicts if verdict.claim == claim and verdict.holds != "-"]
        judged.append((claim, len(of_claim), [verdict.case for verdict in of_claim if verdict.holds == "yes"]))
    return say("claims_summary", claims=judged) if judged else ""


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
    holds = plain.clear_distance <= PARTING
    evidence = say(
        "same_answer",
        clear=CLEAR,
        distance=plain.clear_distance,
        others=max(others, default=None),
        avoidable=plain.excess[1] if not holds and len(plain.excess) > 1 else None,
    )
    return ("yes" if holds else "no"), evidence


def _undisturbed(case: Case, plain: Outcome) -> tuple[str, str] | None:
    evidence = say("undisturbed", excess=plain.excess[0], relative=plain.relative_excess[0])
    return ("yes" if plain.keeps(1) else "no"), evidence


def _singularity_free(case: Case, plain: Outcome) -> tuple[str, str] | None:
    growth, classic = case.growth(plain), _one(case, is_null_space)
    if growth is None:
        return None
    evidence = say("singularity_free", times=growth, null_space=None if classic is None else case.growth(classic))
    return ("yes" if case.bounded(plain) else "no"), evidence


def _damped(case: Case) -> list[tuple[str, str]]:
    found = []
    for outcome in case.outcomes:
        damped = outcome.contestant.name == "reverse_priority" and not is_reverse(outcome.contestant)
        if not damped or outcome.distance is None or not case.far_norm:
            continue
        holds = outcome.keeps(1) and case.bounded(outcome)
        level_1, level_2 = outcome.excess[:2]
        evidence = say("damped", label=outcome.label, level_1=level_1, level_2=level_2, times=case.growth(outcome))
        found.append(("yes" if holds else "no", evidence))
    return found
