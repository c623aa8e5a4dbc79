"""Which solver carries a planar arm through an algorithmic singularity that is known in closed form?"""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from hqp_rp.control.orientation_task import OrientationTask
from hqp_rp.control.position_task import PositionTask
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.arms import planar_arm
from hqp_rp.robot.dh import DHArm
from hqp_rp.scenarios._crossing import Crossing

_FORWARD, _TURN = 0.2, 1.2
_DIRECTION = (3.0, 1.0, 6.0, -10.0)


@dataclasses.dataclass(frozen=True, kw_only=True)
class PlanarCrossing(Crossing):
    """Four links of L = 0.4 m: tool position (2 rows), orientation of link 2 (1 row), posture (4 rows). See `Crossing`.

    With the absolute angles theta_i = q_1 + ... + q_i, the tool stands still when sum_i L e(theta_i + pi/2) dtheta_i = 0;
    dtheta_2 is then forced to 0 exactly when links 1, 3 and 4 are parallel and link 2 is not. There the two tasks, each
    of full rank by itself, have dependent rows: q_c = (0.2, 1.2, -1.2, 0) rad, links 1, 3 and 4 at 0.2 rad in line and
    link 2 at 1.4 rad.

    The tool is then 3 L from where the turned link 2 alone would put it, and the three links reach no further: with the
    tool held, link 2 can turn back from 1.4 rad, but not on.
    """

    name: ClassVar[str] = "planar_crossing"
    question: ClassVar[str] = (
        "Which solver carries a planar arm through an algorithmic singularity with bounded joint velocities and the tool "
        "on its path?"
    )
    cannot_tell: ClassVar[tuple[str, ...]] = (
        *Crossing.cannot_tell,
        "All joints and links are of one size, and the second level is a single row: nothing is said about the scaling of "
        "rows against each other.",
    )

    def arm(self) -> DHArm:
        return planar_arm(4)

    def crossing(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        direction = np.array(_DIRECTION)
        singular = np.array([_FORWARD, _TURN, -_TURN, 0.0])
        return singular, direction / np.linalg.norm(direction), np.array([0.0, 0.0, 1.0])

    def tasks(self) -> tuple[PositionTask, OrientationTask]:
        return (
            PositionTask("tool", np.zeros(3), axes="xy", name="tool position"),
            OrientationTask("link2", np.eye(3), axes=("rz",), name="link 2 orientation"),
        )
