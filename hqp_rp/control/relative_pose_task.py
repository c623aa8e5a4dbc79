"""Pose of one frame of the robot seen from another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import TWIST_AXES, axis_numbers, axis_rows, finite_vector, frame_name, frame_point, pose
from hqp_rp.control._native_rows import Layout
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.row_kinds import RELATIVE
from hqp_rp.robot.robot import Robot


class RelativePoseTask(FeedbackTask):
    """Bring frame b to a target pose (R*, p*) seen from frame a: both may move, as the two hands of a dual arm do.

    With p = R_a^T (p_b - p_a) and R = R_a^T R_b, all in the axes of a::

        e = [p* - p; log(R* R^T)]
        J = [R_a^T (J_p,b - J_p,a + [p_b - p_a]x J_omega,a); R_a^T (J_omega,b - J_omega,a)]

    The position half is exact, d(e)/dt = -J v; the orientation half is geometric, with the properties stated in
    `OrientationTask`.

    Args:
        frame: name of b.
        reference: name of a.
        target: (R*, p*) of b in a (R* may be a quaternion (w, x, y, z); p* (3,) in m), or a homogeneous matrix
            (4, 4), or an `SE3` of mink or Pinocchio.
        axes: any of "x", "y", "z", "rx", "ry", "rz", along the axes of a.
        gain: 1/s, >= 0, one number or one for each row.
        feedforward: (6,) velocity of the target as seen from a, in its axes, m/s then rad/s; None means 0.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        point: (3,) m, the point of b that is meant, in its own axes, such as the tip of a tool; None means its
            origin.
        name: default "<frame> in <reference>".

    `target`, `feedforward`, `gain` and `weight` may be set at every step.

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range; frame and reference the same.
    """

    __slots__ = ("_axes", "_feedforward", "_frame", "_point", "_reference", "_target")

    def __init__(
        self,
        frame: str,
        reference: str,
        target: tuple[ArrayLike, ArrayLike] | ArrayLike,
        *,
        axes: str | Sequence[str] = TWIST_AXES,
        gain: ArrayLike = 1.0,
        feedforward: ArrayLike | None = None,
        weight: ArrayLike = 1.0,
        point: ArrayLike | None = None,
        name: str = "",
    ) -> None:
        self._frame = frame_name(frame, "frame")
        self._reference = frame_name(reference, "reference")
        if frame == reference:
            raise SettingError(f"frame and reference are both {frame!r}, which never moves in itself; give two frames.")
        label = name or f"{frame} in {reference}"
        self._axes, _ = axis_rows(axes, TWIST_AXES, f"axes of {label!r}")
        super().__init__(len(self._axes), label, gain, weight)
        self._point = frame_point(point, label)
        self.target = target
        self.feedforward = feedforward

    @property
    def axes(self) -> tuple[str, ...]:
        """The chosen axes of the reference frame, one for each row."""
        return self._axes

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the task uses."""
        return (self._frame, self._reference)

    @property
    def target(self) -> tuple[FloatArray, FloatArray]:
        """(R* (3, 3), p* (3,) in m) of the frame in the reference; a matrix (4, 4) may be assigned as well."""
        return self._target

    @target.setter
    def target(self, value: tuple[ArrayLike, ArrayLike] | ArrayLike) -> None:
        self._target = pose(value, f"the target of {self._name!r}")
        self._packed = None

    @property
    def point(self) -> FloatArray:
        """(3,) m, the point of b that is meant, in the axes of b."""
        return self._point

    @property
    def feedforward(self) -> FloatArray | None:
        """(6,) velocity of the target in the reference, m/s then rad/s, or None; may be set at every step."""
        return self._feedforward

    @feedforward.setter
    def feedforward(self, value: ArrayLike | None) -> None:
        self._feedforward = (
            None if value is None else finite_vector(value, 6, f"the feedforward of {self._name!r}", "m/s and rad/s")
        )
        self._packed = None

    def _layout(self, robot: Robot) -> Layout:
        return Layout(RELATIVE, len(self._axes), axis_numbers(self._axes), self._frame, self._reference)

    def _numbers(self, robot: Robot, layout: Layout) -> FloatArray:
        numbers, own = self._pack(layout, 21), 2 * layout.rows
        if self._feedforward is not None:
            numbers[own : own + 6] = self._feedforward
        rotation, origin = self._target
        numbers[own + 6 : own + 15] = rotation.ravel()
        numbers[own + 15 : own + 18] = origin
        numbers[own + 18 :] = self._point
        return numbers

    def _feedforward_size(self) -> int:
        return 6

    def _number_rates(self, layout: Layout) -> FloatArray:
        rates, own = np.zeros(2 * layout.rows + 21), 2 * layout.rows
        if self._acceleration is not None:
            rates[own : own + 6] = self._acceleration
        return rates
