"""The arms of the statistics, each with a stack of three levels whose first two can be met together nearly everywhere."""

from __future__ import annotations

import dataclasses
import functools

from hqp_rp.control.stack import Stack
from hqp_rp.control.stack_file import load_stack
from hqp_rp.core.errors import unknown_name
from hqp_rp.robot.mujoco_robot import MujocoRobot
from hqp_rp.robot.named import named_robot


@dataclasses.dataclass(frozen=True)
class Arm:
    """One arm with its stack file; title: what reports call it; levels: what its levels are."""

    name: str
    title: str
    stack: str

    def scene(self) -> tuple[MujocoRobot, Stack]:
        """The robot and its stack, built anew."""
        robot = named_robot(self.name)
        assert isinstance(robot, MujocoRobot)
        return robot, load_stack(self.stack).stack(robot)


ARMS = (
    Arm("sawyer", "Sawyer", "sawyer"),
    Arm("panda_like", "Panda-like arm", "sawyer"),
    Arm("planar4", "planar arm of 4 joints", "planar4"),
)


@functools.lru_cache(maxsize=len(ARMS))
def scene_of(name: str) -> tuple[MujocoRobot, Stack]:
    """The robot and the stack of that arm, built once in each process; `UnknownNameError` when there is no such arm."""
    return arm_named(name).scene()


def arm_named(name: str) -> Arm:
    """The arm of that name; `UnknownNameError` when there is none."""
    for arm in ARMS:
        if arm.name == name:
            return arm
    raise unknown_name("arm", name, [arm.name for arm in ARMS])
