"""Into contact with a wall, and maps of peak and rest over its stiffness."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hqp_rp.compare.claims import shown
from hqp_rp.compare.claims.charts.curves import Curves, merged, over_time, panels_of
from hqp_rp.compare.claims.charts.styles import DESIRED, LAW
from hqp_rp.compare.claims.experiments import DELAY_MAP, DELAYS, SERVO_MAP, SERVOS, STIFFNESSES
from hqp_rp.compare.claims.ideal import delay_margin, ideal_contact
from hqp_rp.compare.claims.judges.study import Study
from hqp_rp.compare.claims.methods import REVERSE
from hqp_rp.compare.figures.chart import Grid, Line, Lines
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number
from hqp_rp.core.problem import FloatArray
from hqp_rp.scenarios._interaction import DAMPING, INERTIA, PAPER
from hqp_rp.scenarios.sawyer_wall_contact import SawyerWallContact

say = Sentences(__file__)


def wall_curves(curves: Curves) -> Lines:
    """The approach to the wall with two servo gains and two sets of gains, beside the law alone."""
    runs = curves.of(shown.MET)
    panels: list[tuple[Line, ...]] = []
    columns = []
    for trial, steps in runs:
        time, force = ideal_contact(INERTIA[0], _damping(trial.gains, 1e5), 1e5, 30.0, 0.01, 2.0)
        alone = (time[::100], force[::100])
        own = {LAW: alone, DESIRED: over_time(steps, "desired force x [N]"), REVERSE: over_time(steps, "force x [N]")}
        panels += merged([own])
        columns.append(f"{trial.gains}, servo x {trial.scenario.servo:g}")
    return panels_of(
        "wall",
        say("wall_title"),
        say("wall_caption"),
        columns,
        [("F_x (N)", False)],
        [panels],
    )


def servo_map(study: Study) -> Grid:
    """Peak force over that of the law alone, by servo gain and stiffness."""
    values = np.empty((len(SERVOS), len(STIFFNESSES)))
    for c, stiffness in enumerate(STIFFNESSES):
        ideal = float(ideal_contact(INERTIA[0], DAMPING[0], stiffness, 30.0, 0.01, 1.0)[1].max())
        for r, servo in enumerate(SERVOS):
            rows = study.pick(SERVO_MAP, REVERSE, servo=servo, stiffness=stiffness)
            values[r, c] = float(np.median(rows["peak"].to_numpy())) / ideal
    return _by_stiffness(
        "servo-map",
        say("servo_map_title"),
        say("servo_map_caption"),
        ("servo gain, times the default", SERVOS),
        values,
        (0.2, 5.0, "peak over ideal peak"),
    )


def delay_map(study: Study, servo: float, gains: str) -> Grid:
    """Force error at the end, by delay of the reading and stiffness, with the margin of theory drawn in."""
    values = np.empty((len(DELAYS), len(STIFFNESSES)))
    margins = []
    for c, stiffness in enumerate(STIFFNESSES):
        margins.append(delay_margin(INERTIA[0], _damping(gains, stiffness), stiffness))
        for r, delay in enumerate(DELAYS):
            rows = study.pick(DELAY_MAP, REVERSE, servo=servo, gains=gains, stiffness=stiffness, delay=delay)
            values[r, c] = max(float(np.median(rows["late_rms"].to_numpy())), 1e-3)
    places = np.interp(margins, DELAYS, np.arange(len(DELAYS)), right=len(DELAYS) - 0.5)
    return _by_stiffness(
        f"delay-map-{'paper' if gains == PAPER else 'damped'}-{servo:g}",
        say("delay_map_title", gains=gains, servo=servo),
        say("delay_map_caption"),
        ("delay (ms)", [1e3 * delay for delay in DELAYS]),
        values,
        (0.03, 30.0, "late RMS error (N)"),
        ("delay margin of the law alone", np.arange(len(STIFFNESSES), dtype=np.float64), places),
    )


def _by_stiffness(
    name: str,
    title: str,
    caption: str,
    rows: tuple[str, Sequence[float]],
    values: FloatArray,
    scale: tuple[float, float, str],
    line: tuple[str, FloatArray, FloatArray] | None = None,
) -> Grid:
    """A map over the walls' stiffnesses: what varies over its rows, and both ends and the words of its colours."""
    across = tuple(f"{stiffness:.0e}".replace("e+0", "e") for stiffness in STIFFNESSES)
    texts = tuple(tuple(number(value) for value in row) for row in values.tolist())
    y_label, settings = rows
    up = tuple(f"{setting:g}" for setting in settings)
    return Grid(name, title, caption, "wall stiffness (N/m)", y_label, across, up, values, texts, *scale, line)


def _damping(gains: str, stiffness: float) -> float:
    """N s/m: B_d of a set of gains across a wall of this stiffness, N/m."""
    scenario = SawyerWallContact(stiffness=stiffness)
    case = next(case for case in scenario.cases() if case.gains == gains)
    return float(scenario.gains(case, "x").B_d[0])
