"""What the laws do: a pushed tool against the ideal, an alternating force, its Bode figure, a path along a wall."""

from __future__ import annotations

import numpy as np

from hqp_rp.compare.claims import shown
from hqp_rp.compare.claims.charts.curves import Curves, merged, over_time, panels_of
from hqp_rp.compare.claims.charts.styles import DESIRED, LAW
from hqp_rp.compare.claims.experiments import BODE, PUSH, STIFF_SERVO, SWEEP_OF_SINES
from hqp_rp.compare.claims.judges.study import Study
from hqp_rp.compare.claims.methods import REVERSE
from hqp_rp.compare.figures.chart import Dots, Line, Lines
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.control._checks import TWIST_AXES
from hqp_rp.core.problem import FloatArray
from hqp_rp.scenarios._interaction import DAMPED, PAPER, REGULAR, SINGULAR

say = Sentences(__file__)


def push_curves(curves: Curves) -> Lines:
    """How the tool moves when it is pushed, against the ideal, with two servo gains."""
    runs = curves.of(shown.PUSHED)
    rows = (("x (mm)", "x", 1e3), ("z (mm)", "z", 1e3), ("turn about z (mrad)", "rz", 1e3))
    columns = []
    for _, steps in runs:
        column = []
        for _, axis, scale in rows:
            x, y = over_time(steps, f"deviation {axis}")
            _, ideal = over_time(steps, f"ideal {axis}")
            column.append({LAW: (x, scale * ideal), REVERSE: (x, scale * y)})
        columns.append(merged(column))
    return panels_of(
        "push",
        say("push_title"),
        say("push_caption"),
        [f"servo x {trial.scenario.servo:g}" for trial, _ in runs],
        [(label, False) for label, _, _ in rows],
        list(zip(*columns, strict=True)),
    )


def push_dots(study: Study) -> Dots:
    """How far from the ideal, by axis and servo gain."""
    labels = [f"{axis}, servo x {servo:g}" for servo in (1.0, STIFF_SERVO) for axis in TWIST_AXES]
    values = []
    for place in (REGULAR, SINGULAR):
        own: dict[str, FloatArray] = {}
        for servo in (1.0, STIFF_SERVO):
            rows = study.pick(PUSH, REVERSE, servo=servo, place=place)
            for axis in TWIST_AXES:
                own[f"{axis}, servo x {servo:g}"] = np.asarray(rows[f"off {axis}"].to_numpy(), dtype=np.float64)
        values.append(own)
    half = len(labels) // 2
    return Dots(
        "push-by-axis",
        say("push_by_axis_title"),
        say("push_by_axis_caption"),
        "times the ideal's largest motion",
        (REGULAR, SINGULAR),
        (("default servos", tuple(labels[:half])), ("stiff servos", tuple(labels[half:]))),
        tuple(values),
        absent="ended early",
        log_x=True,
    )


def tracking_curves(curves: Curves) -> Lines:
    """Two periods of (54)."""
    runs = curves.of(shown.TRACKED)
    columns = [
        merged(
            [
                {DESIRED: over_time(steps, f"desired force {axis} [N]"), REVERSE: over_time(steps, f"force {axis} [N]")}
                for axis in "xy"
            ]
        )
        for _, steps in runs
    ]
    return panels_of(
        "tracking",
        say("tracking_title"),
        say("tracking_caption"),
        [trial.gains for trial, _ in runs],
        [("F_x (N)", False), ("F_y (N)", False)],
        list(zip(*columns, strict=True)),
    )


def bode(study: Study) -> Lines:
    """Gain and lag of the force loop against frequency."""
    panels: list[list[tuple[Line, ...]]] = [[], []]
    x = np.array(BODE)
    for gains in (PAPER, DAMPED):
        rows = study.pick(SWEEP_OF_SINES, REVERSE, gains=gains)
        for r, (what, scale, perfect) in enumerate((("gain", 1.0, 1.0), ("lag", 1e3, 0.0))):
            values = scale * np.array([rows[f"{what} {k}"].to_numpy() for k in range(len(BODE))])
            middle, low, high = np.median(values, axis=1), values.min(axis=1), values.max(axis=1)
            panels[r].append((Line(REVERSE, x, middle, low, high), Line(DESIRED, x, np.full(len(x), perfect))))
    return panels_of(
        "bode",
        say("bode_title"),
        say("bode_caption"),
        (PAPER, DAMPED),
        (("gain", False), ("lag (ms)", False)),
        panels,
        x_label="frequency (Hz)",
        log_x=True,
    )


def tilted_curves(curves: Curves) -> Lines:
    """Force and path along a tilted wall, without and with friction."""
    runs = curves.of(shown.TILTED)
    columns = [
        merged(
            [
                {DESIRED: over_time(steps, "desired force x [N]"), REVERSE: over_time(steps, "force x [N]")},
                {REVERSE: _scaled(over_time(steps, "position error along [m]"), 1e3)},
            ]
        )
        for _, steps in runs
    ]
    return panels_of(
        "tilted-wipe",
        say("tilted_wipe_title"),
        say("tilted_wipe_caption"),
        [f"friction {trial.scenario.friction:g}" for trial, _ in runs],
        [("force across (N)", False), ("error along the path (mm)", False)],
        list(zip(*columns, strict=True)),
    )


def _scaled(xy: tuple[FloatArray, FloatArray], factor: float) -> tuple[FloatArray, FloatArray]:
    return xy[0], factor * xy[1]
