"""The pass around ball and post: what the straight way would hit, who keeps the distance, and who pays."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp.core.errors import SettingError
from hqp_rp.core.solution import Status
from hqp_rp.core.solver import get_solver
from hqp_rp.scenarios.obstacle_pass import ObstaclePass
from tests.scenarios.crossings import by_case, measured, run


def test_the_straight_way_goes_through_the_ball_and_the_start_is_free() -> None:
    scenario = ObstaclePass()
    steps = by_case(run(scenario, get_solver("null_space")))["no limits"]
    distance = measured(steps, "smallest distance [m]")
    assert distance[0] > 0.1
    assert distance.min() < -0.05
    np.testing.assert_allclose(
        measured(steps, "distance violation [m]"), np.maximum(scenario.margin - distance, 0.0), atol=1e-15
    )
    assert measured(steps, "tool position error [m]").max() < 0.01


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_collision_first_keeps_the_distance_and_the_tool_pays_and_recovers(seed: int) -> None:
    scenario = ObstaclePass()
    steps = by_case(run(scenario, get_solver("hierarchical_active_set"), seed))["collision first"]
    assert {step.solution.status for step in steps} == {Status.SOLVED}
    assert measured(steps, "smallest distance [m]").min() > scenario.margin - 1e-3
    error = measured(steps, "tool position error [m]")
    assert error.max() > 0.1
    assert error[-1] < 0.02
    # Out there, at rest, the tool is at its target again, with the post beside the arm.
    assert error[round(0.5 * len(steps))] < 0.02
    assert steps[0].problem.names == ("collision", "tool position", "posture")
    assert steps[0].problem.levels[0].m == 10


def test_hard_collision_rows_may_contradict_a_bounded_acceleration() -> None:
    """The status says so, nothing infeasible is passed off as solved, and the robot brakes within its limits."""
    steps = by_case(run(ObstaclePass(), get_solver("hierarchical_active_set")))["collision hard"]
    statuses = {step.solution.status for step in steps}
    assert statuses <= {Status.SOLVED, Status.INFEASIBLE}
    assert measured(steps, "acceleration limit violation [rad/s^2]").max() < 1e-9
    free = [step for step in steps if step.solution.status is Status.SOLVED]
    for step in free:
        hard, x = step.problem.hard, step.solution.x
        assert hard is not None
        assert x is not None
        assert (hard.A @ x >= hard.lower - 1e-8).all()
        assert (hard.A @ x <= hard.upper + 1e-8).all()
    calm = ObstaclePass(deceleration=1.0, acceleration=30.0)
    steps = by_case(run(calm, get_solver("hierarchical_active_set")))["collision hard"]
    assert {step.solution.status for step in steps} == {Status.SOLVED}
    assert measured(steps, "smallest distance [m]").min() > calm.margin - 1e-3


def test_settings_of_its_own() -> None:
    with pytest.raises(SettingError, match=r"margin of obstacle_pass is -0.1; it must be a finite number >= 0"):
        ObstaclePass(margin=-0.1)
    with pytest.raises(SettingError, match=r"collision_gain of obstacle_pass is 0; it must be a finite number > 0"):
        ObstaclePass(collision_gain=0)
