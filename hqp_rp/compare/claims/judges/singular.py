"""Beside singularities of the lower levels: is the first one kept, and does x stay bounded?"""

from __future__ import annotations

import numpy as np

from hqp_rp.compare.claims import algebra
from hqp_rp.compare.claims.experiments import (
    CONFLICT,
    CONFLICT_NEAR,
    CORNER,
    LIMITED_CONFLICT,
    LIMITED_CORNER,
    MEET,
    NEAR,
    RECOVERY,
    WALL_NEAR,
    WIPE,
    WIPE_NEAR,
)
from hqp_rp.compare.claims.judges.criteria import BOUNDED, FAILS, KEPT
from hqp_rp.compare.claims.judges.study import Found, Study, without_near
from hqp_rp.compare.claims.methods import REVERSE, REVERSE_DAMPED, UNILATERAL
from hqp_rp.compare.claims.outcomes import outcome
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.scenarios._interaction import DAMPED

say = Sentences(__file__)


def undisturbed(study: Study) -> Found:
    """Is the first level, and the force, kept beside singularities of the lower ones?"""
    theorem = algebra.first_level_kept()
    near = [e for e in NEAR if study.has(e)]
    outcomes = [
        outcome(f"{without_near(e)}, shortened", study.pick(e, REVERSE, gains=DAMPED), "late_rms", KEPT) for e in near
    ]
    outcomes += [
        outcome(f"{without_near(e)}, T_k damped", study.best(e, REVERSE_DAMPED, gains=DAMPED), "late_rms", KEPT)
        for e in near
    ]
    for e, told in ((CORNER, LIMITED_CORNER), (CONFLICT_NEAR, LIMITED_CONFLICT)):
        if study.has(told):
            outcomes.append(outcome(f"{without_near(e)}, hard limits", study.pick(told, UNILATERAL), "late_rms", KEPT))
    largest = max(float(study.pick(e, REVERSE)["first_level"].max()) for e in near)  # type: ignore[arg-type]
    late = np.concatenate([study.pick(e, REVERSE, gains=DAMPED)["late_rms"].to_numpy() for e in near])
    lost = float((late > KEPT).mean())
    return Found(
        outcomes,
        say("undisturbed_number", lost=lost, largest=largest),
        say("undisturbed_words"),
        theorem,
        word="" if theorem.checked else FAILS,
    )


def singularity_free(study: Study) -> Found:
    """Does x stay bounded there?"""
    pairs = [(CORNER, RECOVERY), (WALL_NEAR, MEET), (WIPE_NEAR, WIPE), (CONFLICT_NEAR, CONFLICT)]
    outcomes, ratios = [], []
    for near, far in pairs:
        if not study.has(near, far):
            continue
        usual = float(np.median(study.pick(far, REVERSE)["commanded"].to_numpy()))
        for label, rows in (
            ("", study.pick(near, REVERSE)),
            (", T_k damped", study.best(near, REVERSE_DAMPED, gains=DAMPED)),
        ):
            values = rows["commanded"].to_numpy() / usual
            outcomes.append(outcome(f"{without_near(near)}{label}", rows, values, BOUNDED))
            if not label:
                ratios.append(values)
    together = np.concatenate(ratios)
    return Found(
        outcomes,
        say("singularity_free_number", largest=float(together.max()), median=float(np.median(together))),
        say("singularity_free_words"),
        algebra.same_on_two_levels(),
    )
