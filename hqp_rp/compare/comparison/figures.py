"""The charts of a comparison, built from its data frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import polars as pl

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.figures.chart import Bars, Chart, Dots, Line, Lines
from hqp_rp.compare.figures.panels import (
    ERROR_FLOOR,
    array,
    broken,
    by_contestant,
    curves,
    error_rows,
    grid,
    grouped,
    level_names,
    slug,
    wide,
    words,
)
from hqp_rp.compare.measure.cases import PARTING, singular_distance
from hqp_rp.compare.measure.metrics import parting_frame
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.scenarios.scenario import Scenario

say = Sentences(__file__)


def scenario_charts(
    scenario: Scenario,
    contestants: Sequence[Contestant],
    steps: pl.DataFrame,
    levels: pl.DataFrame,
    measured: pl.DataFrame,
) -> list[Chart]:
    """Every chart of one scenario; the frames may hold other scenarios too."""
    name = type(scenario).name
    steps, levels, measured = (frame.filter(pl.col("scenario") == name) for frame in (steps, levels, measured))
    charts: list[Chart] = []
    for case in steps["case"].unique(maintain_order=True).to_list():
        of_case = [frame.filter(pl.col("case") == case) for frame in (steps, levels, measured)]
        if scenario.log_abscissa:
            charts.append(_family(scenario, case, contestants, *of_case[:2]))
        else:
            charts.append(_against_sigma(scenario, case, contestants, *of_case[:2]))
            charts.append(_path(scenario, case, contestants, *of_case[:2]))
            if of_case[2].height:
                charts.append(_measured(scenario, case, contestants, of_case[2]))
    charts.append(_parting(scenario, contestants, steps))
    return [chart for chart in charts if _has_data(chart)]


def _has_data(chart: Chart) -> bool:
    if isinstance(chart, Lines):
        return any(map(any, chart.panels))
    return bool(chart.columns if isinstance(chart, Dots) else isinstance(chart, Bars) and chart.groups)


def _family(
    scenario: Scenario, case: str, contestants: Sequence[Contestant], steps: pl.DataFrame, levels: pl.DataFrame
) -> Lines:
    """Errors and |x| against the distance, the median of the seeds and the range between them."""
    names = level_names(levels)
    tables = [
        levels.filter(pl.col("level") == k + 1).select(
            "contestant", "parameter", pl.col("excess").alias("y"), "uncertainty"
        )
        for k in range(len(names))
    ]
    tables.append(steps.select("contestant", "parameter", pl.col("x_norm").alias("y")))
    rows = [*error_rows(names), "|x|"]
    return grid(
        scenario,
        case,
        contestants,
        kind="error-against-distance",
        title=say("chart_family"),
        caption=say("caption_family", floor=ERROR_FLOOR),
        x_label=scenario.abscissa,
        rows=rows,
        panels=[_spread(table, contestants) for table in tables],
        log_x=True,
        reverse_x=True,
        marks=_cut(levels),
    )


def _cut(levels: pl.DataFrame) -> tuple[tuple[float, str], ...]:
    """The largest distance at which most seeds have lost a direction by the rank rule."""
    room = pl.col("rows") <= pl.col("unknowns") - pl.col("before")
    lost = (
        levels.filter(room)
        .group_by("parameter", "seed")
        .agg((pl.col("rank") < pl.col("own_rank")).any().alias("lost"))
        .group_by("parameter")
        .agg(pl.col("lost").mean())
        .filter(pl.col("lost") > 0.5)
    )
    return () if not lost.height else ((float(np.max(array(lost["parameter"]))), "rank rule cuts"),)


def _against_sigma(
    scenario: Scenario, case: str, contestants: Sequence[Contestant], steps: pl.DataFrame, levels: pl.DataFrame
) -> Lines:
    """The largest error and |x| seen at each distance, where the distance is sigma_min of the projected level."""
    sigma = singular_distance(levels)
    names = level_names(levels)
    tables = [
        levels.filter(pl.col("level") == k + 1)
        .join(sigma, on=["contestant", "seed", "step"])
        .select("contestant", "sigma", pl.col("excess").alias("y"))
        for k in range(len(names))
    ]
    tables.append(
        steps.join(sigma, on=["contestant", "seed", "step"]).select("contestant", "sigma", pl.col("x_norm").alias("y"))
    )
    return grid(
        scenario,
        case,
        contestants,
        kind="error-against-distance",
        title=say("chart_sigma"),
        caption=say("caption_sigma", floor=ERROR_FLOOR),
        x_label="smallest sigma of a projected level",
        rows=[*error_rows(names), "|x|"],
        panels=[_largest(table, contestants) for table in tables],
        log_x=True,
        reverse_x=True,
    )


def _path(
    scenario: Scenario, case: str, contestants: Sequence[Contestant], steps: pl.DataFrame, levels: pl.DataFrame
) -> Lines:
    """Errors, |x| and sigma along the path of the first seed."""
    first = pl.col("seed") == steps["seed"].min()
    names = level_names(levels)
    tables = [
        levels.filter(first & (pl.col("level") == k + 1)).select(
            "contestant", "parameter", pl.col("excess").alias("y"), "uncertainty"
        )
        for k in range(len(names))
    ]
    tables.append(steps.filter(first).select("contestant", "parameter", pl.col("x_norm").alias("y")))
    keys = ["contestant", "seed", "step"]
    answered = steps.filter(pl.col("x").is_not_null()).select(*keys, "parameter")
    sigma = singular_distance(levels).join(answered, on=keys)
    tables.append(sigma.filter(first).select("contestant", "parameter", pl.col("sigma").alias("y")))
    return grid(
        scenario,
        case,
        contestants,
        kind="path",
        title=say("chart_path"),
        caption=say("caption_path"),
        x_label=scenario.abscissa,
        rows=[*error_rows(names), "|x|", "sigma"],
        panels=[curves(table, contestants) for table in tables],
    )


def _measured(scenario: Scenario, case: str, contestants: Sequence[Contestant], measured: pl.DataFrame) -> Lines:
    """What only the scenario could measure, along the path of the first seed."""
    first = measured.filter(pl.col("seed") == measured["seed"].min())
    names = first["quantity"].unique(maintain_order=True).to_list()
    tables = [
        first.filter(pl.col("quantity") == name).select("contestant", "parameter", pl.col("value").alias("y"))
        for name in names
    ]
    log = [wide(array(table["y"].drop_nulls())) for table in tables]
    return grid(
        scenario,
        case,
        contestants,
        kind="measured",
        title=say("chart_measured"),
        caption=say("caption_measured"),
        x_label=scenario.abscissa,
        rows=[broken(name) for name in names],
        panels=[curves(table, contestants) for table in tables],
        log_y=log,
    )


def _parting(scenario: Scenario, contestants: Sequence[Contestant], steps: pl.DataFrame) -> Dots:
    """Where each solver first leaves the optimum."""
    frame = parting_frame(steps, PARTING).filter(pl.col("measured"))
    cases = steps["case"].unique(maintain_order=True).to_list()
    values = []
    for case in cases:
        of_case = frame.filter(pl.col("case") == case)
        parted = {
            str(label): of_case.filter(pl.col("contestant") == label)["parts_at"].cast(pl.Float64).to_numpy()
            for label in of_case["contestant"].unique(maintain_order=True)
        }
        values.append({label: np.array(v, dtype=np.float64) for label, v in parted.items()})
    name = type(scenario).name
    return Dots(
        name=slug(name, "parting"),
        title=say("chart_parting"),
        caption=say("caption_parting", parting=PARTING),
        x_label=scenario.abscissa,
        columns=tuple(case or words(name) for case in cases),
        groups=tuple((group, tuple(labels)) for group, labels in grouped(contestants)),
        values=tuple(values),
        log_x=scenario.log_abscissa,
        reverse_x=scenario.log_abscissa,
    )


def _spread(table: pl.DataFrame, contestants: Sequence[Contestant]) -> dict[str, Line]:
    """Median, smallest and largest y over the seeds at each parameter."""
    found = {}
    sure = "uncertainty" in table.columns
    together = (
        table.drop_nulls()
        .group_by("contestant", "parameter")
        .agg(
            pl.col("y").median().alias("middle"),
            pl.col("y").min().alias("low"),
            pl.col("y").max().alias("high"),
            (pl.col("y").median() > pl.col("uncertainty").median() if sure else pl.lit(True)).alias("sure"),
        )
        .sort("parameter")
    )
    for label, part in by_contestant(together, contestants):
        x, y, low, high = (array(part[name]) for name in ("parameter", "middle", "low", "high"))
        found[label] = Line(label, x, y, low, high, part["sure"].to_numpy() if sure else None)
    return found


def _largest(table: pl.DataFrame, contestants: Sequence[Contestant]) -> dict[str, Line]:
    """The largest y in each quarter of a decade of sigma."""
    binned = (
        table.drop_nulls()
        .filter(pl.col("sigma") > 0.0)
        .with_columns((pl.col("sigma").log10() * 4).floor().alias("bin"))
        .group_by("contestant", "bin")
        .agg(pl.col("y").max())
        .with_columns((10.0 ** ((pl.col("bin") + 0.5) / 4)).alias("sigma"))
        .sort("sigma")
    )
    return {
        label: Line(label, array(part["sigma"]), array(part["y"])) for label, part in by_contestant(binned, contestants)
    }
