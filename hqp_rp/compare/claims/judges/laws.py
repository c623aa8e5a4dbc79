"""What the laws do where no level is in another's way: an alternating force, a push, a path along a wall."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.compare.claims.experiments import (
    FRICTIONS,
    HYBRID,
    PUSH,
    PUSH_TORQUE,
    SINE,
    STIFF_SERVO,
    TRACK,
    TRACK_FAST,
    TRACK_TORQUE,
)
from hqp_rp.compare.claims.judges.criteria import ALTERNATING, IDEAL, KEPT, ON_PATH
from hqp_rp.compare.claims.judges.study import Found, Study
from hqp_rp.compare.claims.methods import FIRST_DAMPING, REVERSE, REVERSE_DAMPED
from hqp_rp.compare.claims.outcomes import Outcome, outcome
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.scenarios._interaction import DAMPED, PAPER, REGULAR, SINGULAR

say = Sentences(__file__)


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
