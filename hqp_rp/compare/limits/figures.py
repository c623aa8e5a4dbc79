"""The charts of a scenario with limits: who broke which limit by how much, when, and what the levels missed meanwhile."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import polars as pl

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.figures.chart import Chart, Dots, Lines
from hqp_rp.compare.figures.panels import (
    ERROR_FLOOR,
    VIOLATION_FLOOR,
    array,
    broken,
    curves,
    error_rows,
    grid,
    grouped,
    slug,
    wide,
)
from hqp_rp.compare.limits.cases import CHANGE, COUNTS, LimitCase, quantities
from hqp_rp.compare.report.sentences import Sentences

_LEFT = "position limit violation left [rad]"
_ALL = "position limit violation [rad]"
_DISTANCE = "smallest distance [m]"

say = Sentences(__file__)


def limit_charts(
    case: LimitCase, contestants: Sequence[Contestant], levels: pl.DataFrame, measured: pl.DataFrame
) -> list[Chart]:
    """Every chart of one case; the frames may hold others too."""
    name = type(case.case.scenario).name
    mine = (pl.col("scenario") == name) & (pl.col("case") == case.case.name)
    levels, measured = levels.filter(mine), measured.filter(mine)
    if not measured.height:
        return []
    first = measured.filter(pl.col("seed") == measured["seed"].min())
    broken_kinds = list(
        dict.fromkeys(v.quantity for outcome in case.answered for v in outcome.violations if not v.kept)
    )
    charts: list[Chart] = [
        *([_largest(case, contestants, measured)] if broken_kinds else []),
        _over_time(case, contestants, first, broken_kinds),
        _errors(case, contestants, first),
        _room(case, contestants, levels),
    ]
    outside = measured.filter((pl.col("quantity") == _LEFT) & (pl.col("value") > COUNTS))["seed"].unique().sort()
    if outside.len():
        back = max(
            (outcome.back or case.duration for outcome in case.answered if outcome.outside), default=case.duration
        )
        start = measured.filter((pl.col("seed") == outside[0]) & (pl.col("parameter") <= 3.0 * back))
        charts.append(_way_back(case, contestants, start, int(outside[0])))
    return [chart for chart in charts if not isinstance(chart, Lines) or any(map(any, chart.panels))]


def _largest(case: LimitCase, contestants: Sequence[Contestant], measured: pl.DataFrame) -> Dots:
    """The largest violation of each kind of limit, a dot for each seed."""
    kinds, _ = quantities(measured)
    known = {v.quantity: f"{v.kind} [{v.unit}]" for outcome in case.answered for v in outcome.violations}
    values = []
    for kind in kinds:
        worst = measured.filter(pl.col("quantity") == kind).group_by("contestant", "seed").agg(pl.col("value").max())
        column = {
            str(label): array(worst.filter(pl.col("contestant") == label)["value"])
            for label in worst["contestant"].unique(maintain_order=True)
        }
        values.append({label: np.where(found > COUNTS, found, np.nan) for label, found in column.items()})
    answered = {outcome.label for outcome in case.answered}
    groups = [(group, tuple(label for label in labels if label in answered)) for group, labels in grouped(contestants)]
    return Dots(
        name=_slug(case, "violations"),
        title=say("chart_largest", case=case.case.title),
        caption=say("caption_largest", counts=COUNTS, told=case.told, refused=_refused(case)),
        x_label="largest violation, in the unit of the column",
        columns=tuple(known[kind] for kind in kinds),
        groups=tuple((group, labels) for group, labels in groups if labels),
        values=tuple(values),
        absent="kept",
        log_x=True,
        reverse_x=True,
    )


def _over_time(
    case: LimitCase, contestants: Sequence[Contestant], measured: pl.DataFrame, broken_kinds: Sequence[str]
) -> Lines:
    """Violations over time of the kinds of limit that someone broke, and the smallest distance where one is watched."""
    shown = [*broken_kinds, *([_DISTANCE] if (measured["quantity"] == _DISTANCE).any() else [])]
    return grid(
        case.case.scenario,
        case.case.name,
        contestants,
        kind="limits-over-time",
        title="Limits over time",
        caption=say(
            "caption_over_time",
            floor=VIOLATION_FLOOR,
            counts=COUNTS,
            margin=getattr(case.case.scenario, "margin", None),
            refused=_refused(case),
        ),
        x_label=case.case.scenario.abscissa,
        rows=[broken(name.replace(" added", "")) for name in shown],
        panels=[curves(_quantity(measured, name), contestants) for name in shown],
        log_y=[name != _DISTANCE for name in shown],
        reach=[1e-3 if name != _DISTANCE else 0.0 for name in shown],
    )


def _errors(case: LimitCase, contestants: Sequence[Contestant], measured: pl.DataFrame) -> Lines:
    """The task errors of the levels and the commanded speed over time."""
    _, errors = quantities(measured)
    shown = [*errors, *(name for name in ("commanded speed [rad/s]", CHANGE) if (measured["quantity"] == name).any())]
    tables = [_quantity(measured, name) for name in shown]
    return grid(
        case.case.scenario,
        case.case.name,
        contestants,
        kind="errors-over-time",
        title=say("chart_errors"),
        caption=say("caption_errors_over_time"),
        x_label=case.case.scenario.abscissa,
        rows=[broken(name) for name in shown],
        panels=[curves(table, contestants) for table in tables],
        log_y=[wide(array(table["y"].drop_nulls())) for table in tables],
    )


def _room(case: LimitCase, contestants: Sequence[Contestant], levels: pl.DataFrame) -> Lines:
    """The room that each level was left, over time."""
    first = levels.filter(pl.col("seed") == levels["seed"].min())
    names = case.case.levels
    tables = [
        first.filter(pl.col("level") == k + 1).select(
            "contestant", "parameter", pl.col("excess").alias("y"), "uncertainty"
        )
        for k in range(len(names))
    ]
    return grid(
        case.case.scenario,
        case.case.name,
        contestants,
        kind="room-over-time",
        title=say("chart_room"),
        caption=say("caption_room", floor=ERROR_FLOOR),
        x_label=case.case.scenario.abscissa,
        rows=error_rows(names),
        panels=[curves(table, contestants) for table in tables],
    )


def _way_back(case: LimitCase, contestants: Sequence[Contestant], measured: pl.DataFrame, seed: int) -> Lines:
    """How a start outside the limits is undone."""
    shown = [_ALL, "velocity limit violation [rad/s]", "acceleration limit violation [rad/s^2]"]
    names = set(measured["quantity"].unique())
    shown = [name for name in shown if name in names]
    return grid(
        case.case.scenario,
        case.case.name,
        contestants,
        kind="way-back",
        title=say("chart_way_back"),
        caption=say("caption_way_back", seed=seed),
        x_label=case.case.scenario.abscissa,
        rows=[broken(name) for name in shown],
        panels=[curves(_quantity(measured, name), contestants) for name in shown],
        log_y=[name != _ALL for name in shown],
        reach=[0.0 if name == _ALL else 1e-3 for name in shown],
    )


def _quantity(measured: pl.DataFrame, name: str) -> pl.DataFrame:
    return measured.filter(pl.col("quantity") == name).select("contestant", "parameter", pl.col("value").alias("y"))


def _refused(case: LimitCase) -> list[str]:
    return [outcome.label for outcome in case.outcomes if not outcome.answered]


def _slug(case: LimitCase, kind: str) -> str:
    return slug(type(case.case.scenario).name, kind, case.case.name)
