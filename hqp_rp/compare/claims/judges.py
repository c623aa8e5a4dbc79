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
from hqp_rp.compare.report.words import number, share
from hqp_rp.core.problem import FloatArray
from hqp_rp.scenarios._interaction import DAMPED, PAPER, REGULAR, SINGULAR

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
    checked = f"Checked on {algebra.DRAWS} random problems: largest deviation {number(theorem.largest)}."
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
        f"force lost in {share(lost)} of runs near singularities, J_1 x = v_1 within {number(largest)} m/s",
        "In x a theorem. In the force it depends on what becomes of an x over the velocity limits: shortened as a whole, the "
        "first level is shortened too.",
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
        f"|x| up to {number(float(together.max()))} times that of regular postures, median "
        f"{number(float(np.median(together)))}",
        "Undamped, two levels are null-space priority (see the next theorem), singularities included.",
        _theorem(algebra.same_on_two_levels()),
    )


def tracks(study: Study) -> Found:
    """Gain and lag of the alternating force."""
    outcomes, lags, gains_found = [], [], []
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
            lags.append(1e3 * float(np.median(rows["lag 0"].to_numpy())))
            gains_found.append(float(np.median(gain)))
    return Found(
        outcomes,
        f"amplitude {number(5.0 * gains_found[0], 4)} N of 5, lag {number(lags[0])} ms ({PAPER}), {number(lags[1])} ms "
        f"({DAMPED})",
    )


def _against(
    study: Study, experiments: Sequence[str], rivals: Sequence[str], own: str = REVERSE
) -> tuple[list[Outcome], str]:
    """Whether the force error is at most 0.95 of each rival's, run by run; each damped method with its best damping."""
    outcomes, words = [], []
    for experiment in experiments:
        mine = study.best(experiment, own, gains=DAMPED) if own in SWEPT else study.pick(experiment, own, gains=DAMPED)
        for rival in rivals:
            other = study.best(experiment, rival, gains=DAMPED)
            ratio = force_error(mine) / np.maximum(force_error(other), 1e-9)
            label = f"{_words(experiment)}, than {rival}"
            outcomes.append(outcome(label, mine, ratio, BETTER, stricter=STRICTER, looser=LOOSER))
            damping = other["damping"][0]
            worse = float((ratio > 1.0 / BETTER).mean())
            eta = f" (damping {damping:g})" if damping else ""
            words.append(
                f"{_words(experiment)}, {rival}{eta}: worse in {share(worse)}, peaks {_peak(mine)} against {_peak(other)} N"
            )
    return outcomes, "; ".join(words) + "."


def _peak(rows: pl.DataFrame) -> str:
    return number(float(np.median(rows["peak"].to_numpy())))


def first_wins(study: Study) -> Found:
    """F_x in the corner, against every method without and with priority."""
    rivals = (CLASSICAL, DLS, DLS_VARIABLE, NULL_DAMPED, NULL_VARIABLE)
    outcomes, words = _against(study, (CORNER,), rivals)
    damped, damped_words = _against(study, (CORNER,), (DLS, NULL_DAMPED), REVERSE_DAMPED)
    renamed = [dataclasses.replace(o, label=f"T_k damped: {o.label}") for o in damped]
    parts = []
    for recovery, label in ((0.05, "with anti-windup"), (-1.0, "without")):
        late = {
            f"{name} {eta:g}".strip(" 0") if name == REVERSE else f"{name} {eta:g}": float(
                np.median(study.pick(RECOVERY, name, eta, recovery=recovery)["late_rms"].to_numpy())
            )
            for name, eta in ((REVERSE, 0.0), (DLS, 0.01), (DLS, 0.1), (NULL_DAMPED, 0.1))
        }
        parts.append(f"{label} " + ", ".join(f"{name} {number(value)} N" for name, value in late.items()))
    regular = "Regular postures, where it is the pseudo-inverse; late RMS error, median: " + "; ".join(parts) + "."
    best = outcomes[1]
    return Found(
        [*outcomes, *renamed],
        f"near the singularity {best.figure('times the force error of DLS at its best')}",
        f"{regular} Near the singularity, {words} With T_k damped: {damped_words}",
        _theorem(algebra.same_as_pseudo_inverse()),
    )


