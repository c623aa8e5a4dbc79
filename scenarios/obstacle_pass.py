"""Who takes the tool past an obstacle without touching it, and at whose expense?"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hqp_rp.control.collision_limit import CollisionLimit
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.position_task import PositionTask
from hqp_rp.control.posture_task import PostureTask
from hqp_rp.control.stack import Stack
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.arms import sawyer
from hqp_rp.scenarios._limited import IDEAL_ROBOT, Limited, Scene, out_and_back

if TYPE_CHECKING:
    from hqp_rp.robot.mujoco_robot import MujocoRobot

_FIRST, _HARD, _NONE = "collision first", "collision hard", "no limits"

_LINKS = ("link3", "link4", "link5", "link6", "link7")
_POST = "post"
_BALL = "ball"
_PATH = np.array([0.05, 0.75, -0.1])
"""m, from the tool's place at neutral to the far end of its path."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ObstaclePass(Limited):
    """The Sawyer of Table 1 moves its tool along a straight line and back, past a ball on the way and a post at its side.

    The target passes through the ball, a little beside its centre; the post stands where the elbow would go. Every link from
    the third on is kept `margin` away from both (`CollisionLimit`, ten rows). Three cases, on the same motion::

        "collision first"   the collision rows are the first level, tool position the second, posture the third;
                            joint positions, velocities and accelerations are one hard box (`JointLimit`)
        "collision hard"    the collision rows are hard as well; tool position is the first level, posture the second
        "no limits"         tool position before posture alone: what closed forms take

    Hard collision rows and a bounded acceleration may contradict each other: an infeasible step makes the robot brake. The
    rows slow down with `deceleration`, which leaves the joints room to obey. Seed 0 is as described; every other seed moves
    ball and post (normal, standard deviation `spread` of each coordinate).

    Args:
        margin: m, >= 0. deceleration: m/s^2, > 0, of an approach. acceleration: rad/s^2, > 0, of the joints.
        gain: 1/s, of the tool; posture_gain: 1/s; collision_gain: 1/s. Each with gain * period <= 1; the last > 0.
        spread: m, >= 0.

    See `Limited` for what is measured; distances are those of the ten pairs. Errors: "tool position error [m]",
    "posture error [rad]", norms.

    Raises:
        SettingError: a setting out of its range.
    """

    name: ClassVar[str] = "obstacle_pass"
    question: ClassVar[str] = (
        "Who takes the tool past an obstacle without touching it, and what do tool and posture pay?"
    )
    cannot_tell: ClassVar[tuple[str, ...]] = (
        *IDEAL_ROBOT,
        "The rows look one step ahead: where a detour must be planned, none of these solvers finds it. The ball is placed so "
        "that the tool can slide around it.",
        "Links are capsules and obstacles a ball and a capsule, whose distances are smooth; edges would be harder on everyone.",
        "Solvers that take no inequality appear in the case without limits only, where nobody told them of any obstacle.",
    )

    margin: float = 0.02
    deceleration: float = 3.0
    acceleration: float = 10.0
    gain: float = 5.0
    posture_gain: float = 2.0
    collision_gain: float = 8.0
    spread: float = 0.02

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("deceleration", "acceleration", "collision_gain"):
            self.require(name, lambda value: value > 0.0, "> 0")
        for name in ("margin", "spread"):
            self.require(name, lambda value: value >= 0.0, ">= 0")
        self.require_gains("gain", "posture_gain", "collision_gain")

    def cases(self) -> tuple[str, ...]:
        return (_FIRST, _HARD, _NONE)

    def robot(self, seed: int) -> MujocoRobot:
        """The arm with the ball and the post of that seed, at neutral."""
        import mujoco

        from hqp_rp.robot.mujoco_arm import arm_spec
        from hqp_rp.robot.mujoco_robot import MujocoRobot

        arm = sawyer()
        ball, post = self._places(seed)
        spec = arm_spec(arm)
        world = spec.worldbody
        world.add_geom(name=_BALL, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.08, 0.0, 0.0], pos=ball)
        ends = [*post, 0.0, *post, 1.1]
        world.add_geom(name=_POST, type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[0.04, 0.0, 0.0], fromto=ends)
        return MujocoRobot.from_spec(spec, velocity_limit=arm.velocity_limit, neutral=arm.neutral)

    def scene(self, seed: int) -> Scene:
        robot = self.robot(seed)
        origin = robot.pose("tool")[1]
        tool = PositionTask("tool", origin, gain=self.gain, name="tool position")
        posture = PostureTask(robot.neutral, gain=self.posture_gain)
        box = JointLimit(acceleration=self.acceleration)
        collision = CollisionLimit(
            [(_LINKS, (_BALL, _POST))],
            margin=self.margin,
            gain=self.collision_gain,
            deceleration=self.deceleration,
            detection=2.0,
        )

        def refer(time: float) -> None:
            s, rate = out_and_back(time, self.duration)
            tool.target = origin + s * _PATH
            tool.feedforward = rate * _PATH

        return Scene(
            robot=robot,
            start=robot.neutral.copy(),
            stacks={
                _FIRST: Stack([collision, tool, posture], [box]),
                _HARD: Stack([tool, posture], [box, collision]),
                _NONE: Stack([tool, posture]),
            },
            refer=refer,
            errors={
                "tool position error [m]": lambda: float(np.linalg.norm(tool.error(robot))),
                "posture error [rad]": lambda: float(np.linalg.norm(posture.error(robot))),
            },
            speed=robot.velocity_limit,
            acceleration=np.full(robot.nv, self.acceleration),
            distance=lambda: float(collision.distances(robot).min()),
            margin=self.margin,
        )

    def _places(self, seed: int) -> tuple[FloatArray, FloatArray]:
        """Centre of the ball (3,) and foot of the post (2,) in m."""
        ball, post = np.array([0.455, -0.14, 0.70]), np.array([0.36, 0.25])
        if seed:
            rng = np.random.default_rng(seed)
            ball, post = ball + rng.normal(scale=self.spread, size=3), post + rng.normal(scale=self.spread, size=2)
        return ball, post
