"""The pose of a frame kept within bounds, in the world or in another frame."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._approach import Approach
from hqp_rp.control._checks import (
    ANGULAR_AXES,
    TWIST_AXES,
    WORLD,
    Rows,
    axis_rows,
    frame_name,
    frame_point,
    pose,
    real_array,
)
from hqp_rp.control._rotations import point_jacobian, rotation_log, skew
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.angles import warn_of_degrees
from hqp_rp.robot.robot import Robot


class PoseLimit:
    """Keep chosen coordinates of a frame's pose in [lower, upper]: two-sided rows, in m/s and rad/s.

    The coordinates are those of a point p of the frame and of its rotation R, seen from the box: the pose (R_o, p_o), fixed in
    the frame `relative_to` (R_b, p_b)::

        x = [R_o^T (R_b^T (p - p_b) - p_o);  log(R_o^T R_b^T R)]

        -phi(x - lower) <= dx/dt <= phi(upper - x)

    with phi as in `HalfSpaceLimit`: gain times the distance, or the braking speed where a deceleration is given; outside a
    bound the coordinate comes back at min(phi, return_speed). The Jacobian is exact for all six coordinates, those of the
    rotation vector included, |log| < pi. The rows never contradict one another; several at once, or other limits, may.

    Args:
        frame: name of the frame.
        lower, upper: one number for each axis, in m and rad, lower <= upper; infinite for none.
        axes: any of "x", "y", "z", "rx", "ry", "rz", such as "xyz" or ["x", "rz"]; default the first three.
        relative_to: the frame that the box moves with; "world" by default.
        origin: (R_o, p_o) of the box in that frame (R_o may be a quaternion (w, x, y, z)), or a matrix (4, 4); None means
            the frame itself.
        point: (3,) m, p in the axes of `frame`; None means its origin.
        gain: 1/s, > 0. A step of more than 1/gain takes 1/dt instead.
        deceleration: m/s^2 and rad/s^2, > 0, infinite by default. return_speed: m/s and rad/s, > 0.
        name: default "<frame> bounds".

    Raises:
        SettingError: a value of the wrong shape, not a number, or out of its range; `relative_to` the frame itself.

    Warns:
        UserWarning: a bound on a rotation of more than a turn, which looks like degrees.

    Source: Faverjon and Tournassoud 1987 (the velocity damper); the derivative of the logarithm: Sola, Deray and Atchuthan
    2018, A micro Lie theory for state estimation in robotics, (146).
    """

    __slots__ = (
        "_approach",
        "_axes",
        "_frame",
        "_lower",
        "_name",
        "_origin",
        "_point",
        "_relative_to",
        "_rows",
        "_upper",
    )

    row_unit: ClassVar[str] = "m/s or rad/s"

    def __init__(
        self,
        frame: str,
        lower: ArrayLike,
        upper: ArrayLike,
        *,
        axes: str | tuple[str, ...] | list[str] = "xyz",
        relative_to: str = WORLD,
        origin: object = None,
        point: ArrayLike | None = None,
        gain: float = 5.0,
        deceleration: float = math.inf,
        return_speed: float = 0.1,
        name: str = "",
    ) -> None:
        self._frame, self._relative_to = frame_name(frame, "frame"), frame_name(relative_to, "relative_to")
        self._name = name or f"{frame} bounds"
        if frame == relative_to:
            raise SettingError(
                f"{self._name!r}: frame and relative_to are both {frame!r}, which never moves in itself."
            )
        self._axes, rows = axis_rows(axes, TWIST_AXES, f"axes of {self._name!r}")
        self._rows: Rows = rows
        self._lower, self._upper = (self._bound(value, which) for value, which in ((lower, "lower"), (upper, "upper")))
        if not (self._lower <= self._upper).all():
            i = int(np.flatnonzero(~(self._lower <= self._upper))[0])
            raise SettingError(
                f"{self._name!r}: along {self._axes[i]!r} lower is {self._lower[i]:g} and upper {self._upper[i]:g}; lower must "
                "not be above upper."
            )
        angular = [i for i, axis in enumerate(self._axes) if axis in ANGULAR_AXES]
        named = [f"{which} {self._axes[i]}" for which in ("lower", "upper") for i in angular]
        warn_of_degrees(repr(self._name), named, np.concatenate((self._lower[angular], self._upper[angular])))
        self._origin = pose((np.eye(3), np.zeros(3)) if origin is None else origin, f"the origin of {self._name!r}")
        self._point = frame_point(point, self._name)
        self._approach = Approach(gain, deceleration, return_speed, self._name)

    @property
    def name(self) -> str:
        """What levels, reports and errors call the limit."""
        return self._name

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the limit uses."""
        return (self._frame, self._relative_to)

    def rows(self, robot: Robot, dt: float, v: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """dx/dv (m, nv), and the least and greatest rate (m,); v is not needed."""
        x, J = self._evaluated(robot)
        least = self._approach.least_rate(x - self._lower, dt)
        greatest = -self._approach.least_rate(self._upper - x, dt)
        return J, least, greatest

    def coordinates(self, robot: Robot) -> FloatArray:
        """(m,) x along the chosen axes, m and rad, at the robot's configuration."""
        return self._evaluated(robot)[0]

    def jacobian(self, robot: Robot) -> FloatArray:
        """(m, nv) dx/dv at the robot's configuration."""
        return self._evaluated(robot)[1]

    def row_names(self, robot: Robot) -> list[str]:
        """The frame and the axis."""
        return [f"{self._frame} {axis}" for axis in self._axes]

    def _evaluated(self, robot: Robot) -> tuple[FloatArray, FloatArray]:
        (R_o, p_o), R_b, p_b, J_b = self._origin, np.eye(3), np.zeros(3), np.zeros((6, robot.nv))
        if self._relative_to != WORLD:
            (R_b, p_b), J_b = robot.pose(self._relative_to), robot.jacobian(self._relative_to)
        (R, origin), J = robot.pose(self._frame), robot.jacobian(self._frame)
        lever = R @ self._point
        between = origin + lever - p_b
        seen = R_b @ R_o
        turn = rotation_log(seen.T @ R)
        linear = point_jacobian(J, lever) - J_b[:3] + skew(between) @ J_b[3:]
        jacobian = np.concatenate((seen.T @ linear, _inverse_left_jacobian(turn) @ seen.T @ (J[3:] - J_b[3:])))
        x = np.concatenate((R_o.T @ (R_b.T @ between - p_o), turn))
        return x[self._rows], jacobian[self._rows]

    def _bound(self, value: ArrayLike, which: str) -> FloatArray:
        what = f"{which} of {self._name!r}"
        bound = real_array(value, what)
        if bound.shape not in ((), (len(self._axes),)) or np.isnan(bound).any():
            raise SettingError(
                f"{what} is {bound.tolist()}; give one number, or one for each of {', '.join(self._axes)}."
            )
        return np.array(np.broadcast_to(bound, (len(self._axes),)))

    def __repr__(self) -> str:
        return f"PoseLimit({self._name!r})"


def _inverse_left_jacobian(r: FloatArray) -> FloatArray:
    """J_l(r)^-1 (3, 3): d log(R)/dt = J_l^-1 w where dR/dt = [w]x R and r = log R."""
    angle = float(np.linalg.norm(r))
    factor = 1.0 / 12.0 if angle < 1e-4 else (1.0 - 0.5 * angle / math.tan(0.5 * angle)) / angle**2
    K = skew(r)
    inverse: FloatArray = np.eye(3) - 0.5 * K + factor * (K @ K)
    return inverse