def close_approach(study: Study) -> Found:
    """Overshoot at the wall."""
    outcomes = []
    for servo in (1.0, 10.0):
        for gains in (PAPER, DAMPED):
            rows = study.pick(MEET, REVERSE, gains=gains, servo=servo, delay=0.0)
            outcomes.append(outcome(f"{gains}, servo x {servo:g}", rows, "overshoot", GENTLE))
    rows = study.pick(MEET, REVERSE, gains=PAPER, servo=1.0, delay=0.0)
    peak = outcome("peak", rows, "peak", GENTLE + 30.0)
    stiff = study.pick(MEET, REVERSE, gains=PAPER, servo=10.0, delay=0.0)["peak"].to_numpy()
    bouncing = float((rows["contact"].fill_null(0.0).to_numpy() < 1.0).mean())
    return Found(
        outcomes,
        f"peak {peak.figure('N')} for 30 N with the paper's numbers",
        f"With the paper's numbers the ball leaves the wall again in {share(bouncing)} of the runs; with servos ten times "
        f"stiffer the median peak is {number(float(np.median(stiff)))} N (see the map).",
    )


def overwhelms(study: Study) -> Found:
    """The wall, against every method without and with priority."""
    rivals = (CLASSICAL, DLS, DLS_VARIABLE, NULL_DAMPED, NULL_VARIABLE)
    outcomes, words = _against(study, (WALL_NEAR,), rivals)
    damped, damped_words = _against(study, (WALL_NEAR,), (DLS, DLS_VARIABLE, NULL_DAMPED), REVERSE_DAMPED)
    renamed = [dataclasses.replace(o, label=f"T_k damped: {o.label}") for o in damped]
    return Found(
        [*outcomes, *renamed],
        f"near the singularity {outcomes[1].figure('times the force error of DLS at its best')}",
        "At regular postures the two are equal, by the same theorem as above, so Figures 7 and 8 cannot differ by priority. "
        f"Near a singularity, {words} With T_k damped: {damped_words}",
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
    return Found(outcomes, f"late RMS error {late.figure('N')}, without delay")


def tuning(study: Study) -> Found:
    """Overshoot over B_d."""
    paper = study.pick(MEET, REVERSE, gains=PAPER, servo=1.0, delay=0.0)
    base = np.asarray(paper["overshoot"].to_numpy(), dtype=np.float64)
    outcomes, medians = [], []
    for ratio in RATIOS:
        rows = study.pick(TUNING, REVERSE, damping_ratio=ratio)
        values = np.asarray(rows["overshoot"].to_numpy(), dtype=np.float64)
        medians.append(f"{number(float(np.median(values)))} N at {ratio:g}")
        outcomes.append(
            outcome(
                f"damping ratio {ratio:g}",
                rows,
                values / np.maximum(base, 1e-9),
                BETTER,
                stricter=STRICTER,
                looser=LOOSER,
            )
        )
    return Found(
        outcomes,
        f"median overshoot {number(float(np.median(base)))} N at damping ratio 0.06, {medians[2]}",
        f"Median overshoot by damping ratio: {', '.join(medians)}.",
    )


def impedance(study: Study) -> Found:
    """A pushed tool against the ideal."""
    outcomes = []
    for servo in (1.0, STIFF_SERVO):
        for what in ("translation", "rotation"):
            for place in (REGULAR, SINGULAR):
                rows = study.pick(PUSH, REVERSE, servo=servo, place=place)
                outcomes.append(outcome(f"{what}, {place}, servo x {servo:g}", rows, what, IDEAL))
    driven = ""
    if study.has(PUSH_TORQUE):
        for metric in ("none", "inertia"):
            for what in ("translation", "rotation"):
                for place in (REGULAR, SINGULAR):
                    rows = study.pick(PUSH_TORQUE, REVERSE, metric=metric, place=place)
                    label = "" if metric == "none" else ", metric M"
                    outcomes.append(outcome(f"{what}, {place}, torque loop{label}", rows, what, IDEAL))
        rows = study.pick(PUSH_TORQUE, REVERSE, metric="none", place=REGULAR)
        by_torques = outcome("rotation, torque loop", rows, "rotation", IDEAL)
        driven = (
            f" With the law's accelerations by inverse dynamics in the place of the velocity servos, rotation is "
            f"{by_torques.figure('% off', 100.0)} in regular postures."
        )
    turned = study.pick(PUSH, REVERSE, servo=1.0, place=REGULAR)
    rotation = outcome("rotation", turned, "rotation", IDEAL)
    damped = study.pick(PUSH, REVERSE_DAMPED, servo=1.0, place=SINGULAR)
    off = outcome("T_k damped", damped, "translation", IDEAL)
    return Found(
        outcomes,
        f"rotation {rotation.figure('% off the ideal', 100.0)} at default servos, regular postures",
        f"Near singularities with T_k damped by {FIRST_DAMPING:g}, translation is {off.figure('% off', 100.0)}. The law is as "
        "good as the velocity loop below it: the push acts on the joints as well as on the reference." + driven,
    )


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
    example = (
        "Counterexample: J_1 = (1, 1), J_2 = (1, 0), J_3 = (0, 1), v = (1, 0, 0): strict priority gives J_2 x = "
        f"{number(null_space) if abs(null_space) > 1e-12 else '0'}, reverse priority {number(reverse)}, because its last step "
        "disturbs levels 2 and 3 jointly and not in their order."
    )
    return Found(
        outcomes,
        f"second level's error {outcomes[-1].figure('times that of null-space priority')} in the conflict near a singularity",
        "",
        example,
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
    compared = []
    for label in (NULL_SPACE, CASCADE):
        rows = study.pick(CONFLICT, label)
        o = outcome(label, rows, "late_rms", KEPT)
        compared.append(f"{label} {share(o.passed)}")
    late = outcome("late", study.pick(CONFLICT, REVERSE), "late_rms", KEPT)
    words = f"In the conflict at regular postures others keep it in: {', '.join(compared)} of the runs."
    return Found(outcomes, f"late RMS error {late.figure('N')} in the conflict, regular postures", words)


def _label(experiment: str, words: str) -> str:
    where = "near a singularity" if experiment in NEAR else "regular"
    return f"{_words(experiment)}, {where}, {words}"


def improves(study: Study) -> Found:
    """Three levels against methods with and without priority."""
    outcomes: list[Outcome] = []
    words = []
    for experiment, rivals in (
        (WIPE_NEAR, (CLASSICAL, DLS, WEIGHTED, NULL_DAMPED)),
        (CONFLICT_NEAR, (CLASSICAL, DLS, WEIGHTED, NULL_DAMPED)),
    ):
        found, sentence = _against(study, (experiment,), rivals, REVERSE_DAMPED)
        outcomes += found
        words.append(sentence)
    for experiment in (WIPE, CONFLICT):
        mine = study.pick(experiment, REVERSE)
        for rival in (CLASSICAL, DLS, WEIGHTED):
            ratio = force_error(mine) / np.maximum(force_error(study.pick(experiment, rival)), 1e-9)
            label = f"{experiment}, regular, than {rival}"
            outcomes.append(outcome(label, mine, ratio, BETTER, stricter=STRICTER, looser=LOOSER))
    conflict = next(o for o in outcomes if o.label == f"{CONFLICT}, regular, than {CLASSICAL}")
    return Found(
        outcomes,
        f"force error in the conflict {conflict.figure('times that of the pseudo-inverse')}",
        f"Near singularities, T_k damped: {' '.join(words)}",
    )


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
        f"{off.figure('mm', 1e3)} off the path with friction {FRICTIONS[-1]:g}",
        "Friction pushes along the path, and an impedance yields to it by F / K_d: the law, not a fault of the solver.",
    )
