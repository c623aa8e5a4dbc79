"""Distances between geoms of a robot and its surroundings, kept above a margin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from hqp_rp.control._approach import Approach, margin_of
from hqp_rp.control._checks import positive_number
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.distance import Distances, Side, distances_of
from hqp_rp.robot.robot import Robot


class CollisionLimit:
    """Keep geoms apart: one row `J_d v >= rate` for each pair, on how fast its distance d may shrink, in m/s.

    With p_1, p_2 the nearest points, n the unit vector from p_1 to p_2 and e = d - margin::

        J_d = n^T (J_{p_2} - J_{p_1})
        rate = -phi(e)                        e >= 0
        rate =  min(phi(|e|), return_speed)   e < 0

    phi(e) = gain e where gain^2 e <= A, the deceleration, and beyond that the speed from which braking at A arrives there,
    sqrt(2 A e - A^2 / gain^2) but for the length of the step. Without deceleration it is gain e.

    - Outside the margin: where the rows are met, e shrinks by no more than the share gain * dt of itself at a step, so that
      the pair comes to rest at the margin and does not pass it, to first order. Between convex geoms that do not turn the
      row is exact or on the safe side. Turning by w dt against each other costs up to about R (w dt)^2 / 2 in a step, R the
      largest radius of curvature or lever arm at the nearest points, and L w dt between parallel edges or faces of length
      L, whose nearest points jump from end to end. Along a
      surface such losses add up until gain * e makes up for them, at about R w^2 dt / (2 gain) inside the margin. Give the
      margin for that; spheres and capsules are the kindest geoms.
    - Conservative: a pair is slowed down from phi(e) = speed on, also where it would have stopped in time by itself, and
      moves straight at the obstacle with the speed phi(e) at most. Motion along the surface is free.
    - Starting inside the margin, or overlapping: no velocity that shrinks the distance is allowed, and the distance
      must grow at the rate above: bounded by return_speed, and monotone. As a hard row that may contradict others, such
      as joint limits at rest with a bounded acceleration: list the limit as the first level where this can happen.

    Mocap bodies are where `robot.set_mocap` or `robot.follow` last put them. What moves by itself, a mocap body with a
    velocity or a joint that nothing drives (`robot.unactuated_velocity`), is given way to: its part of the distance's rate is
    taken off the row's bound.

    The number of rows is the number of pairs at every step; a pair beyond `detection` has a row of zeros without bounds.

    Args:
        pairs: pairs (a, b). Each side is the name of a geom (for Pinocchio of a geometry object) or of a body (link), which
            stands for its geoms that collide; a pattern of names such as "left_*"; or a sequence of these. Every geom of a is
            kept away from every geom of b, but for those that the model's own collisions leave out: on one rigid body, on a
            body and its parent (unless that is fixed to the world), excluded by the model. `[(arm, arm)]` keeps an arm away
            from itself. A pair ("a", "b") of two geoms is kept in any case. A name that a geom and a body bear is written
            "geom:NAME" or "body:NAME".
        margin: m, >= 0, the distance to keep.
        gain: 1/s, > 0. A step of more than 1/gain takes 1/dt instead.
        deceleration: A, m/s^2, > 0: the most that the approach may need to stop; infinite by default.
        return_speed: m/s, > 0, of the way back.
        detection: m, > margin: farther pairs are not limited. A pair must not cross from there to the margin in one step.
        name: default "collision".

    Raises:
        SettingError: a value out of its range.
        RobotError: when it meets a robot that neither MuJoCo nor Pinocchio computes or that has no geometry, a name that it
            does not have, or when no pair is left.

    Source: Faverjon and Tournassoud 1987 (the velocity damper `rate = -gain e`); the deceleration and the way back are ours.
    """

    __slots__ = ("_approach", "_bound", "_detection", "_distances", "_margin", "_name", "_pairs")

    row_unit: ClassVar[str] = "m/s"

    def __init__(
        self,
        pairs: Sequence[tuple[Side, Side]],
        *,
        margin: float = 0.01,
        gain: float = 5.0,
        deceleration: float = math.inf,
        return_speed: float = 0.1,
        detection: float = 1.0,
        name: str = "collision",
    ) -> None:
        self._name = str(name)
        self._pairs = _checked_pairs(pairs, self._name)
        self._margin = margin_of(margin, self._name)
        self._approach = Approach(gain, deceleration, return_speed, self._name)
        self._detection = positive_number(detection, f"the detection of {self._name!r}")
        if self._detection <= self._margin:
            raise SettingError(
                f"the detection of {self._name!r} is {detection!r} m; it must be more than the margin, {self._margin:g} m."
            )
        self._bound: Robot | None = None
        self._distances: Distances | None = None

    @property
    def name(self) -> str:
        """What levels, reports and errors call the limit."""
        return self._name

    def rows(self, robot: Robot, dt: float, v: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """J_d (m, nv), the least rates (m,) in m/s and infinity (m,); v is not needed."""
        measured = self._meet(robot)
        distances, jacobian = measured.evaluate(robot.q)
        least = self._approach.least_rate(distances - self._margin, dt) - measured.drift
        return jacobian, least, np.full(len(least), math.inf)

    def distances(self, robot: Robot) -> FloatArray:
        """(m,) distance of each pair at the robot's configuration, m; infinite beyond detection."""
        return self._meet(robot).distances(robot.q)

    def pairs(self, robot: Robot) -> tuple[tuple[str, str], ...]:
        """The names of the two geoms of each row."""
        return self._meet(robot).names

    def row_names(self, robot: Robot) -> list[str]:
        """The two geoms of each row."""
        return [f"{a} - {b}" for a, b in self.pairs(robot)]

    def _meet(self, robot: Robot) -> Distances:
        if self._distances is None or robot is not self._bound:
            try:
                self._distances = distances_of(robot, self._pairs, detection=self._detection)
            except RobotError as error:
                raise RobotError(f"limit {self._name!r}: {error}") from None
            self._bound = robot
        return self._distances

    def __repr__(self) -> str:
        return f"CollisionLimit({self._name!r})"


def _checked_pairs(pairs: Sequence[tuple[Side, Side]], owner: str) -> tuple[tuple[Side, Side], ...]:
    if isinstance(pairs, str) or not isinstance(pairs, Sequence) or not pairs:
        raise SettingError(f"the pairs of {owner!r} are {pairs!r}; give a list of pairs (a, b) of geom or body names.")
    for pair in pairs:
        if not (isinstance(pair, tuple | list) and len(pair) == 2 and all(_is_side(side) for side in pair)):
            raise SettingError(
                f"the pairs of {owner!r} hold {pair!r}; each must be (a, b), a and b names of geoms or bodies, or sequences "
                "of names."
            )
    return tuple((pair[0], pair[1]) for pair in pairs)


def _is_side(side: object) -> bool:
    names = [side] if isinstance(side, str) else side
    return isinstance(names, tuple | list) and bool(names) and all(isinstance(name, str) and name for name in names)
