"""Does strict priority carry over to a humanoid: five levels on 38 velocities, with every joint limit hard?"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from hqp_rp.control.center_of_mass_task import CenterOfMassTask
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.pointing_task import PointingTask
from hqp_rp.control.pose_task import PoseTask
from hqp_rp.control.position_task import PositionTask
from hqp_rp.control.posture_task import PostureTask
from hqp_rp.control.stack import Stack
from hqp_rp.core.extras import require
from hqp_rp.core.problem import FloatArray
from hqp_rp.scenarios._limited import IDEAL_ROBOT, Limited, Scene, out_and_back

if TYPE_CHECKING:
    from hqp_rp.robot.mujoco_robot import MujocoRobot

_HARD, _FIRST, _NONE = "hard limits", "limits first", "no limits"

_FEET = ("r_ankle", "l_ankle")
_HAND = "r_wrist"
_HEAD = "NECK_P_S"
_FINGERS = ("THUMB", "INDEX", "LITTLE")
_STANCE = {
    "HIP_P": -0.5,
    "KNEE": 1.0,
    "ANKLE_P": -0.5,
    "R_SHOULDER_R": -0.2,
    "L_SHOULDER_R": 0.2,
    "ELBOW_P": -0.9,
}
"""rad, by the end of the joint's name; zero for the others."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class HumanoidReach(Limited):
    """JVRC-1, a humanoid of 32 joints on a floating base, reaches with its right hand for a target near the floor, and back.

    The levels are

        1  feet            both feet stay where they stand (12 rows)
        2  balance         the centre of mass stays over the middle of the feet, in x and y (2 rows)
        3  hand            the right wrist follows the target (3 rows)
        4  gaze            the head looks at the target (2 rows)
        5  posture         the 32 joints return to the stance

    Position, velocity and acceleration limits of the joints are one box, `JointLimit`; the base has none. The target ends
    near the floor in front, where the hand comes only when legs, waist and shoulder go into their limits. Three cases, on
    the same motion::

        "hard limits"    the box is hard
        "limits first"   the box is the first level, soft; the five levels follow as 2 to 6
        "no limits"      the five levels alone: what closed forms take

    The robot is the URDF of the package jvrc-description (0.7 MB, Apache 2.0), with its own position and velocity limits, and
    without the twelve finger joints, which no task uses. Seed 0 is as described; every other seed moves the far end of the
    target's path (normal, standard deviation `spread` of each coordinate).

    Args:
        acceleration: rad/s^2, > 0. gain: 1/s, of the levels 1 to 4; posture_gain: 1/s; each with gain * period <= 1.
        spread: m, >= 0.

    See `Limited` for what is measured. Errors: "feet error [m, rad]", "balance error [m]", "hand error [m]",
    "gaze error [rad]", "posture error [rad]", norms.

    Raises:
        SettingError: a setting out of its range.
        MissingExtraError: the package jvrc-description is not installed.
    """

    name: ClassVar[str] = "humanoid_reach"
    question: ClassVar[str] = (
        "Does strict priority carry over to a humanoid: who keeps feet, balance and hand within the joint limits, at what "
        "price and in what time?"
    )
    cannot_tell: ClassVar[tuple[str, ...]] = (
        *IDEAL_ROBOT,
        "Balance is the centre of mass over the feet, at rest: no contact forces, no friction, no momentum. A fast enough "
        "motion would tip the real robot over.",
        "The robot may pass through itself: no distance is limited.",
        "Solvers that take no inequality appear in the case without limits only, where nobody told them of any.",
    )

    duration: float = 4.0
    period: float = 0.04
    acceleration: float = 25.0
    gain: float = 4.0
    posture_gain: float = 2.0
    spread: float = 0.08

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require("acceleration", lambda value: value > 0.0, "> 0")
        self.require("spread", lambda value: value >= 0.0, ">= 0")
        self.require_gains("gain", "posture_gain")

    def cases(self) -> tuple[str, ...]:
        return (_HARD, _FIRST, _NONE)

    def check(self) -> None:
        _urdf()

    def robot(self) -> MujocoRobot:
        """JVRC-1 on a floating base, without fingers, in its stance with the feet on the floor."""
        spec, speed = jvrc_spec()
        return in_stance(spec, speed)

    def scene(self, seed: int) -> Scene:
        robot = self.robot()
        feet = [PoseTask(foot, robot.pose(foot), gain=self.gain) for foot in _FEET]
        middle = 0.5 * sum(robot.pose(foot)[1] for foot in _FEET)
        balance = CenterOfMassTask(middle, axes="xy", gain=self.gain, name="balance")
        origin = robot.pose(_HAND)[1]
        path = self._far_end(seed) - origin
        hand = PositionTask(_HAND, origin, gain=self.gain, name="hand")
        gaze = PointingTask(_HEAD, path, axis="x", gain=self.gain, name="gaze")
        posture = PostureTask(robot.neutral, joints=range(6, robot.nv), gain=self.posture_gain)
        levels = [feet, balance, hand, gaze, posture]
        names = ["feet", "balance", "hand", "gaze", "posture"]
        acceleration = np.concatenate([np.full(6, np.inf), np.full(robot.nv - 6, self.acceleration)])
        box = JointLimit(acceleration=acceleration)

        def refer(time: float) -> None:
            s, rate = out_and_back(time, self.duration)
            hand.target, hand.feedforward = origin + s * path, rate * path
            gaze.direction = hand.target - robot.pose(_HEAD)[1]

        def miss(*tasks: PoseTask | CenterOfMassTask | PositionTask | PointingTask | PostureTask) -> float:
            return float(np.linalg.norm(np.concatenate([task.error(robot) for task in tasks])))

        return Scene(
            robot=robot,
            start=robot.neutral.copy(),
            stacks={
                _HARD: Stack(levels, [box], names=names),
                _FIRST: Stack([box, *levels], names=["limits", *names]),
                _NONE: Stack(levels, names=names),
            },
            refer=refer,
            errors={
                "feet error [m, rad]": lambda: miss(*feet),
                "balance error [m]": lambda: miss(balance),
                "hand error [m]": lambda: miss(hand),
                "gaze error [rad]": lambda: miss(gaze),
                "posture error [rad]": lambda: miss(posture),
            },
            speed=robot.velocity_limit,
            acceleration=acceleration,
        )

    def _far_end(self, seed: int) -> FloatArray:
        """(3,) m, where the target rests."""
        end = np.array([0.65, -0.45, 0.15])
        return end if not seed else end + np.random.default_rng(seed).normal(scale=self.spread, size=3)


