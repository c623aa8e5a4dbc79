"""Every method beside singularities of the lower levels: over its damping, within velocity limits, step by step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hqp_rp.compare.claims import shown
from hqp_rp.compare.claims.charts.curves import Curves, merged, over_time, panels_of
from hqp_rp.compare.claims.charts.styles import COLUMNS, DESIRED, GROUPS
from hqp_rp.compare.claims.experiments import CONFLICT_NEAR, CORNER, LIMITED_CONFLICT, LIMITED_CORNER, POSTURES
from hqp_rp.compare.claims.judges.study import Study, force_error, without_near
from hqp_rp.compare.claims.methods import FIRST_DAMPING, NULL_SPACE, REVERSE, SWEPT, WITHIN_LIMITS
from hqp_rp.compare.figures.chart import Dots, Line, Lines
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.scenarios._interaction import DAMPED

say = Sentences(__file__)

_SWEPT_ROWS = (("RMS error of F_x (N)", True), ("peak F_x (N)", True), ("largest |x| (rad/s)", True))
_SPEED = ("commanded speed [rad/s]", "|x| asked for (rad/s)", True)


def sweep(study: Study, experiment: str) -> Lines:
    """Every method over its damping: force error, peak and joint velocity, medians over the postures."""
    columns = []
    for group in GROUPS:
        found = [_swept(study, experiment, label) for label in group if study.dampings(experiment, label)]
        columns.append([tuple(lines[r] for lines in found) for r in range(len(_SWEPT_ROWS))])
    panels = list(zip(*columns, strict=True))
    words = without_near(experiment)
    return panels_of(
        f"sweep-{words}",
        say("sweep_title", experiment=words),
        say("sweep_caption", postures=POSTURES),
        COLUMNS,
        _SWEPT_ROWS,
        panels,
        x_label="damping",
        log_x=True,
    )


def _swept(study: Study, experiment: str, label: str) -> list[Line]:
    """Median and quartiles of a method over its dampings, for each of `_SWEPT_ROWS`; a level line where it has none."""
    points = []
    for damping in study.dampings(experiment, label):
        rows = study.pick(experiment, label, damping, gains=DAMPED)
        figures = (force_error(rows), rows["peak"].to_numpy(), rows["commanded"].to_numpy())
        points.append([np.quantile(f, (0.25, 0.5, 0.75)) for f in figures])
    x = np.array(study.dampings(experiment, label)) if label in SWEPT else np.array((0.01, 0.3))
    together = np.array(points if label in SWEPT else [points[0], points[0]])
    return [Line(label, x, middle, low, high) for low, middle, high in together.transpose(1, 2, 0)]


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
    for group in GROUPS:
        found = merged(
            [
                {trial.method.label: over_time(steps, column) for trial, steps in runs if trial.method.label in group}
                for column, _, _ in rows
            ]
        )
        for r, (column, _, _) in enumerate(rows):
            if column.startswith("force"):
                found[r] += merged([{DESIRED: over_time(runs[0][1], f"desired {column}")}])[0]
        columns.append(found)
    labels = [(label, log) for _, label, log in rows]
    return panels_of(experiment, title, caption, COLUMNS, labels, list(zip(*columns, strict=True)))
