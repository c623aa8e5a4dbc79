"""What the report says of the inside of a call, from made-up figures."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from hqp_rp.compare.report.report import Report
from hqp_rp.compare.report.write import write_report
from tests.bench import inside as bench_inside
from tests.bench.accuracy import Accuracy
from tests.bench.allocations import Allocations
from tests.bench.floor import CALL, FLOOR, KERNEL, LEXLS, SOLVE, Floor
from tests.bench.inside import Inside, inside_ratios, measure_inside
from tests.bench.inside_report import inside_answer, inside_section
from tests.bench.native_qps import CASCADE, NATIVE, NativeQps
from tests.bench.step_parts import StepParts
from tests.bench.timing import Timing, timing

RIGHT = Accuracy(4, 4, 4, 1e-13, 1e-13)
WRONG = Accuracy(4, 4, 3, 0.3, 0.2, "fault")


def times(**nanoseconds: int) -> dict[str, Timing]:
    names = {"kernel": KERNEL, "call": CALL, "solve": SOLVE, "floor": FLOOR, "lexls": LEXLS}
    return {names[key]: timing(names[key], np.array([ns] * 5)) for key, ns in nanoseconds.items()}


def made_up() -> Inside:
    small = Floor(
        "7_3-3", "7 joints, 3+3", times(kernel=900, call=1200, solve=1500, floor=300, lexls=450),
        {KERNEL: RIGHT, FLOOR: RIGHT, LEXLS: RIGHT}, "solve",
    )  # fmt: skip
    large = Floor(
        "100", "100 unknowns", times(kernel=8000, call=8000, solve=8000, floor=2000, lexls=1000),
        {KERNEL: RIGHT, FLOOR: RIGHT, LEXLS: WRONG}, "solveLeastNorm_1",
    )  # fmt: skip
    qps = NativeQps(
        "7_limits",
        "7 joints, limits",
        2.5,
        timing(CASCADE, np.array([6000] * 5)),
        timing(NATIVE, np.array([4000] * 5)),
        1e-9,
    )
    return Inside(
        (small, large), (qps,), (Allocations("null space", "7_3-3", 10.0, 272.0, 1328.0),), ("No compiler here.",),
        (StepParts("step_sawyer", "step: Sawyer", (5e-6, 15e-6, 5e-6), 26e-6),),
    )  # fmt: skip


def cells(inside: Inside, title: str) -> list[tuple[str, ...]]:
    section = inside_section(inside)
    assert section is not None
    return [row for table in section.tables if table.title.startswith(title) for row in (table.header, *table.rows)]


def test_ratios_stand_before_times_and_only_between_certified_ones() -> None:
    header, small, large = cells(made_up(), "The kernel of null space")
    assert header[1:3] == ("kernel over C floor", "kernel over LexLS")
    assert small == ("7 joints, 3+3", "3", "2", "0.9", "0.3", "0.45")
    assert large[1:3] == ("4", "-")
    section = inside_section(made_up())
    assert section is not None
    assert "Not certified at 1e-06: LexLS on 100 unknowns." in section.tables[0].caption
    assert "No compiler here." in section.sentences


def test_without_native_code_its_columns_are_gone() -> None:
    (small, _) = made_up().floor
    alone = {label: small.times[label] for label in (KERNEL, CALL, SOLVE)}
    header, row = cells(
        Inside((dataclasses.replace(small, times=alone, accuracy={KERNEL: RIGHT}, lexls=""),)), "The kernel"
    )
    assert header == ("family", "kernel, us")
    assert row == ("7 joints, 3+3", "0.9")


def test_shares_of_a_call() -> None:
    _, small, large = cells(made_up(), "Where the time of a null_space")
    assert small[1:4] == ("60%", "20%", "20%")
    assert large[1:4] == ("100%", "0%", "0%")


def test_the_other_tables() -> None:
    inside = made_up()
    assert cells(inside, "qp_cascade")[1][:5] == ("7 joints, limits", "1.5", "2.5", "6", "4")
    assert cells(inside, "Allocations")[1] == ("7_3-3", "null space", "10", "1330", "272")
    assert cells(inside, "Where the time of a control")[1] == (
        "step: Sawyer",
        "20%",
        "60%",
        "20%",
        "5",
        "15",
        "5",
        "26",
    )


def test_the_answer_gives_the_range_of_each_ratio() -> None:
    told = inside_answer(made_up())
    assert "3 (7 joints, 3+3) to 4 times (100 unknowns) as long as a plain cascade in C." in told[0]
    assert "2 times as long (7 joints, 3+3) as LexLS" in told[1]
    assert "0% (100 unknowns) to 40% (7 joints, 3+3) is Python" in told[2]
    assert told[3] == "step: Sawyer: 20% kinematics, 60% tasks, 20% solve."
    assert "1.5 times as long (7 joints, limits) as the sum of its own native QPs" in told[4]


def test_the_history_keeps_how_many_times_faster_ours_is() -> None:
    found = {(name, item.label, item.than): item.value for name, item in inside_ratios(made_up())}
    assert found == {
        ("7_3-3", KERNEL, FLOOR): pytest.approx(1.0 / 3.0),
        ("7_3-3", KERNEL, LEXLS): pytest.approx(0.5),
        ("100", KERNEL, FLOOR): pytest.approx(0.25),
        ("7_limits", CASCADE, NATIVE): pytest.approx(1.0 / 1.5),
    }


def test_nothing_measured_is_no_section() -> None:
    assert inside_section(Inside()) is None
    assert inside_answer(Inside()) == []


def test_both_forms_of_the_report_show_it(tmp_path: Path) -> None:
    section = inside_section(made_up())
    assert section is not None
    write_report(Report("Title", "Question?", (section,), {}), tmp_path)
    for name in ("report.md", "report.html"):
        text = (tmp_path / name).read_text()
        assert "Where the time of a null_space call goes" in text
        assert "kernel over C floor" in text


def test_only_families_that_were_asked_for_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, list[str]] = {}

    def floor(names: list[str], **settings: object) -> tuple[tuple[Floor, ...], tuple[str, ...]]:
        asked["floor"] = list(names)
        return (), ("No compiler here.",)

    def qps(names: list[str], **settings: object) -> tuple[NativeQps, ...]:
        asked["qps"] = list(names)
        return ()

    def allocated(labels: object, names: list[str]) -> tuple[tuple[Allocations, ...], str]:
        asked["allocations"] = list(names)
        return (), "Not counted."

    def steps(name: str, **settings: object) -> StepParts:
        return StepParts(name, "step", (1.0, 2.0, 3.0), 6.0)

    monkeypatch.setattr(bench_inside, "step_parts", steps)
    monkeypatch.setattr(bench_inside, "measure_floor", floor)
    monkeypatch.setattr(bench_inside, "native_qps", qps)
    monkeypatch.setattr(bench_inside, "allocations", allocated)
    found = measure_inside(["7_limits", "7_3-3", "step_sawyer"])
    assert asked == {"floor": ["7_3-3"], "qps": ["7_3-3", "7_limits"], "allocations": ["7_3-3", "7_limits"]}
    assert found.missing == ("No compiler here.", "Not counted.")
    assert [item.name for item in found.steps] == ["step_sawyer"]