def jvrc_spec() -> tuple[Any, dict[str, float]]:
    """The editable MuJoCo model of JVRC-1 on a floating base, without fingers and meshes, and its velocity limits, rad/s."""
    from hqp_rp.robot.model_file import urdf_velocity_limits
    from hqp_rp.robot.mujoco_file import mujoco_spec

    path = _urdf()
    spec = mujoco_spec(path, floating_base=True, meshes=False)
    # The lower finger joints are coupled to the upper ones.
    for equality in list(spec.equalities):
        spec.delete(equality)
    for joint in list(spec.joints):
        if joint.name.endswith(_FINGERS):
            spec.delete(joint)
    kept = {joint.name for joint in spec.joints}
    return spec, {name: value for name, value in urdf_velocity_limits(path).items() if name in kept}


def in_stance(spec: Any, speed: dict[str, float], height: float = 0.0) -> MujocoRobot:
    """The robot of the spec, its neutral configuration the stance with the ankles at that height, m."""
    from hqp_rp.robot.mujoco_robot import MujocoRobot

    robot = MujocoRobot.from_spec(spec, velocity_limit=speed)
    q = robot.neutral.copy()
    for i, name in enumerate(robot.joint_names[1:]):
        q[7 + i] = next((angle for end, angle in _STANCE.items() if name.endswith(end)), 0.0)
    robot.update(q)
    q[2] += height - robot.pose(_FEET[0])[1][2]
    return MujocoRobot(robot.model, velocity_limit=robot.velocity_limit, neutral=q)


def jvrc_efforts() -> dict[str, float]:
    """Joint -> the greatest torque that the URDF states, N m."""
    from hqp_rp.robot.model_file import urdf_effort_limits

    return urdf_effort_limits(_urdf())


def _urdf() -> str:
    require("The robot JVRC-1 of humanoid_reach", "jvrc_description")
    import jvrc_description

    return str(jvrc_description.urdf_path)
