"""Centre of mass of the whole robot."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from hqp_rp.control._checks import LINEAR_AXES, axis_rows, finite_vector
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.problem import FloatArray
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

    __slots__ = ("_axes", "_feedforward", "_index", "_target")

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
        self._axes, self._index = axis_rows(axes, LINEAR_AXES, f"axes of {label!r}")
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

    @property
    def feedforward(self) -> FloatArray | None:
        """(3,) velocity of the target in world axes, m/s, or None; may be set at every step."""
        return self._feedforward

    @feedforward.setter
    def feedforward(self, value: ArrayLike | None) -> None:
        self._feedforward = (
            None if value is None else finite_vector(value, 3, f"the feedforward of {self._name!r}", "m/s")
        )

    def _terms(self, robot: Robot) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        index, feedforward = self._index, self._feedforward
        error = self._target - robot.center_of_mass()
        return (
            robot.center_of_mass_jacobian()[index],
            error[index],
            None if feedforward is None else feedforward[index],
        )
