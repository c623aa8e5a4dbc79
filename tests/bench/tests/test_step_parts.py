"""The parts of a control step are timed one by one, on the problems that the step solves."""

from __future__ import annotations

import time

import pytest

from tests.bench.step_parts import step_parts
from tests.bench.steps import STEP_FAMILIES


@pytest.mark.parametrize("name", [name for name in STEP_FAMILIES if name != "step_humanoid"])
def test_the_parts_of_a_step_are_told_apart(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    readings = 0
    at = 0

    def clock() -> int:  # each step: 1 us kinematics, 3 us tasks, 2 us solve, 4 us in between
        nonlocal at, readings
        at += (4000, 1000, 3000, 2000)[readings % 4]
        readings += 1
        return at

    monkeypatch.setattr(time, "perf_counter_ns", clock)
    found = step_parts(name, quick=True, rounds=1)
    assert found.seconds == pytest.approx((1e-6, 3e-6, 2e-6))
    assert found.whole == pytest.approx(6e-6)
    assert found.name == name
    assert found.title.startswith("step: Sawyer")
