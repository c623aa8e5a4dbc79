"""The findings of a stress test in sentences, computed from its summary: nothing here knows how it should end."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

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
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.stress.plan import KINDS, LIMITS, RANDOM
from hqp_rp.compare.stress.record import StressResult
from hqp_rp.compare.stress.summary import Case, Summary, largest, quantile, sigma_of_bins
from hqp_rp.core.diagnostics import Singularity
from hqp_rp.core.solution import Status

say = Sentences(__file__)

FAR_FROM = 0.03
"""What |x| is compared with: the largest |x*| on the paths where sigma is at least this."""
EARLY = 0.05
"""Who has left the optimum where sigma is at least this was never at it."""


def answer(test: StressResult) -> tuple[str, ...]:
    """The whole in a few sentences."""
    summary = test.summary
    sentences = [
        test.plan.scene().held_at_rest(),
        _atlas(test),
        _anywhere(summary),
        *(_approach(summary, c) for c in range(len(summary.cases))),
    ]
    sentences += [_both(summary), _jumps(summary), claims_summary(claims(test)), _honesty(summary)]
    return tuple(sentence for sentence in sentences if sentence)


def _atlas(test: StressResult) -> str:
    plan = test.plan
    if not test.catalogue:
        return say("no_atlas")
    approached = [(plan.places[i].level, plan.places[i].kind.name) for i in plan.order[: plan.paths]]
    leads = [(approached.count((case.level, case.kind)), case.title) for case in test.summary.cases]
    return say(
        "atlas",
        found=len(test.catalogue),
        paths=plan.paths,
        leads=[(count, title) for count, title in leads if count],
        beyond=len(test.catalogue) - len(plan.places),
    )


def _anywhere(summary: Summary) -> str:
    kinds = [KINDS.index(kind) for kind in (RANDOM, LIMITS)]
    judged = int(summary.judged[kinds].sum())
    if not judged:
        return ""
    shares = [(label, float(right) / judged) for label, right in _each(summary, summary.right[:, kinds].sum(axis=1))]
    always = [label for label, part in shares if part == 1.0]
    mostly = [(label, part) for label, part in shares if 0.5 <= part < 1.0]
    return say("anywhere", always=always, within=PARTING, judged=judged, mostly=mostly)


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
    late = [(label, sigma) for label, sigma in known if sigma < EARLY]
    return say(
        "approach",
        title=summary.cases[c].title,
        never=[label for label, sigma in known if math.isnan(sigma)],
        late=sorted(late, key=lambda item: (item[1], item[0])),
        early=[label for label, sigma in known if sigma >= EARLY],
        within=PARTING,
    )


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
    """Who keeps level 1, and |x| too where samples lie far enough from the singularity to compare it with."""
    every = range(len(summary.cases))
    both = [c for c in every if far_norm(summary, c) > 0.0]
    alone = [c for c in every if c not in both]
    sentences = []
    for cases, sized in ((both, True), (alone, False)):
        judged = [c for c in cases if any(not math.isnan(level_error(summary, c, k, 0)) for k in _every(summary))]
        if judged:
            towards = [summary.cases[c].title for c in judged] if alone and both else []
            sentences.append(_keepers(summary, judged, sized, towards))
    return " ".join(sentences)


def _keepers(summary: Summary, cases: Sequence[int], sized: bool, towards: Sequence[str]) -> str:
    found = [
        (k, label)
        for k, label in enumerate(summary.labels)
        if all(_keeps(summary, c, k, 0) and (not sized or growth(summary, c, k) <= BOUNDED) for c in cases)
    ]
    labels = [label for _, label in found]
    if sized:
        return say("kept_and_bounded", found=labels, kept=KEPT, times=BOUNDED, towards=towards)
    sizes = [(label, largest(np.stack([_norms(summary, c, k) for c in cases]))) for k, label in found]
    return say("kept_alone", found=labels, kept=KEPT, far=FAR_FROM, sizes=sizes, towards=towards)


def _every(summary: Summary) -> range:
    return range(len(summary.labels))


def _each(summary: Summary, values: NDArray[Any]) -> Iterator[tuple[str, Any]]:
    """(label, its entry of values (K, ...)) of every contestant."""
    return zip(summary.labels, values, strict=True)


def _keeps(summary: Summary, c: int, k: int, level: int) -> bool:
    """Whether the contestant keeps the level where it was judged; a nan, nothing judged, is not against it."""
    error = level_error(summary, c, k, level)
    return math.isnan(error) or error <= KEPT


def _norms(summary: Summary, c: int, k: int) -> NDArray[np.int64]:
    return np.asarray(summary.along[c][summary.quantities.index("x_norm"), k])


def _jumps(summary: Summary) -> str:
    jumping, never = [], []
    for label, jumps in _each(summary, summary.jumps.sum(axis=0)):
        where = sigma_of_bins()[jumps > 0]
        if where.size:
            jumping.append((label, int(jumps.sum()), float(where.max()), float(where.min())))
        else:
            never.append(label)
    return say("jumps", jumping=jumping, never=never) if summary.cases else ""


def _honesty(summary: Summary) -> str:
    references = [(count, name) for name, count in summary.references.items() if count]
    return say("honesty", references=references, unclear=int(summary.ambiguous.sum()))


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
    classic = _first(test.plan.contestants, is_null_space)
    null_space = None if classic is None else largest(counts[classic])
    evidence = say("same_answer", clear=CLEAR, middle=middle, worst=worst, null_space=null_space)
    return ("yes" if worst <= PARTING else "no"), evidence


def _undisturbed(test: StressResult, c: int, k: int) -> tuple[str, str]:
    error = level_error(test.summary, c, k, 0)
    return ("yes" if error <= KEPT else "no"), say("undisturbed", error=error)


def _free(test: StressResult, c: int, k: int) -> tuple[str, str]:
    times = growth(test.summary, c, k)
    if math.isnan(times):
        return "-", say("not_known", far=FAR_FROM)
    classic = _first(test.plan.contestants, is_null_space)
    null_space = None if classic is None else growth(test.summary, c, classic)
    return ("yes" if times <= BOUNDED else "no"), say("singularity_free", times=times, null_space=null_space)


def _damped(summary: Summary, c: int, k: int) -> tuple[str, str]:
    error, times = level_error(summary, c, k, 0), growth(summary, c, k)
    if math.isnan(error) or math.isnan(times):
        return "-", say("not_known", far=FAR_FROM)
    second = level_error(summary, c, k, 1)
    evidence = say("damped", label=summary.labels[k], level_1=error, level_2=second, times=times)
    return ("yes" if error <= KEPT and times <= BOUNDED else "no"), evidence


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
            sentences.append(say("level_not_judged", level=name))
            continue
        kept = [label for label, error in errors.items() if error <= KEPT]
        sentences.append(say("level_kept", level=name, kept=KEPT, found=kept))
    needed = far_norm(summary, c)
    if not needed > 0.0:
        return (*sentences, say("nothing_far", far=FAR_FROM))
    sizes = [(label, growth(summary, c, k)) for k, label in enumerate(summary.labels)]
    grown = [(label, times) for label, times in sizes if times > BOUNDED]
    return (*sentences, say("growth", grown=grown, times=BOUNDED, needed=needed))


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
