"""The figures of the claims report, from the rows of all trials and the curves of a few."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import polars as pl

from hqp_rp.compare.claims import shown
from hqp_rp.compare.claims.experiments import (
    BODE,
    CONFLICT,
    CONFLICT_NEAR,
    CORNER,
    DELAY_MAP,
    DELAYS,
    LIMITED_CONFLICT,
    LIMITED_CORNER,
    NEAR,
    POSTURES,
    PUSH,
    SERVO_MAP,
    SERVOS,
    STIFF_SERVO,
    STIFFNESSES,
    SWEEP_OF_SINES,
    WIPE,
)
from hqp_rp.compare.claims.ideal import delay_margin, ideal_contact
from hqp_rp.compare.claims.judges.study import Study, force_error
from hqp_rp.compare.claims.methods import (
    CASCADE,
    CLASSICAL,
    DLS,
    DLS_VARIABLE,
    FIRST_DAMPING,
    FIXED,
    NULL_DAMPED,
    NULL_SPACE,
    NULL_VARIABLE,
    REVERSE,
    REVERSE_DAMPED,
    REVERSE_EVERYWHERE,
    REVERSE_VARIABLE,
    ROBUST,
    SWEPT,
    UNILATERAL,
    WEIGHTED,
    WITHIN_LIMITS,
)
from hqp_rp.compare.claims.trials import Trial
from hqp_rp.compare.figures.chart import Chart, Dots, Grid, Line, Lines, Style, styles, thinned
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number
from hqp_rp.control._checks import TWIST_AXES
from hqp_rp.core.problem import FloatArray
from hqp_rp.scenarios._interaction import DAMPED, DAMPING, INERTIA, PAPER, REGULAR, SINGULAR
from hqp_rp.scenarios.sawyer_wall_contact import SawyerWallContact

say = Sentences(__file__)

DESIRED, LAW = "desired", "the law alone"
EQUAL = 1e-3
"""Two curves are drawn as one when they differ by less than this share of the panel's range."""

_GROUPS = (
    (REVERSE, REVERSE_DAMPED, REVERSE_VARIABLE, REVERSE_EVERYWHERE, UNILATERAL),
    (NULL_SPACE, NULL_DAMPED, NULL_VARIABLE, CASCADE, ROBUST),
    (CLASSICAL, DLS, DLS_VARIABLE, WEIGHTED),
)
_COLUMNS = ("reverse priority", "other priorities", "no priority")


def chart_styles(charts: Sequence[Chart]) -> dict[str, Style]:
    """A style for every label in the charts; a label of several methods has that of the first."""
    known = dict(styles(_GROUPS))
    known |= {DESIRED: Style("#888888", "dot", 3), LAW: Style("#888888", "dash", 3)}
    plain = dict(styles([[*(label for label in _labels(charts) if label.split(" = ")[0] not in known)]]))
    return known | plain | {label: known[label.split(" = ")[0]] for label in _labels(charts) if " = " in label}


def _labels(charts: Sequence[Chart]) -> list[str]:
    found: dict[str, None] = {}
    for chart in charts:
        if isinstance(chart, Lines):
            found |= {line.label: None for row in chart.panels for panel in row for line in panel}
        elif isinstance(chart, Dots):
            found |= dict.fromkeys(chart.labels)
    return list(found)


def merged(rows: Sequence[Mapping[str, tuple[FloatArray, FloatArray]]]) -> list[tuple[Line, ...]]:
    """The curves of a column of panels, label -> (x, y) in each row, as lines.

    Of labels whose curves are equal in every row, within `EQUAL` of the row's range, one is drawn, under all their names.
    """
    room = [EQUAL * float(np.ptp(np.concatenate([y for _, y in row.values()]))) for row in rows]
    together: list[list[str]] = []
    for label in dict.fromkeys(label for row in rows for label in row):
        for names in together:
            if all(_equal(row, names[0], label, near) for row, near in zip(rows, room, strict=True)):
                names.append(label)
                break
        else:
            together.append([label])
    found = []
    for row in rows:
        lines = []
        for names in together:
            if names[0] in row:
                x, y = row[names[0]]
                chosen = thinned(y)
                lines.append(Line(" = ".join(names), x[chosen], y[chosen]))
        found.append(tuple(lines))
    return found


