"""Growth, the flop count, instruction counts."""

from __future__ import annotations

import shutil

import pytest

from tests.bench import extra as bench_extra
from tests.bench.extra import flops
from tests.bench.floor import FLOOR


def test_flop_count() -> None:
    assert flops(1, (1,)) == 4.0 + 1.0 + 4.0
    assert (
        flops(7, (3, 3))
        == sum(4 * (7 - j) * (6 - j) for j in range(3)) + 9 + 84 + sum(4 * (4 - j) * (3 - j) for j in range(3)) + 9 + 84
    )
    assert flops(4, (9,)) == flops(4, (9, 5)) - sum(4 * (4 - j) * 5 for j in range(4))  # the later rows are turned too


def test_growth_ends_where_the_flop_count_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_extra, "SIZES", (4, 8))
    curves = bench_extra.growth("unknowns", ["numpy"], calls=8, budget=0.001)
    assert {"null space", "active set, cold", "numpy SVD cascade", "flop count"} <= set(curves)
    assert (FLOOR in curves) == (shutil.which("cc") is not None)
    assert all([at for at, _ in points] == [4.0, 8.0] for points in curves.values())
    assert curves["flop count"][-1] == pytest.approx(curves["null space"][-1])
    assert curves["flop count"][0][1] / curves["flop count"][1][1] == pytest.approx(
        flops(4, (1,) * 3) / flops(8, (2,) * 3)
    )


def test_instruction_counts_say_why_there_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    assert bench_extra.instruction_counts(["null space"]) == (
        {},
        "Instruction counts are not available: the program perf is not installed.",
    )
