"""Which solver carries the Sawyer through an algorithmic singularity, found by search, of tool position and orientation?"""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from hqp_rp.control.orientation_task import OrientationTask
from hqp_rp.control.position_task import PositionTask
from hqp_rp.control.singularities import SingularConfiguration, search_singularities
from hqp_rp.control.stack import Stack
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.arms import sawyer
from hqp_rp.robot.dh import DHArm
from hqp_rp.scenarios._crossing import Crossing

# What `find_crossing()` returns: q rad, approach and task_direction.
_SINGULAR = (
    2.406911957557774,
    -1.8550432603516744,
    -0.16476845634790022,
    0.11260069008074637,
    -0.15931446801737056,
    -1.674562696681584,
    1.1902884928888224,
)
_DIRECTION = (
    0.0,
    0.006873508089533743,
    -0.3166355535918701,
    -0.9005511798848669,
    -0.2978252104461365,
    0.0015483923281260528,
    0.0,
)
_LOST = (0.137452838246112, 0.9822032913646943, -0.12799770189518905)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SawyerCrossing(Crossing):
    """The Sawyer of Table 1: tool position (3 rows), tool orientation (3 rows), posture (7 rows). See `Crossing`.

    The singular configuration, the direction of the path and the lost axis come from `find_crossing`. The arm is
    stretched out, its elbow about to straighten: both tasks keep full rank by themselves (smallest singular values 0.78
    and 0.13 of the largest, for orientation and position), their six rows together have rank 5. The path crosses it
    along the joint direction in which the lost singular value grows fastest, mostly the elbow's.
    """

    name: ClassVar[str] = "sawyer_crossing"
    question: ClassVar[str] = (
        "Which solver carries the Sawyer through an algorithmic singularity with bounded joint velocities and the tool on "
        "its path?"
    )
    cannot_tell: ClassVar[tuple[str, ...]] = (
        *Crossing.cannot_tell,
        "The Sawyer is Table 1's kinematics with primitive links; the real robot's inertias and servos differ.",
    )

    def arm(self) -> DHArm:
        return sawyer()

    def crossing(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        direction, axis = np.array(_DIRECTION), np.array(_LOST)
        return np.array(_SINGULAR), direction / np.linalg.norm(direction), axis / np.linalg.norm(axis)

    def tasks(self) -> tuple[PositionTask, OrientationTask]:
        return (
            PositionTask("tool", np.zeros(3), name="tool position"),
            OrientationTask("tool", np.eye(3), name="tool orientation"),
        )


def find_crossing(starts: int = 64, seed: int = 0, margin: float = 0.6) -> SingularConfiguration:
    """The search behind `SawyerCrossing`: of the algorithmic singularities of its two tasks that are an edge and at least
    `margin` rad from every joint limit, the one farthest from any kinematic singularity.

    Farthest: the largest min(own_sigma, earlier_sigma). With the defaults it remakes the constants of this file. Raises
    `SettingError` when these starts find none.
    """
    from hqp_rp.robot.mujoco_robot import MujocoRobot

    arm = sawyer()
    stack = Stack(SawyerCrossing().tasks())
    found = search_singularities(MujocoRobot.from_arm(arm), stack, level=1, starts=starts, seed=seed)
    inside = [
        place
        for place in found
        if place.is_edge and np.minimum(place.q - arm.lower, np.subtract(arm.upper, place.q)).min() >= margin
    ]
    if not inside:
        raise SettingError(f"starts is {starts!r}, margin is {margin!r}: these find no singularity; give more starts.")
    return max(inside, key=lambda place: min(place.own_sigma, place.earlier_sigma))
