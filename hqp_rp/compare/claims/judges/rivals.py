"""Run by run against the other methods: whose force error is smaller?"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from hqp_rp.compare.claims import algebra
from hqp_rp.compare.claims.experiments import CONFLICT, CONFLICT_NEAR, CORNER, RECOVERY, WALL_NEAR, WIPE, WIPE_NEAR
from hqp_rp.compare.claims.judges.criteria import BETTER, LOOSER, STRICTER
from hqp_rp.compare.claims.judges.study import Found, Study, force_error, median_peak, without_near
from hqp_rp.compare.claims.methods import (
    CLASSICAL,
    DLS,
    DLS_VARIABLE,
    NULL_DAMPED,
    NULL_VARIABLE,
    REVERSE,
    REVERSE_DAMPED,
    SWEPT,
    WEIGHTED,
)
from hqp_rp.compare.claims.outcomes import Outcome, outcome
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.scenarios._interaction import DAMPED

say = Sentences(__file__)


@dataclasses.dataclass(frozen=True, slots=True)
class Rivalry:
    """Run by run against one rival in one experiment.

    Attributes:
        experiment, rival: which. outcome: whether the force error is at most `BETTER` of the rival's.
        damping: the rival's best, 0 for none. worse: share of the runs in which it is the rival's that is better so.
        own_peak, peak: N, medians.
    """

    experiment: str
    rival: str
    outcome: Outcome
    damping: float
    worse: float
    own_peak: float
    peak: float


def _against(study: Study, experiment: str, rivals: Sequence[str], own: str = REVERSE) -> list[Rivalry]:
    """The force error against each rival's, run by run; each damped method with its best damping."""
    mine = study.best(experiment, own, gains=DAMPED) if own in SWEPT else study.pick(experiment, own, gains=DAMPED)
    words = without_near(experiment)
    found = []
    for rival in rivals:
        other = study.best(experiment, rival, gains=DAMPED)
        ratio = force_error(mine) / np.maximum(force_error(other), 1e-9)
        than = outcome(f"{words}, than {rival}", mine, ratio, BETTER, stricter=STRICTER, looser=LOOSER)
        worse = float((ratio > 1.0 / BETTER).mean())
        found.append(Rivalry(words, rival, than, other["damping"][0], worse, median_peak(mine), median_peak(other)))
    return found


def _outcomes(found: Sequence[Rivalry], damped: Sequence[Rivalry]) -> list[Outcome]:
    """Those of reverse priority as printed, and those with T_k damped under a label that says so."""
    renamed = [dataclasses.replace(it.outcome, label=f"T_k damped: {it.outcome.label}") for it in damped]
    return [*(it.outcome for it in found), *renamed]


def _than_dls(found: Sequence[Rivalry]) -> Outcome:
    return next(it.outcome for it in found if it.rival == DLS)


def first_wins(study: Study) -> Found:
    """F_x in the corner, against every method without and with priority."""
    found = _against(study, CORNER, (CLASSICAL, DLS, DLS_VARIABLE, NULL_DAMPED, NULL_VARIABLE))
    damped = _against(study, CORNER, (DLS, NULL_DAMPED), REVERSE_DAMPED)
    regular = say("first_wins_regular", wound=_late_errors(study, 0.05), free=_late_errors(study, -1.0))  # -1 is none
    return Found(
        _outcomes(found, damped),
        say("first_wins_number", than_dls=_than_dls(found)),
        " ".join((regular, say("first_wins_near", found=found, damped=damped))),
        algebra.same_as_pseudo_inverse(),
    )


def _late_errors(study: Study, recovery: float) -> list[tuple[str, float, float]]:
    """Method, damping and median late RMS error, N, from rest at regular postures."""
    return [
        (name, eta, float(np.median(study.pick(RECOVERY, name, eta, recovery=recovery)["late_rms"].to_numpy())))
        for name, eta in ((REVERSE, 0.0), (DLS, 0.01), (DLS, 0.1), (NULL_DAMPED, 0.1))
    ]


def overwhelms(study: Study) -> Found:
    """The wall, against every method without and with priority."""
    found = _against(study, WALL_NEAR, (CLASSICAL, DLS, DLS_VARIABLE, NULL_DAMPED, NULL_VARIABLE))
    damped = _against(study, WALL_NEAR, (DLS, DLS_VARIABLE, NULL_DAMPED), REVERSE_DAMPED)
    return Found(
        _outcomes(found, damped),
        say("overwhelms_number", than_dls=_than_dls(found)),
        say("overwhelms_words", found=found, damped=damped),
        algebra.same_as_pseudo_inverse(),
    )


def improves(study: Study) -> Found:
    """Three levels against methods with and without priority."""
    rivals = (CLASSICAL, DLS, WEIGHTED, NULL_DAMPED)
    near = [_against(study, experiment, rivals, REVERSE_DAMPED) for experiment in (WIPE_NEAR, CONFLICT_NEAR)]
    regular = {
        (experiment, rival): _regular(study, experiment, rival)
        for experiment in (WIPE, CONFLICT)
        for rival in (CLASSICAL, DLS, WEIGHTED)
    }
    return Found(
        [*(it.outcome for found in near for it in found), *regular.values()],
        say("improves_number", than_pseudo_inverse=regular[CONFLICT, CLASSICAL]),
        say("improves_words", near=near),
    )


def _regular(study: Study, experiment: str, rival: str) -> Outcome:
    """Undamped reverse priority against a rival, run by run, at regular postures."""
    mine, other = (study.pick(experiment, label) for label in (REVERSE, rival))
    ratio = force_error(mine) / np.maximum(force_error(other), 1e-9)
    label = f"{experiment}, regular, than {rival}"
    return outcome(label, mine, ratio, BETTER, stricter=STRICTER, looser=LOOSER)
