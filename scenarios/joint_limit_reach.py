"""What does each solver make of a target that its joint limits do not let it reach?"""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.orientation_task import OrientationTask
from hqp_rp.control.position_task import PositionTask
from hqp_rp.control.posture_task import PostureTask
from hqp_rp.control.stack import Stack
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.arms import sawyer
from hqp_rp.scenarios._limited import IDEAL_ROBOT, Limited, Scene, out_and_back

_HARD, _FIRST, _NONE = "hard limits", "limits first", "no limits"


@dataclasses.dataclass(frozen=True, kw_only=True)
class JointLimitReach(Limited):
    """The Sawyer of Table 1, each joint free to move only `freedom` to either side, follows a target out of reach and back.

    The levels are tool position, tool orientation (as at the start) and posture (the neutral one). Position, velocity and
    acceleration limits are one box, `JointLimit`. The target goes `distance` outwards from the tool's place at neutral, rests
    and comes back (`out_and_back`). Three cases, on the same motion::

        "hard limits"    the box is hard; the three levels below it
        "limits first"   the box is the first level, soft; the three levels follow as 2 to 4
        "no limits"      the three levels alone: what closed forms take

    Seed 0 starts at neutral and the target goes along (1, 0, 0.3). Every other seed draws that direction (normal, standard
    deviation 0.3 of each part) and a start (normal, standard deviation `spread`), whose joint farthest out is then put
    `outside` beyond its limit: the way back is part of the question.

    Args:
        freedom: rad, > 0, each joint's range is neutral -+ freedom. distance: m, > 0. acceleration: rad/s^2, > 0.
        gain: 1/s, of both tool tasks; posture_gain: 1/s. Each >= 0 and gain * period <= 1.
        spread: rad, >= 0. outside: rad, >= 0.

    See `Limited` for what is measured. Errors: "tool position error [m]", "tool orientation error [rad]",
    "posture error [rad]", norms.

    Raises:
        SettingError: a setting out of its range.
    """

    name: ClassVar[str] = "joint_limit_reach"
    question: ClassVar[str] = (
        "When a target lies beyond the reach that the joint limits leave, who keeps the limits, and what does each level pay?"
    )
    cannot_tell: ClassVar[tuple[str, ...]] = (
        *IDEAL_ROBOT,
        "One arm, one kind of path; the ranges are narrower than the robot's own, so that every run meets them.",
        "Solvers that take no inequality appear in the case without limits only, where nobody told them of any.",
    )

    freedom: float = 0.8
    distance: float = 0.7
    acceleration: float = 10.0
    gain: float = 5.0
    posture_gain: float = 2.0
    spread: float = 0.2
    outside: float = 0.15

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("freedom", "distance", "acceleration"):
            self.require(name, lambda value: value > 0.0, "> 0")
        for name in ("spread", "outside"):
            self.require(name, lambda value: value >= 0.0, ">= 0")
        self.require_gains("gain", "posture_gain")

    def cases(self) -> tuple[str, ...]:
        return (_HARD, _FIRST, _NONE)

    def scene(self, seed: int) -> Scene:
        from hqp_rp.robot.mujoco_robot import MujocoRobot

        arm = sawyer()
        neutral = np.array(arm.neutral)
        lower, upper = neutral - self.freedom, neutral + self.freedom
        robot = MujocoRobot.from_arm(dataclasses.replace(arm, lower=tuple(lower), upper=tuple(upper)))
        rotation, origin = robot.pose("tool")
        direction, start = self._drawn(seed, neutral)
        position = PositionTask("tool", origin, gain=self.gain, name="tool position")
        orientation = OrientationTask("tool", rotation, gain=self.gain, name="tool orientation")
        posture = PostureTask(neutral, gain=self.posture_gain)
        box = JointLimit(acceleration=self.acceleration)
        levels = [position, orientation, posture]

        def refer(time: float) -> None:
            s, rate = out_and_back(time, self.duration)
            position.target = origin + s * self.distance * direction
            position.feedforward = rate * self.distance * direction

        return Scene(
            robot=robot,
            start=start,
            stacks={_HARD: Stack(levels, [box]), _FIRST: Stack([box, *levels]), _NONE: Stack(levels)},
            refer=refer,
            errors={
                "tool position error [m]": lambda: float(np.linalg.norm(position.error(robot))),
                "tool orientation error [rad]": lambda: float(np.linalg.norm(orientation.error(robot))),
                "posture error [rad]": lambda: float(np.linalg.norm(posture.error(robot))),
            },
            speed=robot.velocity_limit,
            acceleration=np.full(robot.nv, self.acceleration),
        )

    def _drawn(self, seed: int, neutral: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The unit direction (3,) of the target's path and the start (7,) in rad."""
        direction, offset = np.array([1.0, 0.0, 0.3]), np.zeros(len(neutral))
        if seed:
            rng = np.random.default_rng(seed)
            direction = direction + rng.normal(scale=0.3, size=3)
            offset = rng.normal(scale=self.spread, size=len(neutral))
            offset = np.clip(offset, -self.freedom, self.freedom)
            farthest = int(np.abs(offset).argmax())
            offset[farthest] = np.copysign(self.freedom + self.outside, offset[farthest])
        return direction / np.linalg.norm(direction), neutral + offset
