"""The arms of the statistics, each with a stack of three levels whose first two can be met together nearly everywhere."""

from __future__ import annotations

import dataclasses
import functools
import math

from hqp_rp.control.stack import Stack
from hqp_rp.control.stack_file import load_stack
from hqp_rp.core.errors import unknown_name
from hqp_rp.robot.arms import planar_arm, sawyer
from hqp_rp.robot.dh import DHArm
from hqp_rp.robot.mujoco_robot import MujocoRobot


def panda_like() -> DHArm:
    """Kinematics and limits of Franka Emika's Panda, whose inertias are not published: each link counts as 2 kg.

    The manufacturer's rows are in the proximal (Craig) convention, (a, alpha) of row i + 1 standing where the distal one has
    those of row i: read so here, with the flange as the tool.

    Source: Franka Control Interface documentation, "Robot and interface specifications", DH parameters and limits.
    """
    half = math.pi / 2.0
    return DHArm(
        name="panda_like",
        d=(0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.107),
        a=(0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088, 0.0),
        alpha=(-half, half, half, -half, half, half, 0.0),
        lower=(-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973),
        upper=(2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973),
        velocity_limit=(2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
        mass=(2.0,),
        radius=(0.06,),
        neutral=(0.0, -0.25 * math.pi, 0.0, -0.75 * math.pi, 0.0, half, 0.25 * math.pi),
    )


@dataclasses.dataclass(frozen=True)
class Arm:
    """One arm with its stack file; title: what reports call it; levels: what its levels are."""

    name: str
    title: str
    stack: str

    def scene(self) -> tuple[MujocoRobot, Stack]:
        """The robot and its stack, built anew."""
        arms = {"sawyer": sawyer(), "panda_like": panda_like(), "planar4": planar_arm(4)}
        robot = MujocoRobot.from_arm(arms[self.name])
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
