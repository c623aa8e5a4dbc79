"""A loop keeps pace with the clock, and a slow one does not hurry after it."""

from __future__ import annotations

import pytest

from hqp_rp.compare.play.pace import MOST_STEPS, Pace


@pytest.mark.parametrize("frame", [1 / 60, 1 / 30, 0.01, 0.003])
@pytest.mark.parametrize("dt", [0.01, 0.002, 0.004])
def test_as_many_steps_as_time_passes(frame: float, dt: float) -> None:
    pace = Pace(dt, now=100.0)
    steps = [pace.due(100.0 + k * frame) for k in range(1, 301)]
    assert sum(steps) == pytest.approx(300 * frame / dt, abs=1.0)
    assert max(steps) <= frame / dt + 1.0


def test_a_frame_of_whole_periods_has_all_of_them() -> None:
    pace, now, steps = Pace(0.1, now=0.0), 0.0, []
    for _ in range(50):
        now += 0.3
        steps.append(pace.due(now))
    assert steps == [3] * 50


def test_what_a_slow_frame_missed_is_left_out() -> None:
    pace = Pace(0.01, now=0.0)
    assert pace.due(7.0) == MOST_STEPS
    assert pace.due(7.03) == 3


def test_time_that_stands_still_is_not_made_up_for() -> None:
    pace = Pace(0.01, now=0.0)
    assert pace.due(0.1) == 10
    assert [pace.due(now, running=False) for now in (0.2, 5.0, 9.0)] == [0, 0, 0]
    assert pace.due(9.02) == 2
