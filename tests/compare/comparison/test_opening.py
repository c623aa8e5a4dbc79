"""The first screen follows the data: cases made by hand, whose answer is known."""

from __future__ import annotations

import dataclasses
import pathlib
from types import SimpleNamespace

import numpy as np

from hqp_rp.compare.comparison.opening import opening_of_comparison
from hqp_rp.compare.figures.chart import Line, Lines, styles
from hqp_rp.compare.report.report import Opening, Report, Section
from hqp_rp.compare.report.words import counted
from hqp_rp.compare.report.write import write_report
from tests.compare.comparison.test_findings import CARELESS, GENTLE, GOOD, REVERSE, case

X = np.array([1.0, 0.1])


def chart(name: str) -> Lines:
    return Lines(
        name=name, title=name, caption="Down to 1e-09.", x_label="x", columns=("one",), rows=("y",),
        panels=(((Line("a", X, X),),),), log_x=True, log_y=(True,), floor=(1e-9,), ceiling=(1.0,),
    )  # fmt: skip


SECTIONS = (Section("Figures", sections=(Section("inner", charts=(chart("first"), chart("second"))),)),)


def opening(*cases: object) -> Opening:
    return opening_of_comparison(SimpleNamespace(without_limits=cases, limits=()), SECTIONS)  # type: ignore[arg-type]


def test_each_need_names_who_meets_it_and_who_loses_level_1() -> None:
    found = opening(case(GOOD, REVERSE, GENTLE, CARELESS))
    advice = dict(found.advice)
    exact, through, avoid = advice.values()
    assert exact == "null space and reverse priority"
    assert through == "gentle"
    assert avoid == "careless (0.12)"
    assert found.numbers[0] == ("0.12", "the most that level 1 lost, by careless, in the unit of the task")
    assert found.numbers[-1] == ("2 of 4", "solvers are exact in every case that they take")
    assert found.chart == "first"


def test_where_nobody_meets_a_need_it_says_so() -> None:
    found = opening(case(CARELESS), case(dataclasses.replace(GENTLE, proven=(0.5, 0.0)), name="three levels"))
    assert [which for _, which in found.advice[:2]] == ["no solver here: see the tables for who comes near"] * 2


def test_without_cases_there_is_nothing_to_say() -> None:
    assert opening().advice == ()


def test_the_picture_of_the_opening_is_shown_once_and_numbers_do_not_break(tmp_path: pathlib.Path) -> None:
    first = Opening((("need", "a, 1e-06 | off"),), (("3e-16", "that"),), "second")
    report = Report("title", "why?", SECTIONS, styles([["a"]]), first)
    page, text = (path.read_text() for path in write_report(report, tmp_path))
    assert page.count("Plotly.newPlot(") == 2
    assert page.index("second") < page.index("Figures")
    assert '<span class="n">1e-06</span>' in page
    assert text.count("figures/second.png") == 1
    assert text.index("figures/second.png") < text.index("## Figures") < text.index("figures/first.png")
    assert "| need | a, 1e-06 \\| off |" in text


def test_one_of_a_thing_has_no_s() -> None:
    assert [counted(n, "path") for n in (0, 1, 2)] == ["0 paths", "1 path", "2 paths"]
