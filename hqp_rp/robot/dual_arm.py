"""Two equal arms side by side on one base, as one MuJoCo model."""

from __future__ import annotations

import math

import mujoco

from hqp_rp.core.errors import RobotError
from hqp_rp.robot.dh import DHArm
from hqp_rp.robot.mujoco_arm import arm_spec
from hqp_rp.robot.mujoco_robot import MujocoRobot

SIDES = ("left", "right")


def dual_arm_spec(arm: DHArm, shoulder: float = 0.3) -> mujoco.MjSpec:
    """The editable MuJoCo model of two `arm`s, their first joints `shoulder` m to the left (+y) and right of the middle.

    Every name of `arm_spec` stands twice, after "left_" and after "right_": left_joint1, right_tool and so on; the left
    arm's joints come first. Gravity and the other options are the arm's. Raises `RobotError` for a shoulder that is not a
    finite number >= 0.
    """
    if isinstance(shoulder, bool) or not isinstance(shoulder, int | float) or not 0.0 <= shoulder < math.inf:
        raise RobotError(f"shoulder is {shoulder!r}; it must be a finite number of metres >= 0.")
    spec = mujoco.MjSpec()
    spec.modelname = f"dual_{arm.name}"
    spec.compiler.degree = False
    spec.option.gravity = arm.gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for side, y in zip(SIDES, (shoulder, -shoulder), strict=True):
        frame = spec.worldbody.add_frame(name=side, pos=[0.0, y, 0.0])
        one = arm_spec(arm)
        for key in list(one.keys):
            one.delete(key)  # a key of one arm is no configuration of both
        spec.option.timestep = one.option.timestep
        spec.attach(one, frame=frame, prefix=f"{side}_")
    return spec


def dual_arm(arm: DHArm, shoulder: float = 0.3) -> MujocoRobot:
    """The robot of `dual_arm_spec`, with the arm's velocity limits and neutral configuration on both sides."""
    return MujocoRobot.from_spec(
        dual_arm_spec(arm, shoulder),
        velocity_limit=(*arm.velocity_limit, *arm.velocity_limit),
        neutral=(*arm.neutral, *arm.neutral),
    )
