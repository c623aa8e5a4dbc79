"""A frame kept on one side of a plane."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._approach import Approach, margin_of
from hqp_rp.control._checks import finite_vector, frame_name, frame_point, real_array
from hqp_rp.control._rotations import point_jacobian
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot


class HalfSpaceLimit:
    """Keep a point p of a frame in the half-space `n . p <= c`: one row `-n^T J_p v >= rate`, in m/s.

    n is taken as a unit vector (c is scaled with it), so that d = c - n . p - margin is a distance::

        rate = -phi(d)                        d >= 0
        rate =  min(phi(|d|), return_speed)   d < 0

    phi(d) = gain d where gain^2 d <= A, the deceleration, and beyond that the speed from which braking at A arrives there,
    sqrt(2 A d - A^2 / gain^2) but for the length of the step. Without deceleration it is gain d.

    - Within: where the row is met, d shrinks by no more than the share gain * dt of itself at a step: the point comes to
      rest on the plane. To first order: a step passes it by up to |a| dt^2 / 2, a the point's acceleration at constant v;
      along the plane that adds up until gain * d makes up for it, at |a| dt / (2 gain). The margin is for that.
    - Conservative: the point is slowed down from phi(d) = speed on. Motion along the plane is free.
    - Starting outside: no velocity further out is allowed, and the way back is at the rate above: bounded by return_speed,
      and monotone. As a hard row that may contradict others, such as joint limits with a bounded acceleration: list the
      limit as the first level where this can happen.

    Args:
        frame: name of the frame.
        normal: (3,) n in world axes, pointing out of the allowed half-space; any length but 0.
        offset: c, m, for n of the length given.
        point: (3,) m, p in the frame's axes; None means its origin.
        margin: m, >= 0, by which the plane is drawn in.
        gain: 1/s, > 0. A step of more than 1/gain takes 1/dt instead.
        deceleration: A, m/s^2, > 0, infinite by default. return_speed: m/s, > 0.
        name: default "<frame> half-space".

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range.

    Source: Faverjon and Tournassoud 1987 (the velocity damper `rate = -gain d`); the deceleration and the way back are ours.
    """

    __slots__ = ("_approach", "_frame", "_margin", "_name", "_normal", "_offset", "_point")

    row_unit: ClassVar[str] = "m/s"

    def __init__(
        self,
        frame: str,
        normal: ArrayLike,
        offset: float,
        *,
        point: ArrayLike | None = None,
        margin: float = 0.0,
        gain: float = 5.0,
        deceleration: float = math.inf,
        return_speed: float = 0.1,
        name: str = "",
    ) -> None:
        self._frame = frame_name(frame, "frame")
        self._name = name or f"{frame} half-space"
        direction = finite_vector(normal, 3, f"the normal of {self._name!r}", "any unit")
        length = float(np.linalg.norm(direction))
        if length == 0.0:
            raise SettingError(f"the normal of {self._name!r} is {direction.tolist()}; it must have a direction.")
        where = real_array(offset, f"the offset of {self._name!r}")
        if where.ndim or not np.isfinite(where):
            raise SettingError(f"the offset of {self._name!r} is {offset!r}; it must be a finite number, in m.")
        self._normal, self._offset = direction / length, float(where) / length
        self._point = frame_point(point, self._name)
        self._margin = margin_of(margin, self._name)
        self._approach = Approach(gain, deceleration, return_speed, self._name)

    @property
    def name(self) -> str:
        """What levels, reports and errors call the limit."""
        return self._name

    @property
    def frames(self) -> tuple[str, ...]:
        """The frame that the limit uses."""
        return (self._frame,)

    def rows(self, robot: Robot, dt: float, v: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """-n^T J_p (1, nv), the least rate (1,) in m/s and infinity (1,); v is not needed."""
        J = robot.jacobian(self._frame)
        linear = point_jacobian(J, self._lever(robot)) if self._point.any() else J[:3]
        least = self._approach.least_rate(np.array([self.distance(robot) - self._margin]), dt)
        return -(self._normal @ linear)[None, :], least, np.array([math.inf])

    def row_names(self, robot: Robot) -> list[str]:
        """The frame."""
        return [self._frame]

    def distance(self, robot: Robot) -> float:
        """c - n . p in m, negative outside; the margin is not taken off."""
        position = robot.pose(self._frame)[1] + self._lever(robot)
        return self._offset - float(self._normal @ position)

    def _lever(self, robot: Robot) -> FloatArray:
        lever: FloatArray = robot.pose(self._frame)[0] @ self._point
        return lever

    def __repr__(self) -> str:
        return f"HalfSpaceLimit({self._name!r})"