def _equal(row: Mapping[str, tuple[FloatArray, FloatArray]], a: str, b: str, near: float) -> bool:
    if (a in row) != (b in row):
        return False
    if a not in row:
        return True
    (x, y), (other_x, other_y) = row[a], row[b]
    return len(x) == len(other_x) and not np.any(x != other_x) and bool(np.abs(y - other_y).max() <= near)


class Curves:
    """The drawn runs by experiment: each trial with its steps."""

    def __init__(self, trials: Sequence[Trial], steps: Sequence[pl.DataFrame]) -> None:
        self._runs = list(zip(trials, steps, strict=True))

    def of(self, experiment: str) -> list[tuple[Trial, pl.DataFrame]]:
        """The runs of one experiment."""
        return [(trial, steps) for trial, steps in self._runs if trial.experiment == experiment]


def _xy(steps: pl.DataFrame, column: str) -> tuple[FloatArray, FloatArray]:
    x, y = (np.asarray(steps[name].cast(pl.Float64).to_numpy(), dtype=np.float64) for name in ("time", column))
    return x, y


def _lines(
    name: str,
    title: str,
    caption: str,
    columns: Sequence[str],
    rows: Sequence[tuple[str, bool]],
    panels: Sequence[Sequence[tuple[Line, ...]]],
    *,
    x_label: str = "time (s)",
    log_x: bool = False,
) -> Lines:
    """Panels by row and column; of each row its label and whether its axis is logarithmic."""
    return Lines(
        name,
        title,
        caption,
        x_label,
        tuple(columns),
        tuple(label for label, _ in rows),
        tuple(tuple(row) for row in panels),
        log_x=log_x,
        log_y=tuple(log for _, log in rows),
        floor=(1e-3,) * len(rows),
        ceiling=(1e5,) * len(rows),
    )


