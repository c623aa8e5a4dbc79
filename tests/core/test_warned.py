"""A warning points at the line of the user, whichever way it comes about."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hqp_rp import JointLimit, MotionRunner, PositionTask, PostureTask, Stack, load_robot
from hqp_rp.core.warned import warn
from hqp_rp.robot import MujocoRobot, PinocchioRobot, planar_arm
from hqp_rp.robot.robot_source import RobotSource

ARM = """
<mujoco model="arm">
  <compiler angle="radian"/>
  <worldbody>
    <body name="link" pos="0 0 0.1">
      <joint name="elbow" axis="0 1 0" range="0.5 2.0"/>
      <geom type="capsule" size="0.04" fromto="0 0 0 0.35 0 0"/>
      <site name="tip" pos="0.35 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    return path


def place(call: Callable[[], object]) -> tuple[str, str]:
    """The file and the first word of the message of the first warning."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        call()
    assert found
    return found[0].filename, str(found[0].message)


@pytest.mark.parametrize("library", ["mujoco", "pinocchio"])
def test_a_neutral_outside_its_limits_points_at_who_loads_the_robot(arm: Path, library: str) -> None:
    adapter = {"mujoco": MujocoRobot, "pinocchio": PinocchioRobot}[library]
    for load in (
        lambda: load_robot(arm, library),
        lambda: adapter.from_file(arm),
        lambda: RobotSource(str(arm), library).robot(),
        functools.partial(load_robot, arm, library),
    ):
        file, message = place(load)
        assert file == __file__
        assert "'elbow' at 0, outside its limits [0.5, 2]" in message


def test_what_a_stack_warns_of_points_at_who_asks_for_a_problem(arm: Path) -> None:
    robot = load_robot(arm, neutral=[1.0])
    robot.update(robot.neutral)
    rest, eager = np.zeros(1), Stack([PostureTask([1.0], gain=200.0)])
    for call in (
        lambda: Stack([PostureTask([1.0], gain=2.0)]).problem(robot, 2.0),
        lambda: Stack([PositionTask("tip", [0.1, 0.0, 0.0])], limits=[JointLimit()]).problem(robot, 0.01, rest),
        lambda: MotionRunner(eager, "hierarchical_active_set", acceleration=1.0).step(robot, 0.01),
    ):
        file, _ = place(call)
        assert file == __file__


def test_a_call_from_outside_is_its_own_place() -> None:
    assert place(lambda: warn("here")) == (__file__, "here")
    assert place(lambda: planar_arm(2) and warn("there")) == (__file__, "there")
