"""An axis of a frame kept within a cone about a direction: keep a glass upright, keep a camera on its side."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._approach import Approach
from hqp_rp.control._checks import frame_name
from hqp_rp.control.pointing_task import axis_vector, basis_with, unit_vector
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot


class ConeLimit:
    """Keep an axis a of a frame within `angle` of a direction d: one row on how fast it leans further, in rad/s.

    With theta = angle(a, d), u = (a x d) / |a x d| and e = angle - theta::

        u^T J_omega v >= -phi(e)                        e >= 0
        u^T J_omega v >=  min(phi(|e|), return_speed)   e < 0

    phi(e) = gain e where gain^2 e <= A, the deceleration, and beyond that the speed from which braking at A arrives there.
    The row is the exact derivative, d(theta)/dt = -u^T J_omega v; turning about d or about a is free.

    - Within: the axis comes to rest on the cone, to first order: a step of an angle w dt to the side adds up to
      (w dt)^2 / (2 tan(angle)), which the gain makes up for.
    - Starting outside: theta must shrink at the rate above, bounded by return_speed. As a hard row that may contradict
      others: list the limit as the first level where this can happen.
    - Where a = d, every way out is the same and none is bounded: the row is zero. Where a = -d, the way back is about any
      axis perpendicular to a; one is taken.

    Args:
        frame: name of the frame.
        direction: (3,) d in the world; any length but zero.
        angle: rad, in (0, pi): half the opening of the cone.
        axis: (3,) a in the frame's own axes, any length but zero; or "x", "y", "z". Default "z".
        gain: 1/s, > 0. A step of more than 1/gain takes 1/dt instead.
        deceleration: A, rad/s^2, > 0, infinite by default. return_speed: rad/s, > 0.
        name: default "<frame> cone".

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range.

    Source: Faverjon and Tournassoud 1987 (the velocity damper), here on an angle.
    """

    __slots__ = ("_angle", "_approach", "_axis", "_direction", "_frame", "_name")

    row_unit: ClassVar[str] = "rad/s"

    def __init__(
        self,
        frame: str,
        direction: ArrayLike,
        angle: float,
        *,
        axis: ArrayLike | str = "z",
        gain: float = 5.0,
        deceleration: float = math.inf,
        return_speed: float = 0.5,
        name: str = "",
    ) -> None:
        self._frame = frame_name(frame, "frame")
        self._name = name or f"{frame} cone"
        self._direction = unit_vector(direction, f"the direction of {self._name!r}")
        self._axis = axis_vector(axis, self._name)
        is_number = isinstance(angle, int | float | np.number) and not isinstance(angle, bool)
        if not is_number or not 0.0 < float(angle) < math.pi:
            raise SettingError(f"the angle of {self._name!r} is {angle!r}; it must be in rad, between 0 and pi.")
        self._angle = float(angle)
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
        """u^T J_omega (1, nv), the least rate (1,) in rad/s and infinity (1,); v is not needed."""
        theta, about = self._lean(robot)
        upper = np.array([math.inf])
        if about is None:
            return np.zeros((1, robot.nv)), -upper, upper
        least = self._approach.least_rate(np.array([self._angle - theta]), dt)
        return (about @ robot.jacobian(self._frame)[3:])[None, :], least, upper

    def row_names(self, robot: Robot) -> list[str]:
        """The frame."""
        return [self._frame]

    def angle(self, robot: Robot) -> float:
        """theta, rad, between the axis and the direction at the robot's configuration."""
        return self._lean(robot)[0]

    def _lean(self, robot: Robot) -> tuple[float, FloatArray | None]:
        """theta, and the unit axis (3,) about which a turns to d; None where they are the same."""
        a = robot.pose(self._frame)[0] @ self._axis
        normal = np.cross(a, self._direction)
        sine, cosine = float(np.linalg.norm(normal)), float(a @ self._direction)
        theta = math.atan2(sine, cosine)
        if sine > 1e-12:
            return theta, normal / sine
        return theta, None if cosine > 0.0 else basis_with(a)[:, 0]

    def __repr__(self) -> str:
        return f"ConeLimit({self._name!r})"
