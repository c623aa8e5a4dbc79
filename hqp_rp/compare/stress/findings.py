"""The findings of a stress test in sentences, computed from its summary: nothing here knows how it should end."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from hqp_rp.compare.comparison.findings import (
    DAMPED,
    FREE,
    SAME,
    UNDISTURBED,
    Verdict,
    claims_summary,
    is_null_space,
    is_reverse,
)
from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.measure.cases import BOUNDED, CLEAR, KEPT, PARTING
from hqp_rp.compare.report.words import counted, listing, number, share
from hqp_rp.compare.stress.plan import KINDS, LIMITS, RANDOM
from hqp_rp.compare.stress.record import StressResult
from hqp_rp.compare.stress.summary import Case, Summary, largest, quantile, sigma_of_bins
from hqp_rp.core.diagnostics import Singularity
from hqp_rp.core.solution import Status

FAR_FROM = 0.03
"""What |x| is compared with: the largest |x*| on the paths where sigma is at least this."""


def answer(test: StressResult) -> tuple[str, ...]:
    """The whole in a few sentences."""
    summary = test.summary
    sentences = [
        test.plan.scene().held_at_rest(),
        _atlas(test),
        _anywhere(summary),
        *(_approach(summary, c) for c in range(len(summary.cases))),
    ]
    sentences += [_both(summary), _jumps(summary), _summary_of(claims(test)), _honesty(summary)]
    return tuple(sentence for sentence in sentences if sentence)


def _atlas(test: StressResult) -> str:
    plan = test.plan
    if not test.catalogue:
        return "The search found no singular configuration within the joint limits; every sample is drawn at random."
    approached = [(plan.places[i].level, plan.places[i].kind.name) for i in plan.order[: plan.paths]]
    counts = [
        f"{own} of {case.title}" for case in test.summary.cases if (own := approached.count((case.level, case.kind)))
    ]
    rest = len(test.catalogue) - len(plan.places)
    beyond = f" {rest} more cannot be approached within the joint limits." if rest else ""
    found, paths = counted(len(test.catalogue), "singular configuration"), counted(plan.paths, "path")
    verb = "leads" if plan.paths == 1 else "lead"
    return f"The search found {found}; {paths} {verb} to {listing(counts) or 'none of them'}.{beyond}"


def _anywhere(summary: Summary) -> str:
    kinds = [KINDS.index(kind) for kind in (RANDOM, LIMITS)]
    judged = int(summary.judged[kinds].sum())
    if not judged:
        return ""
    shares = summary.right[:, kinds].sum(axis=1) / judged
    always = [label for label, part in zip(summary.labels, shares, strict=True) if part == 1.0]
    mostly = [
        f"{label} {share(float(part))}" for label, part in zip(summary.labels, shares, strict=True) if 0.5 <= part < 1.0
    ]
    verb = "is" if len(always) < 2 else "are"
    words = f"At random and near the joint limits, {listing(always) or 'no solver'} {verb} within {number(PARTING)} of"
    words += f" the optimum in all of {judged} judged samples"
    return f"{words}; {listing(mostly)}." if mostly else f"{words}."


def leaves(summary: Summary, c: int, k: int) -> float | None:
    """The largest sigma at which contestant k's median distance exceeds `PARTING` in case c; nan for never, None unknown."""
    median = quantile(summary.along[c][summary.quantities.index("distance"), k], 0.5)
    if not np.isfinite(median).any():
        return None
    with np.errstate(invalid="ignore"):
        beyond = np.flatnonzero(median > PARTING)
    return float(sigma_of_bins()[beyond[0]]) if beyond.size else math.nan


def _approach(summary: Summary, c: int) -> str:
    found = [(label, leaves(summary, c, k)) for k, label in enumerate(summary.labels)]
    known = [(label, sigma) for label, sigma in found if sigma is not None]
    if not known:
        return ""
    never = [label for label, sigma in known if math.isnan(sigma)]
    late = sorted(((sigma, label) for label, sigma in known if not math.isnan(sigma) and sigma < 0.05))
    early = [label for label, sigma in known if not math.isnan(sigma) and sigma >= 0.05]
    parts = (
        [
            f"{listing(never)} never {'leaves' if len(never) == 1 else 'leave'} the optimum by more than {number(PARTING)}"
        ]
        if never
        else []
    )
    parts += [f"{label} leaves it at sigma = {number(sigma)}" for sigma, label in late]
    parts += [f"{listing(early)} {'is' if len(early) == 1 else 'are'} away from it on the whole path"] if early else []
    return f"Towards singularities of {summary.cases[c].title} (medians): {'; '.join(parts)}."


