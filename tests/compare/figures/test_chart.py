"""Charts as data, and both ways to draw them."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from hqp_rp.compare.figures.chart import COLOURS, Dots, Line, Lines, styles, thinned
from hqp_rp.compare.figures.html import html
from hqp_rp.compare.figures.png import png

X = np.array([1.0, 0.1, 0.01])
LOOK = styles([["a", "b"], ["c"]])


def lines(**changes: object) -> Lines:
    panel = (Line("a", X, np.array([0.0, 1e-3, 1.0]), sure=np.array([False, False, True])), Line("b", X, X))
    settings: dict[str, object] = {
        "name": "errors", "title": "Errors", "caption": "", "x_label": "eps", "columns": ("one", "two"),
        "rows": ("error",), "panels": ((panel, (Line("c", X, X, X / 2, X * 2),)),), "log_x": True, "reverse_x": True,
        "log_y": (True,), "floor": (1e-9,), "ceiling": (1e3,), "marks": ((0.05, "here"),),
    }  # fmt: skip
    return Lines(**{**settings, **changes})  # type: ignore[arg-type]


def dots(log: bool = True) -> Dots:
    return Dots(
        name="parting", title="Parting", caption="", x_label="eps", columns=("only",),
        groups=(("one", ("a", "b")), ("two", ("c",))),
        values=({"a": np.array([0.1, 0.01, np.nan]), "b": np.array([np.nan, np.nan])},), log_x=log, reverse_x=log,
    )  # fmt: skip


def test_styles_differ_within_a_group() -> None:
    many = styles([[f"s{i}" for i in range(18)]])
    assert len({(style.colour, style.dash) for style in many.values()}) == 18
    assert (LOOK["a"].colour, LOOK["c"].colour) == (COLOURS[0], COLOURS[2])
    groups = styles([[f"a{i}" for i in range(5)], [f"b{i}" for i in range(9)], [f"c{i}" for i in range(6)]])
    assert len({(style.colour, style.dash) for style in groups.values()}) == 20


def test_zero_is_drawn_at_the_floor() -> None:
    chart = lines()
    assert chart.drawn(0, np.array([0.0, 1.0])).tolist() == [1e-9, 1.0]
    low, high = chart.limits(0)
    assert low < 1e-8
    assert high == pytest.approx(3.0)


def test_a_sure_point_alone_stays_visible() -> None:
    line = Line("a", X, np.array([1.0, 2.0, 3.0]), sure=np.array([False, False, True]))
    assert np.isnan(line.certain()).tolist() == [True, False, False]


def test_thinning_keeps_every_peak() -> None:
    y = np.zeros(10_000)
    y[[17, 5000, 9998]] = 1.0, -1.0, 2.0
    chosen = thinned(y, 100)
    assert len(chosen) <= 102
    assert {0, 17, 5000, 9998, 9999} <= set(chosen.tolist())
    assert thinned(y[:50], 100).tolist() == list(range(50))


def test_absent_values_stand_beyond_the_end_of_the_path() -> None:
    family, path = dots(), dots(log=False)
    assert family.absent_at < 0.01
    assert path.absent_at > 0.1
    assert family.limits[0] > family.limits[1]
    assert path.limits[0] < path.limits[1]
    assert family.place(np.array([np.nan, 0.1])).tolist() == [family.absent_at, 0.1]


def test_the_middle_counts_absent_as_latest() -> None:
    assert dots().middle(np.array([0.1, 0.01, np.nan])) == 0.01
    assert dots(log=False).middle(np.array([0.1, 0.2, np.nan])) == 0.2
    assert np.isnan(dots().middle(np.array([0.1, np.nan, np.nan])))


@pytest.mark.parametrize(
    "chart", [lines(), lines(log_x=False, log_y=(False,), reverse_x=False), dots(), dots(log=False)]
)
def test_both_drawings_hold_the_chart(chart: Lines | Dots) -> None:
    picture = png(chart, LOOK)
    assert picture.startswith(b"\x89PNG")
    assert picture == png(chart, LOOK)
    page = html(chart, LOOK)
    assert page.count("Plotly.newPlot(") == 1
    assert re.search(rf'id="{chart.name}"', page)
    data = json.loads(page[page.index("[{") : page.index("}],") + 2])
    names = {trace.get("name") for trace in data} | {y for trace in data for y in trace["y"] if isinstance(y, str)}
    assert {"a", "b"} <= names


def test_an_axis_reaches_where_it_is_told_to() -> None:
    assert lines(reach=(50.0,)).limits(0)[1] == 50.0
    assert lines(reach=(1e-3,)).limits(0)[1] == pytest.approx(3.0)


def test_a_long_title_takes_more_lines_and_room() -> None:
    def height(title: str) -> int:
        return int.from_bytes(png(lines(title=title), LOOK)[20:24], "big")

    assert height("Errors of each level against the distance to the singularity, in a narrow figure") > height("Errors")


def unsure() -> Lines:
    """A chart in which nothing of two contestants is sure."""
    nothing = np.zeros(3, dtype=bool)
    panel = tuple(Line(label, X, X, sure=nothing) for label in ("a", "b"))
    return lines(panels=((panel, (Line("c", X, X * np.nan),)),))


@pytest.mark.parametrize("chart", [lines(), unsure()], ids=["drawn", "nothing sure"])
def test_the_legend_shows_every_contestant_with_a_line_that_can_be_seen(chart: Lines) -> None:
    piece = html(chart, LOOK)
    data = json.loads(re.search(r"Plotly\.newPlot\(\s*\"errors\",\s*(\[.*?\]),\s*\{\"template\"", piece, re.DOTALL)[1])  # type: ignore[index]
    entries = {trace["name"]: trace for trace in data if trace.get("showlegend")}
    assert set(entries) == {"a", "b", "c"}
    assert all(trace["line"]["width"] >= 2.0 and trace.get("opacity", 1.0) == 1.0 for trace in entries.values())
    assert [entries[label]["legendgrouptitle"]["text"] for label in ("a", "c")] == ["<b>one</b>", "<b>two</b>"]
