"""Panels of charts from data frames: what every figure of a comparison is put together from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import polars as pl

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.figures.chart import LOWEST, Line, Lines, thinned
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.variant import GROUPS
from hqp_rp.scenarios.scenario import Scenario

ERROR_FLOOR, ERROR_CEILING = 1e-17, 1e8
NORM_FLOOR, NORM_CEILING = 1e-4, 1e14
OTHER_FLOOR = 1e-12
VIOLATION_FLOOR = 1e-9


def grouped(contestants: Sequence[Contestant]) -> list[tuple[str, list[str]]]:
    """(group, labels), in the order of `GROUPS`, groups without a contestant left out."""
    found = [(group, [item.label for item in contestants if item.group == group]) for group in GROUPS]
    return [(group, labels) for group, labels in found if labels]


def slug(*parts: str) -> str:
    """The name of a figure's file from what it shows, empty parts left out."""
    text = "-".join(part for part in parts if part)
    return "".join(letter for letter in text if letter not in ",'").replace("_", "-").replace(" ", "-")


def grid(
    scenario: Scenario,
    case: str,
    contestants: Sequence[Contestant],
    *,
    kind: str,
    title: str,
    caption: str,
    x_label: str,
    rows: Sequence[str],
    panels: Sequence[dict[str, Line]],
    log_x: bool = False,
    reverse_x: bool = False,
    log_y: Sequence[bool] | None = None,
    marks: tuple[tuple[float, str], ...] = (),
    reach: Sequence[float] = (),
) -> Lines:
    """A chart with one column for each group that has a curve and one row for each of `rows`."""
    name = type(scenario).name
    drawn = {label for row in panels for label in row}
    groups = [(group, labels) for group, labels in grouped(contestants) if drawn & set(labels)]
    errors = [row.endswith("excess error") for row in rows]
    labelled = list(zip(rows, errors, strict=True))
    return Lines(
        name=slug(name, kind, case),
        title=f"{title} ({words(name)}{', ' + case if case else ''})",
        caption=caption,
        x_label=x_label,
        columns=tuple(group for group, _ in groups),
        rows=tuple(rows),
        panels=tuple(
            tuple(tuple(row[label] for label in labels if label in row) for _, labels in groups) for row in panels
        ),
        log_x=log_x,
        reverse_x=reverse_x,
        log_y=tuple(log_y) if log_y is not None else (True,) * len(rows),
        floor=tuple(ERROR_FLOOR if error else _floor(row) for row, error in labelled),
        ceiling=tuple(ERROR_CEILING if error else NORM_CEILING for error in errors),
        marks=marks,
        reach=tuple(reach),
    )  # fmt: skip


def _floor(row: str) -> float:
    if "violation" in row:
        return VIOLATION_FLOOR
    return NORM_FLOOR if row == "|x|" else OTHER_FLOOR


def curves(table: pl.DataFrame, contestants: Sequence[Contestant]) -> dict[str, Line]:
    """y along the path, thinned without losing a peak."""
    found = {}
    for label, part in by_contestant(table.drop_nulls(), contestants):
        y = array(part["y"])
        chosen = thinned(y)
        sure = (y > array(part["uncertainty"]))[chosen] if "uncertainty" in part.columns else None
        found[label] = Line(label, array(part["parameter"])[chosen], y[chosen], sure=sure)
    return found


def by_contestant(table: pl.DataFrame, contestants: Sequence[Contestant]) -> list[tuple[str, pl.DataFrame]]:
    """(label, rows) in the order of the line-up, those without rows left out."""
    parts = [(item.label, table.filter(pl.col("contestant") == item.label)) for item in contestants]
    return [(label, part) for label, part in parts if part.height]


def level_names(levels: pl.DataFrame) -> list[str]:
    """The names of the levels, most important first."""
    return levels.group_by("level").agg(pl.col("name").first()).sort("level")["name"].to_list()


def error_rows(names: Sequence[str]) -> list[str]:
    """Row labels of the excess errors of these levels."""
    return [f"{k + 1}: {name}\nexcess error" for k, name in enumerate(names)]


def array(series: pl.Series) -> FloatArray:
    """A column as floats."""
    return series.cast(pl.Float64).to_numpy().astype(np.float64)


def words(name: str) -> str:
    """A scenario's name in words."""
    return name.replace("_", " ")


def wide(values: FloatArray) -> bool:
    """Whether values are positive but for a few, and spread over so many decades that they need a log axis."""
    low = float(np.quantile(values, LOWEST, method="lower"))
    return low > 0.0 and float(values.max()) > 300.0 * low


def broken(label: str) -> str:
    """A long row label on two lines."""
    parts = label.split()
    if len(label) <= 18 or len(parts) < 2:
        return label
    cut = min(range(1, len(parts)), key=lambda i: abs(len(" ".join(parts[:i])) - len(" ".join(parts[i:]))))
    return " ".join(parts[:cut]) + "\n" + " ".join(parts[cut:])