def far_norm(summary: Summary, c: int) -> float:
    """The largest |x*| of case c where sigma >= `FAR_FROM`."""
    return largest(summary.optimum[c, sigma_of_bins() >= FAR_FROM])


def growth(summary: Summary, c: int, k: int) -> float:
    """Largest |x| of contestant k on the paths of case c over `far_norm`; nan where not known."""
    base = far_norm(summary, c)
    return largest(summary.along[c][summary.quantities.index("x_norm"), k]) / base if base else math.nan


def level_error(summary: Summary, c: int, k: int, level: int, *, clear: bool = False) -> float:
    """Largest relative error of `level` (from 0) by contestant k on the paths of case c; `clear`: where sigma >= 1e-6."""
    counts = summary.along[c][level, k]
    return largest(counts[sigma_of_bins() >= CLEAR] if clear else counts)


def _both(summary: Summary) -> str:
    if not summary.cases:
        return ""
    sentences = []
    both = [c for c in range(len(summary.cases)) if far_norm(summary, c) > 0.0]
    alone = [c for c in range(len(summary.cases)) if c not in both]
    what = f"level 1 to a relative {number(KEPT)}"
    # Where no sample lies far from the singularity, there is nothing to compare |x| with.
    for cases, growing in ((both, True), (alone, False)):
        judged = [c for c in cases if any(not math.isnan(level_error(summary, c, k, 0)) for k in _every(summary))]
        if not judged:
            continue
        found = [
            label
            for k, label in enumerate(summary.labels)
            if all(_keeps(summary, c, k, 0) and (not growing or growth(summary, c, k) <= BOUNDED) for c in judged)
        ]
        where = (
            "on every path" if not alone or not both else f"towards {listing([summary.cases[c].title for c in judged])}"
        )
        full = (
            f"both {what} and |x| within {BOUNDED:g} times what is needed far from the singularity" if growing else what
        )
        verb = "keeps" if len(found) < 2 else "keep"
        sentences.append(f"{listing(found) or 'No solver'} {verb} {full}, {where}.")
        if not growing:
            sizes = [
                f"{label} {number(largest(np.stack([_norms(summary, c, k) for c in judged])))}"
                for k, label in enumerate(summary.labels)
                if label in found
            ]
            told = f"; the largest: {listing(sizes)}" if sizes else ""
            sentences.append(
                f"There |x| is compared with nothing, since no sample lies at sigma >= {FAR_FROM:g}{told}."
            )
    return " ".join(sentences)


def _every(summary: Summary) -> range:
    return range(len(summary.labels))


def _keeps(summary: Summary, c: int, k: int, level: int) -> bool:
    """Whether the contestant keeps the level where it was judged; a nan, nothing judged, is not against it."""
    error = level_error(summary, c, k, level)
    return math.isnan(error) or error <= KEPT


def _norms(summary: Summary, c: int, k: int) -> NDArray[np.int64]:
    return np.asarray(summary.along[c][summary.quantities.index("x_norm"), k])


def _jumps(summary: Summary) -> str:
    if not summary.cases:
        return ""
    parts, never = [], []
    for k, label in enumerate(summary.labels):
        jumps = summary.jumps[:, k].sum(axis=0)
        if jumps.sum() == 0:
            never.append(label)
            continue
        where = sigma_of_bins()[jumps > 0]
        first, last = number(float(where.max())), number(float(where.min()))
        often = counted(int(jumps.sum()), "time")
        parts.append(f"{label} {often}, at sigma {'= ' + first if first == last else f'from {first} to {last}'}")
    words = f"Jumps: {'; '.join(parts)}. " if parts else ""
    return words + (f"No jump on any path: {listing(never)}." if never else "")


def _honesty(summary: Summary) -> str:
    counts = [f"{count} {name}" for name, count in summary.references.items() if count]
    unclear = int(summary.ambiguous.sum())
    return f"Judged by: {listing(counts)}; in {unclear} samples the rank is a matter of opinion: they do not count."


def claims(test: StressResult) -> tuple[Verdict, ...]:
    """The paper's claims on reverse priority, each with whether it held towards each kind of singularity."""
    summary, found = test.summary, []
    if len(summary.levels) < 2:
        return ()
    for claim, judge in ((SAME, _same), (UNDISTURBED, _undisturbed), (FREE, _free)):
        for c, case in enumerate(summary.cases):
            if claim == FREE and case.kind == Singularity.KINEMATIC.name:
                continue  # the claim is about algorithmic singularities
            k = _first(test.plan.contestants, is_reverse)
            if k is not None and np.isfinite(level_error(summary, c, k, 0)):
                found.append(Verdict(claim, case.title, *judge(test, c, k)))
    for c, case in enumerate(summary.cases):
        found += [Verdict(DAMPED, case.title, *_damped(summary, c, k)) for k in _damped_reverse(test.plan.contestants)]
    return tuple(found)


