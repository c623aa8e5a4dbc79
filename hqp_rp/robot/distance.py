"""Distances between geoms of a robot, whatever library computes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeAlias, runtime_checkable

from hqp_rp.core.errors import RobotError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

Side: TypeAlias = str | Sequence[str]
"""One side of a pair: the name of a geom or body, a pattern of names, or a sequence of these."""


class Distances(Protocol):
    """Signed distances between m pairs of geoms, and their Jacobians, as functions of the configuration.

    With p_1, p_2 the nearest points and n the unit vector from p_1 to p_2 (where two geoms overlap, the points are those of
    deepest overlap, the distance is negative and n points from p_2 to p_1)::

        distance = n . (p_2 - p_1),      d(distance)/dt = n . (J_{p_2} - J_{p_1}) v

    Attributes:
        names: the two geoms of each pair.
        drift: (m,) m/s, how fast each distance changes by the motion of what the robot does not move, at the last `evaluate`.
    """

    @property
    def names(self) -> tuple[tuple[str, str], ...]: ...

    @property
    def drift(self) -> FloatArray: ...

    def distances(self, q: FloatArray) -> FloatArray:
        """(m,) distances in m at the configuration q (nq,); infinite for pairs beyond the detection distance."""
        ...

    def evaluate(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distances (m,) in m and their Jacobian (m, nv) in m per unit v; infinite and zero beyond detection."""
        ...


@runtime_checkable
class MeasuresDistances(Protocol):
    """A robot whose library measures distances."""

    def distances_between(self, pairs: Sequence[tuple[Side, Side]], *, detection: float = 1.0) -> Distances: ...


def distances_of(robot: Robot, pairs: Sequence[tuple[Side, Side]], *, detection: float = 1.0) -> Distances:
    """The distances between these pairs, by the robot's own `distances_between`.

    Args:
        pairs: (a, b), see `hqp_rp.robot.geoms.pairs_of`. detection: m, > 0: pairs farther apart are not looked at.

    Raises:
        RobotError: a robot without geometry, or pairs that do not fit it.
    """
    if not isinstance(robot, MeasuresDistances):
        raise RobotError(
            "distances between geoms need a robot that MuJoCo or Pinocchio computes; this one is a "
            f"{type(robot).__name__}. Load it as hqp_rp.robot.MujocoRobot or PinocchioRobot, or give it a method "
            "distances_between(pairs, detection=...)."
        )
    return robot.distances_between(pairs, detection=detection)
