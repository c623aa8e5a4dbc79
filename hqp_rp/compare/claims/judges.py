"""What the runs say of each claim: outcomes by condition, the one number, and the algebra behind."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import polars as pl

from hqp_rp.compare.claims import algebra
from hqp_rp.compare.claims.experiments import (
    CONFLICT,
    CONFLICT_NEAR,
    CORNER,
    DELAYS,
    FRICTIONS,
    HYBRID,
    LIMITED_CONFLICT,
    LIMITED_CORNER,
    MEET,
    NEAR,
    NOISE,
    NOISES,
    PUSH,
    PUSH_TORQUE,
    RATIOS,
    RECOVERY,
    RUB,
    SINE,
    STIFF_SERVO,
    TRACK,
    TRACK_FAST,
    TRACK_TORQUE,
    TUNING,
    WALL_NEAR,
    WIPE,
    WIPE_NEAR,
)
from hqp_rp.compare.claims.methods import (
    CASCADE,
    CLASSICAL,
    DLS,
    DLS_VARIABLE,
    FIRST_DAMPING,
    NULL_DAMPED,
    NULL_SPACE,
    NULL_VARIABLE,
    REVERSE,
    REVERSE_DAMPED,
    SWEPT,
    UNILATERAL,
    WEIGHTED,
)
from hqp_rp.compare.claims.outcomes import Outcome, outcome
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.core.problem import FloatArray
from hqp_rp.scenarios._interaction import DAMPED, PAPER, REGULAR, SINGULAR

say = Sentences(__file__)

FAILS = "does not hold"
"""The word that a counterexample or a refuted theorem forces."""


KEPT = 0.05 * 30.0
"""N: the force is kept when its RMS error in the last third of a run is at most 5 % of 30 N."""
GENTLE = 0.05 * 30.0
"""N: the overshoot of a contact that goes well."""
ALTERNATING = 0.1
"""The alternating force is tracked when the RMS error is at most this share of the RMS value of its alternating part."""
RESTS = 0.01 * 30.0
"""N: the force rests when it stays within 1 % of 30 N."""
IDEAL = 0.1
"""A response is the desired one when it is never farther from the ideal than this share of the ideal's largest value."""
BETTER, STRICTER, LOOSER = 0.95, 0.85, 0.983
"""One figure is better than another when it is at most 0.95 of it; three times that difference, and a third."""
BOUNDED = 10.0
"""Joint velocities are bounded near a singularity when they are at most ten times those at regular postures."""
ON_PATH = 5e-3
"""m."""
NOTHING = 30.0
"""N: the force error of a tool that never touches."""


@dataclasses.dataclass(frozen=True, slots=True)
class Found:
    """What a judge found: outcomes that decide, the number, what to add to the summary, a theorem, and a word it forces."""

    outcomes: Sequence[Outcome]
    number: str
    words: str = ""
    theorem: str = ""
    word: str = ""


class Study:
    """The rows of all trials, by what they are."""

    def __init__(self, rows: pl.DataFrame) -> None:
        self.rows = rows

    def has(self, *experiments: str) -> bool:
        """Whether all of these were run."""
        return set(experiments) <= set(self.rows["experiment"].unique().to_list())

    def pick(self, experiment: str, method: str = "", damping: float | None = None, **columns: object) -> pl.DataFrame:
        """The runs of an experiment, of one method and damping, with these values in these columns, by posture."""
        found = self.rows.filter(pl.col("experiment") == experiment)
        if method:
            found = found.filter(pl.col("method") == method)
        if damping is not None:
            found = found.filter(pl.col("damping") == damping)
        for name, value in columns.items():
            found = found.filter(pl.col(name) == value)
        return found.sort("posture", "seed")

    def dampings(self, experiment: str, method: str, gains: str = DAMPED) -> list[float]:
        """The dampings with which a method was run, from the smallest."""
        return sorted(self.pick(experiment, method, gains=gains)["damping"].unique().to_list())

    def best(self, experiment: str, method: str, gains: str = DAMPED) -> pl.DataFrame:
        """The runs with the damping whose median RMS force error from the first contact on is smallest."""
        candidates = [
            self.pick(experiment, method, damping, gains=gains)
            for damping in self.dampings(experiment, method, gains=gains)
        ]
        return min(candidates, key=lambda found: float(np.median(force_error(found))))


