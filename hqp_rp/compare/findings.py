"""The answer in sentences, computed from the data: nothing here knows how a comparison should end."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.report import listing, number, share
from hqp_rp.compare.study import BOUNDED, CLEAR, KEPT, PARTING, Case, Outcome
from hqp_rp.core.damping import NoDamping


def answer(cases: Sequence[Case]) -> tuple[str, ...]:
    """The question's answer in a few sentences, over all cases."""
    measured = [case for case in cases if any(outcome.distance is not None for outcome in case.outcomes)]
    if not measured:
        return ("No solver returned an answer that could be measured.",)
    sentences = [_closest(measured), _both(measured), *_lost(measured), _honesty(measured)]
    return tuple(sentence for sentence in sentences if sentence)


def _everywhere(cases: Sequence[Case], holds: Callable[[Case, Outcome], bool]) -> list[str]:
    """The labels for which something holds in every case."""
    by_label: dict[str, bool] = {}
    for case in cases:
        for outcome in case.outcomes:
            by_label[outcome.label] = by_label.get(outcome.label, True) and holds(case, outcome)
    return [label for label, held in by_label.items() if held]


def _closest(cases: Sequence[Case]) -> str:
    def exact(case: Case, outcome: Outcome) -> bool:
        return outcome.clear_distance is not None and outcome.clear_distance <= PARTING

    found = _everywhere(cases, exact)
    if not found:
        return (
            f"Accuracy: no solver stayed within {number(PARTING)} of the lexicographic optimum in every case, even where "
            f"every sigma was at least {number(CLEAR)}."
        )
    return (
        f"Accuracy: {listing(found)} {_verb(found, 'stays', 'stay')} within {number(PARTING)} of the lexicographic optimum in "
        f"every case, at every distance of at least {number(CLEAR)} from the singularity."
    )


def _both(cases: Sequence[Case]) -> str:
    found = _everywhere(cases, lambda case, outcome: outcome.keeps(1) and case.bounded(outcome))
    if not found:
        return f"No solver kept level 1 and |x| within {BOUNDED:g} times what is needed far from the singularity in every case."
    return (
        f"Through the singularity: {listing(found)} {_verb(found, 'keeps', 'keep')} level 1 to rounding error and |x| within "
        f"{BOUNDED:g} times what is needed far from the singularity, in every case; what it costs is level 2."
    )


def _lost(cases: Sequence[Case]) -> list[str]:
    """Who loses level 1, worst first, with the figure."""
    worst: dict[str, float] = {}
    for case in cases:
        for outcome in case.outcomes:
            excess = outcome.excess[0] if outcome.excess else None
            if excess is not None and not outcome.keeps(1):
                worst[outcome.label] = max(worst.get(outcome.label, 0.0), excess)
    if not worst:
        return ["Level 1 was kept to rounding error by every solver that answered."]
    named = [f"{label} (by up to {number(value)})" for label, value in sorted(worst.items(), key=lambda item: -item[1])]
    return [f"Level 1 is lost somewhere by {listing(named)}, in the units of the tasks."]


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
    named = [f"{label} on {count} steps" for label, count in false.items()]
    return f"The certificate refuted SOLVED, from a method that claims to be lexicographic there, by {listing(named)}."


def case_sentences(case: Case) -> tuple[str, ...]:
    """What one case shows: who stays with the optimum how long, who keeps level 1, whose answer grows."""
    sentences = [
        *_order_of_leaving(case),
        _levels_kept(case),
        _growth(case),
    ]
    if case.ambiguous:
        sentences.append(f"On {share(case.ambiguous)} of the steps the rank itself is ambiguous; these are not counted.")
    return tuple(sentence for sentence in sentences if sentence)


def _order_of_leaving(case: Case) -> list[str]:
    seen = [outcome for outcome in case.outcomes if outcome.distance is not None]
    stayed = [outcome.label for outcome in seen if not outcome.parted]
    sentences = []
    if stayed:
        sentences.append(f"Never more than {number(PARTING)} from the optimum: {listing(stayed)}.")
    later = [outcome for outcome in seen if outcome.parts_at is not None]
    if case.scenario.log_abscissa and later:
        ordered = sorted(later, key=lambda outcome: outcome.parts_at or 0.0)
        first = max(outcome.parts_at or 0.0 for outcome in later)
        long = [f"{outcome.label} ({number(outcome.parts_at)})" for outcome in ordered if outcome.parts_at != first]
        at_once = [outcome.label for outcome in ordered if outcome.parts_at == first]
        if long:
            sentences.append(f"They leave the optimum at this distance, the last to leave first: {listing(long)}.")
        sentences.append(f"Away from it from {number(first)} on: {listing(at_once)}.")
    elif later:
        named = [
            f"{outcome.label} ({share(outcome.within)})" for outcome in sorted(later, key=lambda item: -(item.within or 0.0))
        ]
        sentences.append(f"Share of the steps within {number(PARTING)} of the optimum: {listing(named)}.")
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


