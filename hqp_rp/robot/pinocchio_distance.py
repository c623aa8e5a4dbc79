"""Distances between the collision geometries of a Pinocchio robot, with their derivatives, computed by coal."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import coal
import numpy as np
import pinocchio as pin

from hqp_rp.core.errors import RobotError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.distance import Side
from hqp_rp.robot.geoms import Geoms, pairs_of
from hqp_rp.robot.pinocchio_geometry import convex_hull, geoms_of

if TYPE_CHECKING:
    from hqp_rp.robot.pinocchio_robot import PinocchioRobot

_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_TOLERANCE = 1e-9
"""m, of coal's iteration between separated shapes (GJK), whose nearest points are less exact than its distances. That for
overlapping ones (EPA) keeps its own 1e-6: at 1e-8 it answered 2 of 1000 placements with a depth wrong by centimetres."""
_NO_ANSWER = 1e300
"""m: coal says with the largest float that it found no depth."""


class PinocchioDistances:
    """Signed distances between pairs of collision objects, and their Jacobians, at the configuration of a `PinocchioRobot`.

    What they are, `hqp_rp.robot.distance.Distances` says; the derivative is exact wherever the distance has one, as for
    `MujocoDistances`. Names are those of the geometry's objects and of the links (frames) that carry them. A mesh is its
    convex hull, as it is to MuJoCo. The unit normal is coal's own, so that touching objects have one too.

    Args:
        robot: its model and geometry are used; they are not changed.
        pairs: what is measured, see `hqp_rp.robot.geoms.pairs_of`. detection: m, > 0: pairs farther apart are not looked at.

    Attributes:
        names: the two objects of each pair.

    Raises:
        RobotError: as `pairs_of`; a robot without geometry; a mesh without volume.
    """

    def __init__(self, robot: PinocchioRobot, pairs: Sequence[tuple[Side, Side]], *, detection: float = 1.0) -> None:
        self._model = model = robot.model
        source = robot.geometry
        geoms = _restricted(robot.mujoco_geoms or geoms_of(model, source), source)
        found = pairs_of(geoms, pairs)
        self.names = tuple((geoms.shown[a], geoms.shown[b]) for a, b in found)
        self.drift = np.zeros(len(found))
        self._detection = float(detection)
        self._data = model.createData()
        # A geometry of its own: what is measured and nothing else, meshes as their hulls.
        self._geometry = pin.GeometryModel()
        index = {}
        for geom in dict.fromkeys(itertools.chain.from_iterable(found)):
            item = source.geometryObjects[source.getGeometryId(geoms.shown[geom])]
            own = pin.GeometryObject(item.name, item.parentJoint, item.placement, _convex(item))
            index[geom] = self._geometry.addGeometryObject(own)
        for a, b in found:
            self._geometry.addCollisionPair(pin.CollisionPair(index[a], index[b]))
        # Some pairs that touch have no answer at a fine tolerance; the library's own has always given one.
        self._fine, self._coarse = self._geometry.createData(), self._geometry.createData()
        for data, tolerance in ((self._fine, _TOLERANCE), (self._coarse, None)):
            # Requests of our own: Pinocchio's begin where the last call ended, and the answer would depend on that.
            request = coal.DistanceRequest()
            if tolerance is not None:
                request.gjk_tolerance = tolerance
            for i in range(len(found)):
                data.distanceRequests[i] = request
        joints = [int(item.parentJoint) for item in self._geometry.geometryObjects]
        self._joints = sorted({joints[index[geom]] for pair in found for geom in pair})
        place = {joint: i for i, joint in enumerate(self._joints)}
        self._sides = np.array([[place[joints[index[geom]]] for geom in pair] for pair in found], dtype=np.int64)

    def __len__(self) -> int:
        return len(self.names)

    def distances(self, q: FloatArray) -> FloatArray:
        """(m,) distances in m at the configuration q (nq,); infinite for pairs beyond the detection distance."""
        pin.forwardKinematics(self._model, self._data, self._normalized(q))
        return self._within_detection(self._measure())

    def evaluate(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distances (m,) in m and their Jacobian (m, nv) in m per unit v; infinite and zero beyond detection."""
        model, data = self._model, self._data
        pin.computeJointJacobians(model, data, self._normalized(q))
        results = self._measure()
        distances = self._within_detection(results)
        origins = np.array([data.oMi[joint].translation for joint in self._joints])
        jacobians = np.array(
            [pin.getJointJacobian(model, data, joint, _ALIGNED).reshape(6, -1) for joint in self._joints]
        )
        normals = np.array([_direction(result.normal) for result in results])
        jacobian: FloatArray = np.zeros((len(self), int(model.nv)))
        for sign, side, points in (
            (1.0, self._sides[:, 1], [result.getNearestPoint2() for result in results]),
            (-1.0, self._sides[:, 0], [result.getNearestPoint1() for result in results]),
        ):
            # n . (v + w x r) = n . v + (r x n) . w, r from the joint's origin to the point.
            wrench = np.hstack([normals, np.cross(np.array(points) - origins[side], normals)])
            jacobian += sign * np.matmul(wrench[:, None, :], jacobians[side])[:, 0]
        jacobian[np.isinf(distances)] = 0.0
        return distances, jacobian

    def _measure(self) -> list[Any]:
        """coal's result for each pair, at the placements in `_data`."""
        pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._fine)
        pin.computeDistances(self._geometry, self._fine)
        results = list(self._fine.distanceResults)
        answered = np.array([(result.min_distance, *result.normal) for result in results])
        failed = np.flatnonzero(~(np.isfinite(answered).all(axis=1) & (np.abs(answered[:, 0]) < _NO_ANSWER))).tolist()
        if failed:
            pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._coarse)
            for i in failed:
                pin.computeDistance(self._geometry, self._coarse, i)
                results[i] = self._coarse.distanceResults[i]
        return results

    def _within_detection(self, results: list[Any]) -> FloatArray:
        found = np.array([result.min_distance for result in results])
        return np.where(found < self._detection, found, np.inf)

    def _normalized(self, q: FloatArray) -> FloatArray:
        return q if self._model.nq == self._model.nv else np.asarray(pin.normalize(self._model, q))


def _direction(normal: FloatArray) -> FloatArray:
    """The unit normal; where the library has none, as of centres that coincide, some direction."""
    return normal if np.isfinite(normal).all() and normal.any() else np.array([0.0, 0.0, 1.0])


def _convex(item: Any) -> Any:
    """The shape of a geometry object, a mesh as its convex hull."""
    shape = item.geometry
    if shape.getObjectType() != coal.OBJECT_TYPE.OT_BVH:
        return shape
    try:
        return convex_hull(shape.vertices())
    except RobotError as error:
        raise RobotError(f"Distances: {item.name!r} is {error}; use a box or a mesh with volume instead.") from None


def _restricted(geoms: Geoms, geometry: Any) -> Geoms:
    """The geoms with all pairs excluded but the collision pairs of the geometry, where it has any."""
    if not len(geometry.collisionPairs):
        return geoms
    number = {name: i for i, name in enumerate(geoms.shown)}
    names = [item.name for item in geometry.geometryObjects]
    kept = {tuple(sorted((number[names[pair.first]], number[names[pair.second]]))) for pair in geometry.collisionPairs}
    others = set(itertools.combinations(range(len(geoms.shown)), 2)) - kept
    return dataclasses.replace(geoms, excluded=geoms.excluded | others)
