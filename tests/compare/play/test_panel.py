"""What the panel says: bars as long as their values, words escaped, and what cannot be told told as such."""

from __future__ import annotations

import dataclasses
import math
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from hqp_rp.compare.play.arm import ArmState
from hqp_rp.compare.play.panel import ERRORS, panel, share
from hqp_rp.compare.play.strip_chart import FLOOR, QUANTITIES, StripChart
from hqp_rp.control.command import Mode

STATE = ArmState(
    q=np.zeros(2), speed=1.0, share=1.0, mode=Mode.RUNNING, status="SOLVED", reason="",
    error=np.array([1e-3, math.nan]), residual=np.zeros(2), rank=np.array([2.0, 1.0]), rows=np.array([2.0, 3.0]),
    sigma_min=np.array([0.5, math.inf]), limits=(), bounded=0, solve_time=1e-5,
)  # fmt: skip


class Checked(HTMLParser):
    """Fails on a tag that is not closed in its order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def words(text: str) -> str:
    return " ".join(Checked(text).words)


@pytest.mark.parametrize(
    ("value", "filled"), [(1e-6, 0.0), (1e-3, 0.5), (1.0, 1.0), (5.0, 1.0), (0.0, 0.0), (math.nan, 0.0)]
)
def test_a_bar_is_as_long_as_the_logarithm_of_its_value(value: float, filled: float) -> None:
    assert share(value, ERRORS) == pytest.approx(filled)


def test_each_level_has_its_rank_and_a_bar_for_each_solver() -> None:
    other = dataclasses.replace(STATE, rank=np.array([1.0, 1.0]), error=np.array([1e-1, 0.2]))
    text = panel(["first", "second"], [STATE, other], ["a", "b"])
    assert "1 first" in words(text)
    assert "rank 2 of 2 | 1 of 2" in words(text)
    assert "rank 1 of 3" in words(text)
    widths = [float(width) for width in re.findall(r"width: ([\d.]+)%", text)]
    assert len(widths) == 2 * (2 * 2 + 1) + 2  # error and sigma of two levels and |v|, for two solvers; limits of each
    assert widths[:2] == [pytest.approx(50.0, abs=0.1), pytest.approx(83.3, abs=0.1)]
    assert "\u2013" in words(text)  # no error of the second level
    assert "\u221e" in words(text)


def test_words_of_others_are_escaped() -> None:
    state = dataclasses.replace(STATE, mode=Mode.STOPPED, reason="<b>&", limits=("<i>",), bounded=3)
    text = panel(["<script>"] * 2, [state], ["<u>"])
    for raw in ("<script>", "<b>&", "<i>", "<u>"):
        assert raw not in text.replace("<b>1 ", "").replace("<b>2 ", "").replace("<b>the", "")
        assert raw in words(text)
    assert "1 of 3" in words(text)


def test_what_happened_is_said_in_a_sentence() -> None:
    assert "Solved." in words(panel(["a", "b"], [STATE], ["s"]))
    slow = dataclasses.replace(STATE, share=0.25)
    assert "Solved; moved at 25 % of it, as fast as the joints go." in words(panel(["a", "b"], [slow], ["s"]))
    assert "Driven to a configuration." in words(panel(["a", "b"], [STATE], ["s"], driving=True))
    many = dataclasses.replace(STATE, limits=tuple(f"j{i}" for i in range(6)), bounded=12)
    assert "j0; j1; j2; j3; ..." in words(panel(["a", "b"], [many], ["s"]))


class Gui:
    """What a strip chart asks of viser."""

    def __init__(self) -> None:
        self.charts: list[Gui] = []
        self.removed = False
        self.value = QUANTITIES["error"]
        self.data: Any = None
        self.series: Any = None

    def __enter__(self) -> Gui:
        return self

    def __exit__(self, *error: object) -> None: ...

    def add_dropdown(self, label: str, options: tuple[str, ...], initial_value: str) -> Gui:
        assert initial_value in options
        return self

    def add_uplot(self, data: Any, series: Any, **settings: object) -> Gui:
        chart = Gui()
        chart.data, chart.series = data, series
        self.charts.append(chart)
        return chart

    def remove(self) -> None:
        self.removed = True


def test_a_strip_chart_keeps_the_last_seconds_and_draws_one_curve_a_level_and_solver() -> None:
    gui = Gui()
    chart = StripChart(gui, gui, ["first", "second"], seconds=2.0)
    chart.draw()
    assert not gui.charts
    for i in range(100):
        chart.add(0.1 * i, [STATE, None])
    chart.draw()
    (drawn,) = gui.charts
    time, *curves = drawn.data
    assert (time[0], time[-1]) == (pytest.approx(7.9), pytest.approx(9.9))
    assert len(curves) == 4
    np.testing.assert_allclose(curves[0], -3.0)
    assert np.isnan(curves[1:]).all()  # the second level has no error; there is no ghost
    assert [one["label"] for one in drawn.series] == [
        "t (s)", "1 first", "2 second", "1 first ghost", "2 second ghost",
    ]  # fmt: skip
    chart.draw()
    assert len(gui.charts) == 1
    gui.value = QUANTITIES["speed"]
    chart.add(10.0, [dataclasses.replace(STATE, speed=0.0), STATE])
    chart.draw()
    assert drawn.removed
    speeds = gui.charts[1].data
    assert [curve[-1] for curve in speeds[1:]] == [math.log10(FLOOR), 0.0]
    chart.add(0.0, [STATE])  # played again from the beginning
    chart.draw()
    assert len(gui.charts[2].data[0]) == 1
