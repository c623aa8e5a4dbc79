"""The humanoid: what it is made of, what each level keeps, and the extra that it needs."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from hqp_rp.core.errors import MissingExtraError
from hqp_rp.core.solution import Status
from hqp_rp.core.solver import get_solver
from hqp_rp.scenarios.humanoid_reach import HumanoidReach
from tests.scenarios.crossings import by_case, measured, run


def test_the_robot_has_32_joints_and_stands_balanced_within_its_limits() -> None:
    robot = HumanoidReach().robot()
    assert robot.nv == 6 + 32
    assert not any("THUMB" in name or "INDEX" in name or "LITTLE" in name for name in robot.joint_names)
    q = robot.neutral[7:]
    assert (q >= robot.lower[6:]).all()
    assert (q <= robot.upper[6:]).all()
    assert np.isfinite(robot.velocity_limit[6:]).all()
    left, right = (robot.pose(foot)[1] for foot in ("l_ankle", "r_ankle"))
    assert left[2] == pytest.approx(0.0, abs=1e-9)
    assert right[2] == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.norm((robot.center_of_mass() - 0.5 * (left + right))[:2]) < 0.03


def test_five_levels_with_every_limit_hard() -> None:
    step = next(HumanoidReach().steps(get_solver("hierarchical_active_set"), 0))
    assert step.problem.names == ("feet", "balance", "hand", "gaze", "posture")
    assert [level.m for level in step.problem.levels] == [12, 2, 3, 2, 32]
    assert step.problem.hard is not None
    assert step.problem.hard.m == 38


@pytest.mark.parametrize("seed", [0, 1])
def test_feet_and_balance_hold_and_the_hand_gets_there_within_the_limits(seed: int) -> None:
    scenario = HumanoidReach()
    steps = by_case(run(scenario, get_solver("hierarchical_active_set"), seed))["hard limits"]
    assert {step.solution.status for step in steps} == {Status.SOLVED}
    assert measured(steps, "position limit violation [rad]").max() < 1e-9
    assert measured(steps, "acceleration limit violation [rad/s^2]").max() < 1e-9
    assert measured(steps, "feet error [m, rad]").max() < 0.06  # integration over 40 ms, no more
    assert measured(steps, "balance error [m]").max() < 0.03
    hand = measured(steps, "hand error [m]")
    assert hand[round(0.53 * len(steps))] < 0.03
    assert hand[-1] < 0.01


def test_without_the_extra_it_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jvrc_description", None)
    scenario = HumanoidReach()
    assert scenario.length() == 3 * scenario.periods()  # known without the robot
    for ask in (scenario.check, lambda: list(scenario.steps(get_solver("null_space"), 0))):
        with pytest.raises(MissingExtraError, match=r'JVRC-1.*pip install jvrc-description, .*"humanoid"'):
            ask()
    monkeypatch.undo()
    scenario.check()