def _same(test: StressResult, c: int, k: int) -> tuple[str, str]:
    summary = test.summary
    counts = summary.along[c][summary.quantities.index("distance")][:, sigma_of_bins() >= CLEAR]
    worst = largest(counts[k])
    middle = float(quantile(counts[k].sum(axis=0), 0.5))
    evidence = f"where sigma >= {number(CLEAR)}: distance {number(middle)} in the middle, {number(worst)} at worst"
    classic = _first(test.plan.contestants, is_null_space)
    if classic is not None:
        evidence += f"; null space at worst {number(largest(counts[classic]))}"
    return ("yes" if worst <= PARTING else "no"), evidence


def _undisturbed(test: StressResult, c: int, k: int) -> tuple[str, str]:
    error = level_error(test.summary, c, k, 0)
    return ("yes" if error <= KEPT else "no"), f"relative error of level 1 at most {number(error)}"


def _free(test: StressResult, c: int, k: int) -> tuple[str, str]:
    times = growth(test.summary, c, k)
    if math.isnan(times):
        return "-", f"not known: no sample lies at sigma >= {FAR_FROM:g}"
    evidence = f"|x| up to {number(times)} times the largest |x*| far from the singularity"
    classic = _first(test.plan.contestants, is_null_space)
    if classic is not None:
        evidence += f"; null space: {number(growth(test.summary, c, classic))} times"
    return ("yes" if times <= BOUNDED else "no"), evidence


def _damped(summary: Summary, c: int, k: int) -> tuple[str, str]:
    error, times = level_error(summary, c, k, 0), growth(summary, c, k)
    evidence = (
        f"{summary.labels[k]}: relative error of level 1 at most {number(error)}, of level 2 "
        f"{number(level_error(summary, c, k, 1))}, |x| up to {number(times)} times"
    )
    if math.isnan(error) or math.isnan(times):
        return "-", f"not known: no sample lies at sigma >= {FAR_FROM:g}"
    return ("yes" if error <= KEPT and times <= BOUNDED else "no"), evidence


def _summary_of(verdicts: Sequence[Verdict]) -> str:
    return claims_summary(verdicts)


def _first(contestants: Sequence[Contestant], kind: Callable[[Contestant], bool]) -> int | None:
    return next((k for k, contestant in enumerate(contestants) if kind(contestant)), None)


def _damped_reverse(contestants: Sequence[Contestant]) -> list[int]:
    return [
        k
        for k, contestant in enumerate(contestants)
        if contestant.name == "reverse_priority" and not is_reverse(contestant)
    ]


def case_sentences(summary: Summary, c: int) -> tuple[str, ...]:
    """What happened on the paths of case c, level by level and in size."""
    sentences = []
    for level, name in enumerate(summary.levels):
        errors = {label: level_error(summary, c, k, level) for k, label in enumerate(summary.labels)}
        if all(math.isnan(error) for error in errors.values()):
            sentences.append(f"{name}: no sample on these paths could be judged.")
            continue
        kept = [label for label, error in errors.items() if error <= KEPT]
        sentences.append(
            f"{name} is kept to a relative {number(KEPT)} on every path by {listing(kept) or 'no solver'}."
        )
    if not far_norm(summary, c) > 0.0:
        sentences.append(f"No sample lies at sigma >= {FAR_FROM:g}: |x| is compared with nothing.")
        return tuple(sentences)
    grown = [
        f"{label} ({number(growth(summary, c, k))} times)"
        for k, label in enumerate(summary.labels)
        if growth(summary, c, k) > BOUNDED
    ]
    base = number(far_norm(summary, c))
    sentences.append(
        f"|x| grows beyond {BOUNDED:g} times what is needed far from the singularity ({base}) with {listing(grown)}."
        if grown
        else f"|x| stays within {BOUNDED:g} times what is needed far from the singularity ({base}) with every solver."
    )
    return tuple(sentences)


def unsolved(summary: Summary) -> list[tuple[str, str, int]]:
    """(contestant, status, samples) of every status but SOLVED."""
    names = [status.name for status in Status]
    counts = summary.status.sum(axis=1)
    return [
        (label, name, int(counts[k, s]))
        for k, label in enumerate(summary.labels)
        for s, name in enumerate(names)
        if name != Status.SOLVED.name and counts[k, s]
    ]


def title_of(case: Case) -> str:
    """The case's title with a capital letter."""
    return f"{case.title[0].upper()}{case.title[1:]}"