def push_curves(curves: Curves) -> Lines:
    """How the tool moves when it is pushed, against the ideal, with two servo gains."""
    runs = curves.of(shown.PUSHED)
    rows = (("x (mm)", "x", 1e3), ("z (mm)", "z", 1e3), ("turn about z (mrad)", "rz", 1e3))
    columns = []
    for _, steps in runs:
        column = []
        for _, axis, scale in rows:
            x, y = _xy(steps, f"deviation {axis}")
            _, ideal = _xy(steps, f"ideal {axis}")
            column.append({LAW: (x, scale * ideal), REVERSE: (x, scale * y)})
        columns.append(merged(column))
    return _lines(
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
                {DESIRED: _xy(steps, f"desired force {axis} [N]"), REVERSE: _xy(steps, f"force {axis} [N]")}
                for axis in "xy"
            ]
        )
        for _, steps in runs
    ]
    return _lines(
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
    return _lines(
        "bode",
        say("bode_title"),
        say("bode_caption"),
        (PAPER, DAMPED),
        (("gain", False), ("lag (ms)", False)),
        panels,
        x_label="frequency (Hz)",
        log_x=True,
    )


def wall_curves(curves: Curves) -> Lines:
    """The approach to the wall with two servo gains and two sets of gains, beside the law alone."""
    runs = curves.of(shown.MET)
    panels: list[tuple[Line, ...]] = []
    columns = []
    for trial, steps in runs:
        time, force = ideal_contact(INERTIA[0], _damping(trial.gains, 1e5), 1e5, 30.0, 0.01, 2.0)
        alone = (time[::100], force[::100])
        own = {LAW: alone, DESIRED: _xy(steps, "desired force x [N]"), REVERSE: _xy(steps, "force x [N]")}
        panels += merged([own])
        columns.append(f"{trial.gains}, servo x {trial.scenario.servo:g}")
    return _lines(
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


_SWEPT_ROWS = (("RMS error of F_x (N)", True), ("peak F_x (N)", True), ("largest |x| (rad/s)", True))


def sweep(study: Study, experiment: str) -> Lines:
    """Every method over its damping: force error, peak and joint velocity, medians over the postures."""
    panels: list[list[tuple[Line, ...]]] = [[] for _ in _SWEPT_ROWS]
    for group in _GROUPS:
        found: list[list[Line]] = [[] for _ in _SWEPT_ROWS]
        for label in group:
            dampings = study.dampings(experiment, label)
            if not dampings:
                continue
            points = []
            for damping in dampings:
                rows = study.pick(experiment, label, damping, gains=DAMPED)
                figures = (force_error(rows), rows["peak"].to_numpy(), rows["commanded"].to_numpy())
                points.append([np.quantile(f, (0.25, 0.5, 0.75)) for f in figures])
            x = np.array(dampings) if label in SWEPT else np.array((0.01, 0.3))
            together = np.array(points if label in SWEPT else [points[0], points[0]])
            for r in range(len(_SWEPT_ROWS)):
                low, middle, high = together[:, r].T
                found[r].append(Line(label, x, middle, low, high))
        for r, lines in enumerate(found):
            panels[r].append(tuple(lines))
    words = experiment.replace(", near", "")
    return _lines(
        f"sweep-{words}",
        say("sweep_title", experiment=words),
        say("sweep_caption", postures=POSTURES),
        _COLUMNS,
        _SWEPT_ROWS,
        panels,
        x_label="damping",
        log_x=True,
    )


def shortened_or_told(study: Study) -> Dots:
    """The force, where the command is shortened to the velocity limits and where the solver is told of them."""
    labels = (f"{REVERSE}, shortened", f"{NULL_SPACE}, shortened", *(f"{label}, told" for label in WITHIN_LIMITS))
    values = []
    for near, told in ((CORNER, LIMITED_CORNER), (CONFLICT_NEAR, LIMITED_CONFLICT)):
        own = {f"{label}, shortened": study.pick(near, label, gains=DAMPED) for label in (REVERSE, NULL_SPACE)}
        own |= {f"{label}, told": study.pick(told, label) for label in WITHIN_LIMITS}
        values.append({label: np.maximum(rows["late_rms"].to_numpy(), 1e-3) for label, rows in own.items()})
    return Dots(
        "limits",
        say("limits_title"),
        say("limits_caption"),
        "late RMS error of F_x (N)",
        ("corner", "conflict"),
        (("shortened", labels[:2]), ("told", labels[2:])),
        tuple(values),
        absent="ended early",
        log_x=True,
    )


def three_levels(study: Study) -> Dots:
    """Force and second level of three, at regular postures, by method."""
    methods = (*(label for label in FIXED if study.pick(WIPE, label).height), DLS)
    values, columns = [], []
    for experiment in (WIPE, CONFLICT):
        for what, scale, words in (("rms", 1.0, "RMS error of F_x (N)"), ("position", 1e3, "second level (mm)")):
            own = {}
            for label in methods:
                rows = study.pick(experiment, label)
                figures = force_error(rows) if what == "rms" else rows["position"].to_numpy()
                own[label] = np.maximum(scale * figures, 1e-2)
            values.append(own)
            columns.append(f"{experiment}: {words}")
    return Dots(
        "three-levels",
        say("three_levels_title"),
        say("three_levels_caption"),
        "N, or mm",
        tuple(columns),
        (("", methods),),
        tuple(values),
        absent="ended early",
        log_x=True,
    )


_SPEED = ("commanded speed [rad/s]", "|x| asked for (rad/s)", True)


def corner_curves(curves: Curves) -> Lines:
    """A corner of two walls beside a singularity of the second level, with every method."""
    rows = (("force x [N]", "F_x (N)", False), ("force y [N]", "F_y (N)", False), _SPEED)
    return _near(curves, shown.CORNERED, say("corner_title"), say("corner_caption", damping=FIRST_DAMPING), rows)


def wipe_curves(curves: Curves) -> Lines:
    """A wipe through a singularity of the orientation, with every method."""
    rows = (("force x [N]", "F_x (N)", False), ("position error y [m]", "error in y (m)", False), _SPEED)
    return _near(curves, shown.WIPED, say("wipe_title"), say("wipe_caption", damping=FIRST_DAMPING), rows)


def conflict_curves(curves: Curves) -> Lines:
    """Force against a point that moves out of reach, beside a singularity, with every method."""
    rows = (("force x [N]", "F_x (N)", False), ("position error z [m]", "error in z (m)", False), _SPEED)
    return _near(curves, shown.CONFLICTED, say("conflict_title"), say("conflict_caption", damping=FIRST_DAMPING), rows)


def _near(curves: Curves, experiment: str, title: str, caption: str, rows: Sequence[tuple[str, str, bool]]) -> Lines:
    """One run beside a singularity with the methods in their groups; equal curves are drawn once and said to be equal.

    rows: column of the steps, label, whether its axis is logarithmic.
    """
    runs = curves.of(experiment)
    columns = []
    for group in _GROUPS:
        found = merged(
            [
                {trial.method.label: _xy(steps, column) for trial, steps in runs if trial.method.label in group}
                for column, _, _ in rows
            ]
        )
        for r, (column, _, _) in enumerate(rows):
            if column.startswith("force"):
                found[r] += merged([{DESIRED: _xy(runs[0][1], f"desired {column}")}])[0]
        columns.append(found)
    labels = [(label, log) for _, label, log in rows]
    return _lines(experiment, title, caption, _COLUMNS, labels, list(zip(*columns, strict=True)))


def tilted_curves(curves: Curves) -> Lines:
    """Force and path along a tilted wall, without and with friction."""
    runs = curves.of(shown.TILTED)
    columns = [
        merged(
            [
                {DESIRED: _xy(steps, "desired force x [N]"), REVERSE: _xy(steps, "force x [N]")},
                {REVERSE: _scaled(_xy(steps, "position error along [m]"), 1e3)},
            ]
        )
        for _, steps in runs
    ]
    return _lines(
        "tilted-wipe",
        say("tilted_wipe_title"),
        say("tilted_wipe_caption"),
        [f"friction {trial.scenario.friction:g}" for trial, _ in runs],
        [("force across (N)", False), ("error along the path (mm)", False)],
        list(zip(*columns, strict=True)),
    )


def _scaled(xy: tuple[FloatArray, FloatArray], factor: float) -> tuple[FloatArray, FloatArray]:
    return xy[0], factor * xy[1]


def evidence(study: Study, curves: Curves) -> dict[str, list[Chart]]:
    """Title of a section -> its charts; those whose experiments were not run are left out."""
    has = study.has
    found: dict[str, list[Chart]] = {
        "Pushed": [push_curves(curves), *([push_dots(study)] if has(PUSH) else [])],
        "Tracking": [tracking_curves(curves), bode(study)] if has(SWEEP_OF_SINES) else [],
        "At the wall": [wall_curves(curves)],
        "Beside singularities": [corner_curves(curves), wipe_curves(curves), conflict_curves(curves)],
        "Three levels": [tilted_curves(curves), *([three_levels(study)] if has(WIPE, CONFLICT) else [])],
    }
    if has(SERVO_MAP, DELAY_MAP):
        found["At the wall"] += [
            servo_map(study),
            delay_map(study, STIFF_SERVO, PAPER),
            delay_map(study, STIFF_SERVO, DAMPED),
            delay_map(study, 1.0, PAPER),
        ]
    if has(*NEAR):
        found["Beside singularities"] += [sweep(study, name) for name in NEAR]
    if has(LIMITED_CORNER, LIMITED_CONFLICT):
        found["Beside singularities"].append(shortened_or_told(study))
    return {title: charts for title, charts in found.items() if charts}