def claims(cases: Sequence[Case]) -> tuple[str, ...]:
    """The paper's claims on reverse priority, each with whether it held, by case."""
    sentences = []
    for case in cases:
        if len(case.levels) >= 2:
            sentences += [f"{case.title[0].upper()}{case.title[1:]}: {sentence}" for sentence in _case_claims(case)]
    return tuple(sentences)


def _case_claims(case: Case) -> list[str]:
    plain = _one(case, is_reverse)
    classic = _one(case, is_null_space)
    found = []
    if plain is not None:
        found += [_same_answer(case, plain), _undisturbed(plain), _singularity_free(case, plain, classic)]
    found += _damped(case)
    return [sentence for sentence in found if sentence]


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


def _same_answer(case: Case, plain: Outcome) -> str:
    others = [
        outcome
        for outcome in case.outcomes
        if (is_null_space(outcome.contestant) or outcome.contestant.name == "qp_cascade")
        and outcome.clear_distance is not None
    ]
    if plain.clear_distance is None or not others:
        return ""
    near = f"where every sigma is at least {number(CLEAR)}"
    worst = max(outcome.clear_distance or 0.0 for outcome in others)
    together = f"{listing([outcome.label for outcome in others])} ({number(worst)} at most)"
    if plain.clear_distance <= PARTING:
        verb = "is" if worst <= PARTING else "is not always"
        return (
            f"reverse priority returns the lexicographic optimum (relative distance {number(plain.clear_distance)} at most, "
            f"{near}), and {verb} the same vector as the answers of {together}."
        )
    second = plain.excess[1] if len(plain.excess) > 1 else None
    return (
        f"reverse priority is not lexicographic: it is up to {number(plain.clear_distance)} |x*| away from the optimum {near}, "
        f"with up to {number(second)} of level 2's residual avoidable, where {together} reach it."
    )


def _undisturbed(plain: Outcome) -> str:
    held = plain.keeps(1)
    word = "holds" if held else "does not hold"
    return (
        f"that lower levels do not disturb level 1 {word} for undamped reverse priority (largest relative excess "
        f"{number(plain.relative_excess[0])}, allowed {number(KEPT)} beyond rounding)."
    )


def _singularity_free(case: Case, plain: Outcome, classic: Outcome | None) -> str:
    growth = case.growth(plain)
    if growth is None:
        return ""
    compared = ""
    if classic is not None and classic.x_max is not None:
        compared = f"; classical null-space priority grows to {number(case.growth(classic))} times"
    word = "holds" if case.bounded(plain) else "does not hold"
    return (
        f"that reverse priority is free of algorithmic singularities {word} without damping: |x| grows to {number(growth)} "
        f"times what is needed far from the singularity{compared}."
    )


def _damped(case: Case) -> list[str]:
    found = []
    for outcome in case.outcomes:
        solver = outcome.contestant.solver
        damped = outcome.contestant.name == "reverse_priority" and not is_reverse(outcome.contestant)
        if not damped or outcome.distance is None:
            continue
        place = "only the pseudo-inverse that gives T_k" if getattr(solver, "damp", "") == "t_k" else "every pseudo-inverse"
        kept = "keeps level 1" if outcome.keeps(1) else f"loses level 1 by up to {number(outcome.excess[0])}"
        bounded = "bounded" if case.bounded(outcome) else "not bounded"
        found.append(
            f"damping {place} ({getattr(solver, 'damping', '')!r}) {kept}; |x| is {bounded} "
            f"({number(case.growth(outcome))} times), and level 2's excess is up to "
            f"{number(outcome.excess[1] if len(outcome.excess) > 1 else None)}."
        )
    return found


def _verb(names: Sequence[str], one: str, many: str) -> str:
    return one if len(names) == 1 else many
