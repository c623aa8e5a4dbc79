"""The curves of the drawn runs, equal ones drawn once under all their names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import polars as pl

from hqp_rp.compare.claims.trials import Trial
from hqp_rp.compare.figures.chart import Line, Lines, thinned
from hqp_rp.core.problem import FloatArray

EQUAL = 1e-3
"""Two curves are drawn as one when they differ by less than this share of the panel's range."""


class Curves:
    """The drawn runs by experiment: each trial with its steps."""

    def __init__(self, trials: Sequence[Trial], steps: Sequence[pl.DataFrame]) -> None:
        self._runs = list(zip(trials, steps, strict=True))

    def of(self, experiment: str) -> list[tuple[Trial, pl.DataFrame]]:
        """The runs of one experiment."""
        return [(trial, steps) for trial, steps in self._runs if trial.experiment == experiment]


def over_time(steps: pl.DataFrame, column: str) -> tuple[FloatArray, FloatArray]:
    """Time, s, and a column of the steps, (N,) each."""
    x, y = (np.asarray(steps[name].cast(pl.Float64).to_numpy(), dtype=np.float64) for name in ("time", column))
    return x, y


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


def panels_of(
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
