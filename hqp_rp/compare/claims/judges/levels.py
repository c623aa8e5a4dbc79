"""More than two levels: their order, and the force where tasks conflict."""

from __future__ import annotations

from hqp_rp.compare.claims import algebra
from hqp_rp.compare.claims.experiments import CONFLICT, CONFLICT_NEAR, FRICTIONS, NEAR, RUB, WIPE, WIPE_NEAR
from hqp_rp.compare.claims.judges.criteria import BETTER, FAILS, KEPT, LOOSER, STRICTER
from hqp_rp.compare.claims.judges.study import Found, Study, without_near
from hqp_rp.compare.claims.methods import CASCADE, NULL_DAMPED, NULL_SPACE, REVERSE, REVERSE_DAMPED
from hqp_rp.compare.claims.outcomes import outcome
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.scenarios._interaction import DAMPED

say = Sentences(__file__)


def in_order(study: Study) -> Found:
    """Three levels: the second level against null-space priority's; near singularities each with its best damping."""
    outcomes = []
    for experiment in (WIPE, CONFLICT, WIPE_NEAR, CONFLICT_NEAR):
        near = experiment in NEAR
        mine = study.best(experiment, REVERSE_DAMPED, gains=DAMPED) if near else study.pick(experiment, REVERSE)
        other = study.best(experiment, NULL_DAMPED, gains=DAMPED) if near else study.pick(experiment, NULL_SPACE)
        a, b = (rows["position"].to_numpy() for rows in (mine, other))
        ratio = a / (b + 1e-4)  # a tenth of a millimetre is no difference
        outcomes.append(outcome(experiment, mine, ratio, 1.0 / BETTER, stricter=1.0 / LOOSER, looser=1.0 / STRICTER))
    reverse, null_space = algebra.third_disturbs_second()
    strict = null_space if abs(null_space) > 1e-12 else 0.0
    return Found(
        outcomes,
        say("in_order_number", error=outcomes[-1]),
        counterexample=say("in_order_counterexample", strict=strict, reverse=reverse),
        word=FAILS if abs(reverse - null_space) > algebra.ROUNDING else "",
    )


def conflict(study: Study) -> Found:
    """The force in conflicts."""
    outcomes = []
    for experiment in (CONFLICT, CONFLICT_NEAR, WIPE_NEAR):
        outcomes.append(
            outcome(_label(experiment, "printed"), study.pick(experiment, REVERSE, gains=DAMPED), "late_rms", KEPT)
        )
        if experiment in NEAR:
            rows = study.best(experiment, REVERSE_DAMPED, gains=DAMPED)
            outcomes.append(outcome(_label(experiment, "T_k damped"), rows, "late_rms", KEPT))
    outcomes.append(outcome(f"friction {FRICTIONS[-1]:g}", study.pick(RUB, REVERSE), "late_rms", KEPT))
    others = {
        label: outcome(label, study.pick(CONFLICT, label), "late_rms", KEPT).passed for label in (NULL_SPACE, CASCADE)
    }
    late = outcome("late", study.pick(CONFLICT, REVERSE), "late_rms", KEPT)
    return Found(outcomes, say("conflict_number", late=late), say("conflict_words", others=others))


def _label(experiment: str, words: str) -> str:
    where = "near a singularity" if experiment in NEAR else "regular"
    return f"{without_near(experiment)}, {where}, {words}"
