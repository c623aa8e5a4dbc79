"""A commanded velocity of a frame, without feedback."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import (
    LINEAR_AXES,
    TWIST_AXES,
    WORLD,
    axis_numbers,
    axis_rows,
    finite_vector,
    frame_name,
    frame_point,
    per_row,
)
from hqp_rp.control._native_rows import Layout, NativeTask
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.row_kinds import TWIST
from hqp_rp.robot.robot import Robot


class TwistTask(NativeTask):
    """Move a frame at a given velocity along chosen axes: `(R_f^T J)[axes] v = velocity`.

    J is the geometric Jacobian (velocity of the frame's origin over angular velocity) and R_f holds the axes of
    `expressed_in`. There is no error to feed back: this is the task for references that another law integrates, such as
    force or impedance control, and for teleoperation.

    Args:
        frame: name of the frame.
        velocity: (k,) one number for each chosen axis, along the axes of `expressed_in`: m/s for "x", "y", "z" and rad/s
            for "rx", "ry", "rz". None means 0: hold still.
        axes: any of "x", "y", "z", "rx", "ry", "rz", in the order the rows shall have.
        expressed_in: whose axes they are: "world", `frame` itself, or any other frame of the robot.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        kd: 1/s, >= 0, one number or one for each row; of an `AccelerationStack`.
        point: (3,) m, the point of the frame that is meant, in its own axes, such as the tip of a tool; None means its
            origin.
        name: default "<frame> twist".

    In an `AccelerationStack` the frame follows the velocity: d/dt((R_f^T J)[axes] v) = acceleration + kd (velocity -
    (R_f^T J)[axes] v).

    `velocity`, `acceleration` and `kd` may be set at every step.

    Raises:
        SettingError: a velocity or weight of the wrong shape, not finite or out of its range; an axis that does not
            exist.
    """

    __slots__ = ("_acceleration", "_axes", "_expressed_in", "_frame", "_kd", "_name", "_point", "_velocity", "_weight")

    def __init__(
        self,
        frame: str,
        velocity: ArrayLike | None = None,
        *,
        axes: str | Sequence[str] = TWIST_AXES,
        expressed_in: str = WORLD,
        weight: ArrayLike = 1.0,
        kd: ArrayLike = 20.0,
        point: ArrayLike | None = None,
        name: str = "",
    ) -> None:
        self._alone = None
        self._gains_given = 0
        self._frame = frame_name(frame, "frame")
        self._expressed_in = frame_name(expressed_in, "expressed_in")
        self._name = name or f"{frame} twist"
        self._axes, _ = axis_rows(axes, TWIST_AXES, f"axes of {self._name!r}")
        self._point = frame_point(point, self._name)
        self._weight = per_row(weight, len(self._axes), f"the weight of {self._name!r}", positive=True)
        self._acceleration = np.zeros(len(self._axes))
        self.kd = kd
        self.velocity = np.zeros(len(self._axes)) if velocity is None else velocity

    @property
    def name(self) -> str:
        """What levels, reports and errors call the task."""
        return self._name

    @property
    def axes(self) -> tuple[str, ...]:
        """The chosen axes, one for each row."""
        return self._axes

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the task uses."""
        return (self._frame, self._expressed_in)

    @property
    def point(self) -> FloatArray:
        """(3,) m, the point of the frame that is meant, in the frame's own axes."""
        return self._point

    @property
    def velocity(self) -> FloatArray:
        """(k,) m/s and rad/s, one number for each chosen axis."""
        return self._velocity

    @velocity.setter
    def velocity(self, value: ArrayLike) -> None:
        self._velocity = finite_vector(value, len(self._axes), f"the velocity of {self._name!r}", "m/s and rad/s")
        self._packed = None

    @property
    def acceleration(self) -> FloatArray:
        """(k,) m/s^2 and rad/s^2, feed-forward along each chosen axis, 0 until set; of an `AccelerationStack`."""
        return self._acceleration

    @acceleration.setter
    def acceleration(self, value: ArrayLike) -> None:
        what = f"the acceleration of {self._name!r}"
        self._acceleration = finite_vector(value, len(self._axes), what, "m/s^2 and rad/s^2")
        self._packed = None

    @property
    def kd(self) -> float | FloatArray:
        """1/s, one number or (k,); of an `AccelerationStack`."""
        return self._kd

    @kd.setter
    def kd(self, value: ArrayLike) -> None:
        self._kd = per_row(value, len(self._axes), f"the kd of {self._name!r}", positive=False)
        self._gains_given += 1
        self._packed = None

    def _second_order(self, rows: int) -> tuple[FloatArray, FloatArray]:
        return np.zeros(rows), np.broadcast_to(self._kd, (rows,))

    def _number_rates(self, layout: Layout) -> FloatArray:
        m = layout.rows
        rates = np.zeros(3 * m + 3)
        rates[2 * m : 3 * m] = self._acceleration
        return rates

    def row_names(self, robot: Robot) -> list[str]:
        """The chosen axes, one for each row."""
        return list(self._axes)

    def row_units(self, robot: Robot) -> list[str]:
        """The unit of each row; "" where a weight scales them."""
        scaled = bool(np.any(np.asarray(self._weight) != 1.0))
        return ["" if scaled else "m/s" if axis in LINEAR_AXES else "rad/s" for axis in self._axes]

    def _layout(self, robot: Robot) -> Layout:
        axes = None if self._expressed_in == WORLD else self._expressed_in
        return Layout(TWIST, len(self._axes), axis_numbers(self._axes), self._frame, axes)

    def _numbers(self, robot: Robot, layout: Layout) -> FloatArray:
        m = layout.rows
        numbers = np.zeros(3 * m + 3)
        numbers[m : 2 * m] = self._weight
        numbers[2 * m : 3 * m] = self._velocity
        numbers[3 * m :] = self._point
        return numbers

    def __repr__(self) -> str:
        return f"TwistTask({self._name!r})"
