"""From free motion into contact with a stiff wall: the first impact, the rest, and what B_d changes."""

from __future__ import annotations

import numpy as np

from hqp_rp.compare.claims.experiments import DELAYS, MEET, NOISE, NOISES, RATIOS, TUNING
from hqp_rp.compare.claims.judges.criteria import BETTER, GENTLE, LOOSER, RESTS, STRICTER
from hqp_rp.compare.claims.judges.study import Found, Study, median_peak
from hqp_rp.compare.claims.methods import REVERSE
from hqp_rp.compare.claims.outcomes import Outcome, outcome
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.scenarios._interaction import DAMPED, PAPER

say = Sentences(__file__)


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
        say("close_approach_words", bouncing=bouncing, stiff_peak=median_peak(stiff)),
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
