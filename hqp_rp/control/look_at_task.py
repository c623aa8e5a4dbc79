"""Look at a place: one axis of a frame, such as a camera's, pointed at a point of the world."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import finite_vector, frame_name, frame_point
from hqp_rp.control._native_rows import Layout
from hqp_rp.control.pointing_task import axis_vector, basis_with
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.row_kinds import POINTING
from hqp_rp.robot.robot import Robot


class LookAtTask(FeedbackTask):
    """Turn an axis a of a frame towards a place p*, seen from a point p of the frame: two rows.

    With r = |p* - p|, d = (p* - p) / r and B (3, 2) as in `PointingTask`::

        B^T (J_omega + [d]x J_p / r) v = B^T (d x feedforward) / r + gain * e,     e = B^T theta (a x d) / |a x d|

    The second part of the Jacobian is how the place moves through the view as the point does. Where both rows are met with
    one gain, d(theta)/dt = -gain theta exactly, theta the angle between a and d in rad, whether the frame turns or moves. The
    spin about a stays free. Where p = p* nothing is seen, and the error is zero.

    Args:
        frame: name of the frame.
        target: (3,) p* in the world, m.
        axis: (3,) a in the frame's own axes, any length but zero; or "x", "y", "z". Default "z", a camera's in robotics.
        point: (3,) p, m, in the frame's own axes; None means its origin.
        gain: 1/s, >= 0, one number or one for each row.
        feedforward: (3,) velocity of the place in world axes, m/s; None means 0.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        name: default "<frame> look at".

    `target`, `feedforward`, `gain` and `weight` may be set at every step.

    Raises:
        SettingError: a vector of the wrong shape or not finite, an axis without direction; a gain or weight out of its range.
    """

    __slots__ = ("_basis", "_feedforward", "_frame", "_point", "_target")

    def __init__(
        self,
        frame: str,
        target: ArrayLike,
        *,
        axis: ArrayLike | str = "z",
        point: ArrayLike | None = None,
        gain: ArrayLike = 1.0,
        feedforward: ArrayLike | None = None,
        weight: ArrayLike = 1.0,
        name: str = "",
    ) -> None:
        self._frame = frame_name(frame, "frame")
        super().__init__(2, name or f"{frame} look at", gain, weight)
        self._basis = basis_with(axis_vector(axis, self._name))
        self._point = frame_point(point, self._name)
        self.target = target
        self.feedforward = feedforward

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the task uses."""
        return (self._frame,)

    @property
    def target(self) -> FloatArray:
        """(3,) p* in the world, m."""
        return self._target

    @target.setter
    def target(self, value: ArrayLike) -> None:
        self._target = finite_vector(value, 3, f"the target of {self._name!r}", "m")
        self._packed = None

    @property
    def feedforward(self) -> FloatArray | None:
        """(3,) velocity of the place in world axes, m/s, or None; may be set at every step."""
        return self._feedforward

    @feedforward.setter
    def feedforward(self, value: ArrayLike | None) -> None:
        what = f"the feedforward of {self._name!r}"
        self._feedforward = None if value is None else finite_vector(value, 3, what, "m/s")
        self._packed = None

    def _layout(self, robot: Robot) -> Layout:
        return Layout(POINTING, 2, [], self._frame)

    def _numbers(self, robot: Robot, layout: Layout) -> FloatArray:
        numbers = self._pack(layout, 19)
        if self._feedforward is not None:
            numbers[4:7] = self._feedforward
        numbers[7:16] = self._basis.ravel()
        numbers[16:19] = self._target
        numbers[19] = 1.0
        numbers[20:] = self._point
        return numbers

    def _feedforward_size(self) -> int:
        return 3

    def _number_rates(self, layout: Layout) -> FloatArray:
        rates = np.zeros(23)
        if self._acceleration is not None:
            rates[4:7] = self._acceleration
        if self._feedforward is not None:
            rates[16:19] = self._feedforward
        return rates
