"""Distances between geoms of a MuJoCo model, with their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.distance import Side
from hqp_rp.robot.geoms import pairs_of
from hqp_rp.robot.mujoco_model import geoms_of

if TYPE_CHECKING:
    from hqp_rp.robot.mujoco_robot import MujocoRobot

_TOUCHING = 1e-7
"""m: below this distance the line between the nearest points has no direction to be relied on."""
_NUDGE = 1e-4
"""m: how far a touching geom is moved to find the direction in which it would leave."""


class MujocoDistances:
    """Signed distances between pairs of geoms, and their Jacobians, at the configuration of a `MujocoRobot`.

    With p_1 and p_2 the nearest points of the two geoms and n the unit vector from p_1 to p_2 (where they overlap, the
    points are those of deepest overlap, the distance is negative and n points from p_2 to p_1)::

        distance = n . (p_2 - p_1),      d(distance)/dt = n . (J_{p_2} - J_{p_1}) v

    with J_p the linear Jacobian of the body point that is at p. This is the exact derivative wherever the distance has one:
    the nearest points slide along surfaces to which n is normal. It jumps where the nearest points do, as between the edges
    of boxes, and is less exact the deeper two geoms overlap. Distances come from `mujoco.mj_geomDistance`: closed forms for
    spheres, capsules and planes, else an iteration that ends at the model's `ccd_tolerance` (1e-6 m by default).

    Args:
        robot: its model is used; it is not changed.
        pairs: what is measured, see `hqp_rp.robot.geoms.pairs_of`. detection: m, > 0: pairs farther apart are not looked at.

    Attributes:
        geoms: (m, 2) pairs of geom ids, one row for each pair of geoms. names: their names.
        drift: (m,) m/s, how fast each distance changes by the motion of mocap bodies, at the last `evaluate`.

    Raises:
        RobotError: as `pairs_of`.
    """

    def __init__(self, robot: MujocoRobot, pairs: Sequence[tuple[Side, Side]], *, detection: float = 1.0) -> None:
        self._robot = robot
        self._model = model = robot.model
        self._data = mujoco.MjData(model)
        self._detection = float(detection)
        geoms = geoms_of(model)
        self.geoms = pairs_of(geoms, pairs)
        self.names = tuple((geoms.shown[a], geoms.shown[b]) for a, b in self.geoms)
        self._fromto = np.empty(6)
        self._jacobians = np.empty((2, 3, int(model.nv)))
        self.drift = np.zeros(len(self.geoms))

    def __len__(self) -> int:
        return len(self.geoms)

    def distances(self, q: FloatArray) -> FloatArray:
        """(m,) distances in m at the configuration q (nq,); infinite for pairs beyond the detection distance."""
        self._place(q)
        return np.array([self._measure(a, b) for a, b in self.geoms])

    def evaluate(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distances (m,) in m and their Jacobian (m, nv) in m per unit v; infinite and zero beyond detection."""
        model, data = self._model, self._data
        self._place(q)
        mujoco.mj_comPos(model, data)
        distances, jacobian = np.empty(len(self.geoms)), np.zeros((len(self.geoms), int(model.nv)))
        first, second = self._jacobians
        self.drift[:] = 0.0
        for i, (a, b) in enumerate(self.geoms):
            distances[i] = distance = self._measure(a, b)
            if distance == np.inf:
                continue
            points = self._fromto.copy()
            normal = self._normal(a, b, distance, points[3:] - points[:3])
            mujoco.mj_jac(model, data, first, None, points[:3], model.geom_bodyid[a])
            mujoco.mj_jac(model, data, second, None, points[3:], model.geom_bodyid[b])
            np.matmul(normal, second - first, out=jacobian[i])
            if model.nmocap:
                self.drift[i] = normal @ (self._velocity(b, points[3:]) - self._velocity(a, points[:3]))
        return distances, jacobian

    def _velocity(self, geom: int, point: FloatArray) -> FloatArray:
        """(3,) m/s of the point of a geom by the motion of its mocap body."""
        twist = self._robot.mocap_twist(geom)
        return np.zeros(3) if twist is None else twist[:3] + np.cross(twist[3:], point)

    def _place(self, q: FloatArray) -> None:
        self._data.qpos[:] = q
        if self._model.nmocap:
            self._data.mocap_pos[:], self._data.mocap_quat[:] = self._robot.mocap_poses
        mujoco.mj_kinematics(self._model, self._data)

    def _measure(self, a: int, b: int) -> float:
        """The distance, or infinity beyond the detection distance; the nearest points are left in `_fromto`."""
        found = float(mujoco.mj_geomDistance(self._model, self._data, a, b, self._detection, self._fromto))
        return found if found < self._detection else np.inf

    def _normal(self, a: int, b: int, distance: float, line: FloatArray) -> FloatArray:
        length = float(np.linalg.norm(line))
        if length > _TOUCHING:
            return np.asarray(line * (np.copysign(1.0, distance) / length))
        # The points coincide: the distance's gradient by moving b, which is n.
        position = self._data.geom_xpos[b]
        origin, gradient = position.copy(), np.empty(3)
        for axis in range(3):
            ends = []
            for nudge in (_NUDGE, -_NUDGE):
                position[axis] = origin[axis] + nudge
                ends.append(self._measure(a, b))
            position[axis] = origin[axis]
            gradient[axis] = ends[0] - ends[1]
        size = float(np.linalg.norm(gradient))
        return gradient / size if 0.0 < size < np.inf else np.array([0.0, 0.0, 1.0])
