"""Centre of mass of the whole robot."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from hqp_rp.control._checks import LINEAR_AXES, axis_numbers, axis_rows, finite_vector
from hqp_rp.control._native_rows import Layout
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.row_kinds import FRAME
from hqp_rp.robot.frames import Point
from hqp_rp.robot.robot import Robot


class CenterOfMassTask(FeedbackTask):
    """Bring the centre of mass c to a target c*: `J_c v = feedforward + gain * e` with `e = c* - c`, along world axes.

    The Jacobian is exact: d(e)/dt = -J_c v.

    Args:
        target: (3,) c* in the world, m.
        axes: any of "x", "y", "z", such as "xy" for balance; one row for each.
        gain: 1/s, >= 0, one number or one for each row.
        feedforward: (3,) velocity of the target in world axes, m/s; None means 0.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        name: default "centre of mass".

    `target`, `feedforward`, `gain` and `weight` may be set at every step.

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range; an axis that does not exist.
    """

    __slots__ = ("_axes", "_feedforward", "_target")

    def __init__(
        self,
        target: ArrayLike,
        *,
        axes: str | Sequence[str] = "xyz",
        gain: ArrayLike = 1.0,
        feedforward: ArrayLike | None = None,
        weight: ArrayLike = 1.0,
        name: str = "",
    ) -> None:
        label = name or "centre of mass"
        self._axes, _ = axis_rows(axes, LINEAR_AXES, f"axes of {label!r}")
        super().__init__(len(self._axes), label, gain, weight)
        self.target = target
        self.feedforward = feedforward

    @property
    def axes(self) -> tuple[str, ...]:
        """The chosen world axes, one for each row."""
        return self._axes

    @property
    def target(self) -> FloatArray:
        """(3,) c* in the world, m."""
        return self._target

    @target.setter
    def target(self, value: ArrayLike) -> None:
        self._target = finite_vector(value, 3, f"the target of {self._name!r}", "m")
        self._packed = None

    @property
    def feedforward(self) -> FloatArray | None:
        """(3,) velocity of the target in world axes, m/s, or None; may be set at every step."""
        return self._feedforward

    @feedforward.setter
    def feedforward(self, value: ArrayLike | None) -> None:
        self._feedforward = (
            None if value is None else finite_vector(value, 3, f"the feedforward of {self._name!r}", "m/s")
        )
        self._packed = None

    def _layout(self, robot: Robot) -> Layout:
        return Layout(FRAME, len(self._axes), axis_numbers(self._axes), Point.CENTER_OF_MASS)

    def _numbers(self, robot: Robot, layout: Layout) -> FloatArray:
        numbers, own = self._pack(layout, 18), 2 * layout.rows
        if self._feedforward is not None:
            numbers[own : own + 3] = self._feedforward
        numbers[own + 15 :] = self._target
        return numbers
