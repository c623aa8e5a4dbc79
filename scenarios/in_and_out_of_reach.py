"""What does a solver make of a target that moves in and out of reach, and what does damping of its level change?"""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.orientation_task import OrientationTask
from hqp_rp.control.position_task import PositionTask
from hqp_rp.control.posture_task import PostureTask
from hqp_rp.control.stack import Stack
from hqp_rp.core.damping import ErrorDamping
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.arms import sawyer
from hqp_rp.scenarios._limited import IDEAL_ROBOT, Limited, Scene, out_and_back

_EXACT, _DAMPED, _NONE = "hard limits", "hard limits, damped", "no limits"


@dataclasses.dataclass(frozen=True, kw_only=True)
class InAndOutOfReach(Limited):
    """The Sawyer of Table 1, at hard position and velocity limits, follows a target that leaves its workspace and comes back.

    The levels are tool position, tool orientation (as at the start) and posture (the neutral one). The target goes `distance`
    outwards from the tool's place at neutral, where the arm is long stretched, rests there and comes back (`out_and_back`).
    Three cases, on the same motion::

        "hard limits"            `JointLimit` is hard, no level is damped: the exact answer of each step
        "hard limits, damped"    the same with `ErrorDamping(factor, power=1)` at level 1, `second_factor` at level 2
        "no limits"              the levels alone, not damped: what closed forms take

    Solvers that know no damping of single levels refuse the second case. Seed 0 goes along (1, 0, 0.3); every other seed draws
    that direction (normal, standard deviation 0.3 of each part).

    Args:
        distance: m, > 0. factor, second_factor: of the damping, m s and s, >= 0.
        gain: 1/s, of both tool tasks; posture_gain: 1/s. Each >= 0 and gain * period <= 1.

    See `Limited` for what is measured. Errors: "tool position error [m]", "tool orientation error [rad]",
    "posture error [rad]", norms.

    Raises:
        SettingError: a setting out of its range.
    """

    name: ClassVar[str] = "in_and_out_of_reach"
    question: ClassVar[str] = (
        "When a target leaves the workspace and comes back, who follows it as far as can be without shaking, at what price?"
    )
    cannot_tell: ClassVar[tuple[str, ...]] = (
        *IDEAL_ROBOT,
        "One arm, one kind of path, one damping of each level: 0.01 m s at level 1, reach times period, and 0.1 s at level 2. "
        'The rule of the page "Still at the limit" gives 0.0125 m s and 0.25 s here: 99 % of the steps then change a joint by '
        "0.15 rad/s at most instead of 0.26, for 1.5 mm of distance.",
        "An ideal robot follows a shaking command; a real one does not, and wears.",
    )

    distance: float = 0.6
    factor: float = 0.01
    second_factor: float = 0.1
    gain: float = 4.0
    posture_gain: float = 1.0
    duration: float = 6.0
    period: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require("distance", lambda value: value > 0.0, "> 0")
        for name in ("factor", "second_factor"):
            self.require(name, lambda value: value >= 0.0, ">= 0")
        self.require_gains("gain", "posture_gain")

    def cases(self) -> tuple[str, ...]:
        return (_EXACT, _DAMPED, _NONE)

    def scene(self, seed: int) -> Scene:
        from hqp_rp.robot.mujoco_robot import MujocoRobot

        robot = MujocoRobot.from_arm(sawyer())
        robot.update(robot.neutral)
        rotation, origin = robot.pose("tool")
        direction = self._direction(seed)
        position = PositionTask("tool", origin, gain=self.gain, name="tool position")
        orientation = OrientationTask("tool", rotation, gain=self.gain, name="tool orientation")
        posture = PostureTask(robot.neutral, gain=self.posture_gain)
        levels, box = [position, orientation, posture], [JointLimit()]
        damping = [ErrorDamping(self.factor, power=1), ErrorDamping(self.second_factor, power=1), None]

        def refer(time: float) -> None:
            s, rate = out_and_back(time, self.duration)
            position.target = origin + s * self.distance * direction
            position.feedforward = rate * self.distance * direction

        return Scene(
            robot=robot,
            start=robot.neutral.copy(),
            stacks={
                _EXACT: Stack(levels, box),
                _DAMPED: Stack(levels, box, damping=damping),
                _NONE: Stack(levels),
            },
            refer=refer,
            errors={
                "tool position error [m]": lambda: float(np.linalg.norm(position.error(robot))),
                "tool orientation error [rad]": lambda: float(np.linalg.norm(orientation.error(robot))),
                "posture error [rad]": lambda: float(np.linalg.norm(posture.error(robot))),
            },
            speed=robot.velocity_limit,
            acceleration=np.full(robot.nv, np.inf),
        )

    def _direction(self, seed: int) -> FloatArray:
        direction = np.array([1.0, 0.0, 0.3])
        if seed:
            direction = direction + np.random.default_rng(seed).normal(scale=0.3, size=3)
        return direction / float(np.linalg.norm(direction))