def force_error(rows: pl.DataFrame) -> FloatArray:
    """N, of each run: RMS of F_e - F_d from the first contact on; `NOTHING` where nothing was touched."""
    return np.asarray(rows["rms"].cast(pl.Float64).fill_null(NOTHING).to_numpy(), dtype=np.float64)


def _theorem(theorem: algebra.Theorem) -> str:
    checked = say("checked", draws=algebra.DRAWS, largest=theorem.largest)
    return f"Theorem: {theorem.statement}. {theorem.proof} {checked}"


def _words(experiment: str) -> str:
    return experiment.replace(", near", "")


def undisturbed(study: Study) -> Found:
    """Is the first level, and the force, kept beside singularities of the lower ones?"""
    theorem = algebra.first_level_kept()
    near = [e for e in NEAR if study.has(e)]
    outcomes = [
        outcome(f"{_words(e)}, shortened", study.pick(e, REVERSE, gains=DAMPED), "late_rms", KEPT) for e in near
    ]
    outcomes += [
        outcome(f"{_words(e)}, T_k damped", study.best(e, REVERSE_DAMPED, gains=DAMPED), "late_rms", KEPT) for e in near
    ]
    for e, told in ((CORNER, LIMITED_CORNER), (CONFLICT_NEAR, LIMITED_CONFLICT)):
        if study.has(told):
            outcomes.append(outcome(f"{_words(e)}, hard limits", study.pick(told, UNILATERAL), "late_rms", KEPT))
    largest = max(float(study.pick(e, REVERSE)["first_level"].max()) for e in near)  # type: ignore[arg-type]
    late = np.concatenate([study.pick(e, REVERSE, gains=DAMPED)["late_rms"].to_numpy() for e in near])
    lost = float((late > KEPT).mean())
    return Found(
        outcomes,
        say("undisturbed_number", lost=lost, largest=largest),
        say("undisturbed_words"),
        _theorem(theorem),
        "" if theorem.checked else FAILS,
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
            outcomes.append(outcome(f"{_words(near)}{label}", rows, values, BOUNDED))
            if not label:
                ratios.append(values)
    together = np.concatenate(ratios)
    return Found(
        outcomes,
        say("singularity_free_number", largest=float(together.max()), median=float(np.median(together))),
        say("singularity_free_words"),
        _theorem(algebra.same_on_two_levels()),
    )


def tracks(study: Study) -> Found:
    """Gain and lag of the alternating force."""
    outcomes: list[Outcome] = []
    lags: dict[str, float] = {}
    amplitudes = []
    fast = f"sin(pi t), {SINE:g} Hz"
    for experiment, label in ((TRACK, "sin(t / pi)"), (TRACK_FAST, fast), (TRACK_TORQUE, f"{fast}, torque loop")):
        if not study.has(experiment):
            continue
        for gains in (PAPER, DAMPED):
            rows = study.pick(experiment, REVERSE, gains=gains)
            phase = 2.0 * math.pi * rows["frequency 0"].to_numpy() * rows["lag 0"].to_numpy()
            gain = rows["gain 0"].to_numpy()
            # RMS of gain sin(wt - phase) - sin(wt), over that of sin(wt).
            miss = np.hypot(gain * np.cos(phase) - 1.0, gain * np.sin(phase))
            outcomes.append(outcome(f"{label}, {gains}", rows, miss, ALTERNATING))
            lags.setdefault(gains, 1e3 * float(np.median(rows["lag 0"].to_numpy())))
            amplitudes.append(5.0 * float(np.median(gain)))
    return Found(outcomes, say("tracks_number", amplitude=amplitudes[0], lags=lags))


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
    words = _words(experiment)
    found = []
    for rival in rivals:
        other = study.best(experiment, rival, gains=DAMPED)
        ratio = force_error(mine) / np.maximum(force_error(other), 1e-9)
        than = outcome(f"{words}, than {rival}", mine, ratio, BETTER, stricter=STRICTER, looser=LOOSER)
        worse = float((ratio > 1.0 / BETTER).mean())
        found.append(Rivalry(words, rival, than, other["damping"][0], worse, _peak(mine), _peak(other)))
    return found


def _outcomes(found: Sequence[Rivalry], damped: Sequence[Rivalry]) -> list[Outcome]:
    """Those of reverse priority as printed, and those with T_k damped under a label that says so."""
    renamed = [dataclasses.replace(it.outcome, label=f"T_k damped: {it.outcome.label}") for it in damped]
    return [*(it.outcome for it in found), *renamed]


def _than_dls(found: Sequence[Rivalry]) -> Outcome:
    return next(it.outcome for it in found if it.rival == DLS)


def _peak(rows: pl.DataFrame) -> float:
    return float(np.median(rows["peak"].to_numpy()))


def first_wins(study: Study) -> Found:
    """F_x in the corner, against every method without and with priority."""
    found = _against(study, CORNER, (CLASSICAL, DLS, DLS_VARIABLE, NULL_DAMPED, NULL_VARIABLE))
    damped = _against(study, CORNER, (DLS, NULL_DAMPED), REVERSE_DAMPED)
    regular = say("first_wins_regular", wound=_late_errors(study, 0.05), free=_late_errors(study, -1.0))  # -1 is none
    return Found(
        _outcomes(found, damped),
        say("first_wins_number", than_dls=_than_dls(found)),
        " ".join((regular, say("first_wins_near", found=found, damped=damped))),
        _theorem(algebra.same_as_pseudo_inverse()),
    )


def _late_errors(study: Study, recovery: float) -> list[tuple[str, float, float]]:
    """Method, damping and median late RMS error, N, from rest at regular postures."""
    return [
        (name, eta, float(np.median(study.pick(RECOVERY, name, eta, recovery=recovery)["late_rms"].to_numpy())))
        for name, eta in ((REVERSE, 0.0), (DLS, 0.01), (DLS, 0.1), (NULL_DAMPED, 0.1))
    ]


def close_approach(study: Study) -> Found:
    """Overshoot at the wall."""
    outcomes = []
    for servo in (1.0, 10.0):
        for gains in (PAPER, DAMPED):
            rows = study.pick(MEET, REVERSE, gains=gains, servo=servo, delay=0.0)
            outcomes.append(outcome(f"{gains}, servo x {servo:g}", rows, "overshoot", GENTLE))
    rows = study.pick(MEET, REVERSE, gains=PAPER, servo=1.0, delay=0.0)
    stiff = study.pick(MEET, REVERSE, gains=PAPER, servo=10.0, delay=0.0)
    bouncing = float((rows["contact"].fill_null(0.0).to_numpy() < 1.0).mean())
    return Found(
        outcomes,
        say("close_approach_number", peak=outcome("peak", rows, "peak", GENTLE + 30.0)),
        say("close_approach_words", bouncing=bouncing, stiff_peak=_peak(stiff)),
    )


def overwhelms(study: Study) -> Found:
    """The wall, against every method without and with priority."""
    found = _against(study, WALL_NEAR, (CLASSICAL, DLS, DLS_VARIABLE, NULL_DAMPED, NULL_VARIABLE))
    damped = _against(study, WALL_NEAR, (DLS, DLS_VARIABLE, NULL_DAMPED), REVERSE_DAMPED)
    return Found(
        _outcomes(found, damped),
        say("overwhelms_number", than_dls=_than_dls(found)),
        say("overwhelms_words", found=found, damped=damped),
        _theorem(algebra.same_as_pseudo_inverse()),
    )


def rests(study: Study) -> Found:
    """The force at the end, with delays, stiffer servos and noise."""
    outcomes = []
    for gains in (PAPER, DAMPED):
        for delay in (0.0, *(d for d in DELAYS[1:] if d in (0.002, 0.005, 0.01))):
            rows = study.pick(MEET, REVERSE, gains=gains, servo=1.0, delay=delay)
            if rows.height:
                outcomes.append(outcome(f"{gains}, delay {1e3 * delay:g} ms", rows, "late_rms", RESTS))
        rows = study.pick(MEET, REVERSE, gains=gains, servo=10.0, delay=0.0)
        outcomes.append(outcome(f"{gains}, servo x 10", rows, "late_rms", RESTS))
        for noise in NOISES[2:]:
            rows = study.pick(NOISE, REVERSE, gains=gains, noise=noise)
            outcomes.append(outcome(f"{gains}, noise {noise:g} N", rows, "late_rms", RESTS))
    rows = study.pick(MEET, REVERSE, gains=PAPER, servo=1.0, delay=0.0)
    late = outcome("late", rows, "late_rms", RESTS)
    return Found(outcomes, say("rests_number", late=late))


def tuning(study: Study) -> Found:
    """Overshoot over B_d."""
    paper = study.pick(MEET, REVERSE, gains=PAPER, servo=1.0, delay=0.0)
    base = np.asarray(paper["overshoot"].to_numpy(), dtype=np.float64)
    outcomes: list[Outcome] = []
    medians: dict[float, float] = {}
    for ratio in RATIOS:
        rows = study.pick(TUNING, REVERSE, damping_ratio=ratio)
        values = np.asarray(rows["overshoot"].to_numpy(), dtype=np.float64)
        medians[ratio] = float(np.median(values))
        less, label = values / np.maximum(base, 1e-9), f"damping ratio {ratio:g}"
        outcomes.append(outcome(label, rows, less, BETTER, stricter=STRICTER, looser=LOOSER))
    return Found(
        outcomes,
        say("tuning_number", paper=float(np.median(base)), ratio=RATIOS[2], median=medians[RATIOS[2]]),
        say("tuning_words", medians=medians),
    )


def impedance(study: Study) -> Found:
    """A pushed tool against the ideal."""
    outcomes = []
    for servo in (1.0, STIFF_SERVO):
        for what in ("translation", "rotation"):
            for place in (REGULAR, SINGULAR):
                rows = study.pick(PUSH, REVERSE, servo=servo, place=place)
                outcomes.append(outcome(f"{what}, {place}, servo x {servo:g}", rows, what, IDEAL))
    turned = study.pick(PUSH, REVERSE, servo=1.0, place=REGULAR)
    damped = study.pick(PUSH, REVERSE_DAMPED, servo=1.0, place=SINGULAR)
    translation = outcome("T_k damped", damped, "translation", IDEAL)
    words = say("impedance_words", damping=FIRST_DAMPING, translation=translation)
    if study.has(PUSH_TORQUE):
        outcomes += _by_torques(study)
        driven = study.pick(PUSH_TORQUE, REVERSE, metric="none", place=REGULAR)
        rotation = outcome("rotation, torque loop", driven, "rotation", IDEAL)
        words = " ".join((words, say("impedance_by_torques", rotation=rotation)))
    return Found(outcomes, say("impedance_number", rotation=outcome("rotation", turned, "rotation", IDEAL)), words)


def _by_torques(study: Study) -> list[Outcome]:
    """The same with the law's accelerations by inverse dynamics, without and with the inertia as metric."""
    outcomes = []
    for metric, label in (("none", ""), ("inertia", ", metric M")):
        for what in ("translation", "rotation"):
            for place in (REGULAR, SINGULAR):
                rows = study.pick(PUSH_TORQUE, REVERSE, metric=metric, place=place)
                outcomes.append(outcome(f"{what}, {place}, torque loop{label}", rows, what, IDEAL))
    return outcomes


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
        "",
        say("in_order_counterexample", strict=strict, reverse=reverse),
        FAILS if abs(reverse - null_space) > algebra.ROUNDING else "",
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
    return f"{_words(experiment)}, {where}, {words}"


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


def hybrid(study: Study) -> Found:
    """Force and path along a tilted wall."""
    outcomes = []
    for friction in FRICTIONS:
        for gains in (PAPER, DAMPED):
            rows = study.pick(HYBRID, REVERSE, gains=gains, friction=friction)
            label = f"friction {friction:g}, {gains}"
            outcomes.append(outcome(f"force, {label}", rows, "late_rms", KEPT))
            outcomes.append(outcome(f"path, {label}", rows, "position", ON_PATH))
    rubbed = study.pick(HYBRID, REVERSE, gains=DAMPED, friction=FRICTIONS[-1])
    off = outcome("path", rubbed, "position", ON_PATH)
    return Found(
        outcomes,
        say("hybrid_number", off=off, friction=FRICTIONS[-1]),
        say("hybrid_words"),
    )
