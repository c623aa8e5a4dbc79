"""Limits in a comparison: figures known by hand, sentences that follow them, tables and charts that show them."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest

from hqp_rp import Status, get_solver
from hqp_rp.compare import Comparison, Contestant, compare
from hqp_rp.compare.limits.cases import LimitCase, LimitOutcome, limit_scenarios
from hqp_rp.compare.limits.findings import limit_sentences, limits_answer
from hqp_rp.compare.report.report import Section, Table
from hqp_rp.core.variant import EXACT, QP, SOFT
from tests.compare.small import Bounded, Fixed, Moving

LINE_UP = (
    Contestant("exact", get_solver("hierarchical_active_set"), QP),
    Contestant("closed", get_solver("null_space"), EXACT),
    Contestant("careless", Fixed(x=(2.0, 1.0)), SOFT),
    Contestant("lazy", Fixed(x=(0.5, 0.0)), SOFT),
    Contestant("stuck", Fixed(x=None, status=Status.INFEASIBLE, message="It has no x."), SOFT),
)


@pytest.fixture(scope="module")
def found() -> Comparison:
    return compare([Bounded()], LINE_UP, seeds=2, workers=1)


@pytest.fixture
def hard(found: Comparison) -> LimitCase:
    return found.limits[0]


def of(case: LimitCase, label: str) -> LimitOutcome:
    return next(outcome for outcome in case.outcomes if outcome.label == label)


def test_a_scenario_that_measures_violations_is_one_with_limits(found: Comparison) -> None:
    assert limit_scenarios(found.measured) == {"bounded"}
    assert [(case.case.name, case.told) for case in found.limits] == [("hard", True), ("no limits", False)]
    assert found.limits[0].duration == 2.0
    assert found.without_limits == ()
    both = compare([Bounded(), Moving()], LINE_UP[:1], seeds=1, workers=1)
    assert [type(case.scenario) for case in both.without_limits] == [Moving]
    assert len(both.cases) == 3


def test_violations_are_the_largest_their_time_and_their_first(hard: LimitCase) -> None:
    position, velocity = of(hard, "careless").violations
    assert (position.kind, position.unit) == ("position", "rad")
    assert (position.largest, position.time, position.first) == (0.5, 2.0, 0.0)
    assert (velocity.kind, velocity.unit) == ("velocity", "rad/s")
    # At every other step, of 0.5 s each.
    assert (velocity.largest, velocity.time, velocity.first) == (1.0, 1.0, 0.5)
    for label in ("exact", "lazy"):
        assert of(hard, label).kept
        assert [v.first for v in of(hard, label).violations] == [None, None]
    assert not of(hard, "careless").kept


def test_a_start_outside_is_not_held_against_anyone(hard: LimitCase) -> None:
    # Seed 1 is 0.2, 0.1, 0, 0 outside.
    assert [(o.outside, o.back) for o in hard.answered] == [(1, 1.0)] * len(hard.answered)
    assert of(hard, "exact").violations[0].largest == 0.0


def test_task_errors_are_rms_peak_and_end(hard: LimitCase) -> None:
    tool, posture = of(hard, "exact").errors
    assert (tool.name, tool.unit) == ("tool", "m")
    assert (tool.peak, tool.end) == pytest.approx((4.0, 4.0), rel=1e-14)
    assert tool.rms == pytest.approx(math.sqrt((1 + 4 + 9 + 16) / 4))
    assert (posture.rms, posture.peak, posture.end) == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)
    assert of(hard, "lazy").errors[1].rms == 1.0


def test_what_was_denied_and_what_room_was_left(hard: LimitCase) -> None:
    exact, lazy = of(hard, "exact").denied, of(hard, "lazy").denied
    assert [level.name for level in exact] == ["tool", "posture"]
    assert exact[0].rms == pytest.approx(1.0)
    assert exact[0].optimum == pytest.approx(1.0)
    assert exact[0].open == pytest.approx(0.0, abs=1e-12)
    assert not of(hard, "exact").wasteful
    assert lazy[0].rms == pytest.approx(1.5)
    assert lazy[0].optimum == pytest.approx(1.0)
    # At 0.5 the bound 1 is not reached: all of 1.5 points where there is room, of which the bound leaves 0.5.
    assert lazy[0].open == pytest.approx(1.5)
    assert lazy[1].open == pytest.approx(1.0)
    assert lazy[1].rms == pytest.approx(1.0)
    assert lazy[1].optimum == pytest.approx(0.0, abs=1e-12)
    assert of(hard, "lazy").wasteful
    assert not of(hard, "lazy").admitted


def test_refusals_and_failures_are_told_apart(hard: LimitCase) -> None:
    closed, stuck = of(hard, "closed"), of(hard, "stuck")
    assert not closed.answered
    assert not closed.kept
    assert closed.statuses == {"REFUSED": 1.0}
    assert stuck.answered
    assert stuck.statuses == {"INFEASIBLE": 1.0}
    assert math.isnan(stuck.denied[0].rms)
    assert stuck.denied[0].open is None


def test_the_answer_follows_the_figures(found: Comparison) -> None:
    words = " ".join(found.answer)
    assert found.answer == limits_answer(found.limits)
    assert "Of 1 case whose problem holds the limits" in words
    assert "in all 1 by lazy, stuck and exact; in none of 1 by careless." in words
    assert "bounded, hard: position by careless (0.5 rad, for 2 s)" in words
    assert "velocity by careless (1 rad/s, for 1 s)" in words
    assert "Refused every problem with limits, and say so: closed." in words
    assert "Hard rows contradicted each other in bounded, hard, on up to 100 % of the steps of stuck." in words
    assert "lazy (1.5, tool)" in words
    assert "2 of 5 in bounded, no limits" not in words
    assert "3 of 5 in bounded, no limits" in words


def test_the_sentences_of_a_case(hard: LimitCase) -> None:
    words = limit_sentences(hard)
    assert "Kept every limit at every step: lazy, stuck and exact." in words
    assert "Position limits broken by careless (0.5 rad, for 2 s)." in words
    assert "1 of the seeds start outside a position limit. Those who come back are inside again after 1 s." in words
    assert "Other than SOLVED: INFEASIBLE from stuck (100 %), of the steps." in words
    assert any(
        sentence.startswith("Posture: of those who kept every limit, exact missed it least") for sentence in words
    )


def changed(case: LimitCase, **by_label: Any) -> LimitCase:
    """The case with other figures for these contestants, and without the others."""
    outcomes = (dataclasses.replace(of(case, label), **figures) for label, figures in by_label.items())
    return dataclasses.replace(case, outcomes=tuple(outcomes))


def test_who_never_comes_back_is_named(hard: LimitCase) -> None:
    early, late = {"outside": 2, "back": 0.5}, {"outside": 1, "back": 1.5}
    words = limit_sentences(changed(hard, exact=early, lazy=late, careless={"outside": 2, "back": None}))
    assert (
        "2 of the seeds start outside a position limit. Those who come back are inside again after 0.5 to 1.5 s. "
        "Never back inside: careless."
    ) in words
    words = limit_sentences(changed(hard, careless={"outside": 2, "back": None}))
    assert "2 of the seeds start outside a position limit. Never back inside: careless." in words


def test_who_shakes_and_who_does_not(hard: LimitCase) -> None:
    calm, wild = {"changes": (0.1, 0.5, 1.0)}, {"changes": (0.1, 2.0, 4.0)}
    assert (
        "In 99 % of the steps joint velocities change by no more than 0.5 rad/s with exact and lazy, 2 with careless."
    ) in limit_sentences(changed(hard, exact=calm, lazy=calm, careless=wild))
    assert (
        "Joint velocities change by up to 0.5 rad/s in 99 % of the steps with everyone."
    ) in limit_sentences(changed(hard, exact=calm, lazy=calm))  # fmt: skip


def test_room_left_on_steps_not_called_solved_is_told_apart(hard: LimitCase) -> None:
    admitted = tuple(dataclasses.replace(level, claimed=None) for level in of(hard, "lazy").denied)
    case = changed(hard, exact={}, lazy={"denied": admitted})
    assert (
        "Room left unused, the largest of any step: lazy (tool 1.5, posture 1; only on steps not called SOLVED). "
        "None beyond rounding: exact."
    ) in limit_sentences(case)
    price = next(sentence for sentence in limits_answer([case]) if sentence.startswith("Price"))
    assert price.startswith(
        "Price: every level was served as well as the limits and the levels before it allow by exact; room was left unused by "
        "lazy (1.5, tool, only on steps not called SOLVED). The figure is the largest part"
    )
    assert limits_answer([changed(hard, lazy={})])[-2].startswith(
        "Price: room was left unused by lazy (1.5, tool). The "
    )


def test_contradicting_rows_say_what_came_of_them(hard: LimitCase) -> None:
    stopped = {"statuses": {"SOLVED": 0.75, "INFEASIBLE": 0.25}, "violations": of(hard, "careless").violations}
    assert (
        "Hard rows contradicted each other in bounded, hard, on up to 25.0 % of the steps of exact; the robot then brakes, and "
        "ends up to 1 rad/s beyond a velocity limit."
    ) in limits_answer([changed(hard, exact=stopped)])


def test_a_figure_shared_by_several_is_printed_once(hard: LimitCase) -> None:
    broken = {"violations": of(hard, "careless").violations}
    words = limit_sentences(changed(hard, exact=broken, lazy=broken, careless={}))
    assert "Position limits broken by exact, lazy and careless (0.5 rad, for 2 s)." in words
    assert "Tool: all solvers missed it alike" not in " ".join(words)
    assert "Tool: of all solvers, careless missed it least (0 m RMS), lazy most (4.1)." in words


def test_nobody_takes_it() -> None:
    found = compare([Bounded()], [LINE_UP[1]], seeds=1, workers=1)
    # The case without limits is measured, the other is refused by all.
    assert found.answer == ("No solver took a problem with limits.",)
    assert limit_sentences(found.limits[0]) == ("Every solver refused this problem.",)


def tables(sections: tuple[Section, ...]) -> list[Table]:
    return [table for section in sections for table in (*section.tables, *tables(section.sections))]


def test_the_report_shows_it_in_tables_and_charts(found: Comparison) -> None:
    report = found.report()
    assert report.question == "Which prioritized solver keeps a robot's limits, and what does each level pay?"
    by_title = {table.title: table for table in tables(report.sections)}
    violated = by_title["Bounded, hard: who violated what, by how much, for how long"]
    assert violated.header[:5] == ("solver", "ended as", "position: largest [rad]", "for [s]", "from [s]")
    rows = {row[0]: row[1:] for row in violated.rows}
    assert rows["careless"] == ("solved", "0.5", "2", "0", "1", "1", "0.5", "1")
    assert rows["exact"] == ("solved", "kept", "0", "-", "kept", "0", "-", "1")
    assert rows["closed"] == ("refused", *["-"] * 7)
    assert rows["stuck"][0] == "infeasible 100 %"
    paid = {row[0]: row[1:] for row in by_title["Bounded, hard: what each level paid"].rows}
    assert paid["lazy"] == ("4.1 / 6 / 6", "1 / 1 / 1")
    denied = {row[0]: row[2:] for row in by_title[
        "Bounded, hard: what each level was denied / at the exact optimum / room left unused"
    ].rows}  # fmt: skip
    assert denied["lazy"] == ("1.5 / 1 / 1.5", "1 / 0 / 1")
    assert [chart.name for chart in report.charts()] == [
        "bounded-violations-hard",
        "bounded-limits-over-time-hard",
        "bounded-errors-over-time-hard",
        "bounded-room-over-time-hard",
        "bounded-way-back-hard",
        "bounded-violations-no-limits",
        "bounded-limits-over-time-no-limits",
        "bounded-errors-over-time-no-limits",
        "bounded-room-over-time-no-limits",
        "bounded-way-back-no-limits",
    ]


def test_charts_of_kept_limits_are_left_out() -> None:
    found = compare([Bounded()], [LINE_UP[0], LINE_UP[3]], seeds=1, workers=1)
    names = [chart.name for chart in found.report().charts() if chart.name.endswith("-hard")]
    assert names == ["bounded-errors-over-time-hard", "bounded-room-over-time-hard"]
