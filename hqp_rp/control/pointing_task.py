"""Point one axis of a frame in a direction, free to spin about it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import finite_vector, frame_name
from hqp_rp.control._native_rows import Layout
from hqp_rp.control._rotations import skew
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.row_kinds import POINTING
from hqp_rp.robot.robot import Robot


class PointingTask(FeedbackTask):
    """Turn an axis a of a frame into a direction d: two rows, `B^T J_omega v = B^T feedforward + gain * e`.

    B (3, 2) holds two axes of the frame that complete a to a right-handed orthonormal basis, so the spin about a stays
    free and no row is redundant. The error is the shortest rotation that takes a to d, `e = B^T theta (a x d) / |a x d|`
    in rad with theta = angle(a, d); where d = -a it is a half turn about the first column of B.

    J is geometric (angular velocity), and for every v, d(theta^2 / 2)/dt = -e^T J v: where both rows are met with one
    gain, d(theta)/dt = -gain theta exactly.

    Args:
        frame: name of the frame.
        direction: (3,) d in the world; any length but zero.
        axis: (3,) a in the frame's own axes, any length but zero; or "x", "y", "z". Default "z".
        gain: 1/s, >= 0, one number or one for each row.
        feedforward: (3,) angular velocity of the direction in world axes, rad/s; None means 0.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        name: default "<frame> pointing".

    `direction`, `feedforward`, `gain` and `weight` may be set at every step.

    Raises:
        SettingError: a vector that is zero, not finite or of the wrong shape; a gain or weight out of its range.
    """

    __slots__ = ("_basis", "_direction", "_feedforward", "_frame")

    def __init__(
        self,
        frame: str,
        direction: ArrayLike,
        *,
        axis: ArrayLike | str = "z",
        gain: ArrayLike = 1.0,
        feedforward: ArrayLike | None = None,
        weight: ArrayLike = 1.0,
        name: str = "",
    ) -> None:
        self._frame = frame_name(frame, "frame")
        super().__init__(2, name or f"{frame} pointing", gain, weight)
        self._basis = basis_with(axis_vector(axis, self._name))
        self.direction = direction
        self.feedforward = feedforward

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the task uses."""
        return (self._frame,)

    @property
    def direction(self) -> FloatArray:
        """(3,) unit vector d in the world."""
        return self._direction

    @direction.setter
    def direction(self, value: ArrayLike) -> None:
        self._direction = unit_vector(value, f"the direction of {self._name!r}")
        self._packed = None

    @property
    def feedforward(self) -> FloatArray | None:
        """(3,) angular velocity of the direction in world axes, rad/s, or None; may be set at every step."""
        return self._feedforward

    @feedforward.setter
    def feedforward(self, value: ArrayLike | None) -> None:
        self._feedforward = (
            None if value is None else finite_vector(value, 3, f"the feedforward of {self._name!r}", "rad/s")
        )
        self._packed = None

    def _layout(self, robot: Robot) -> Layout:
        return Layout(POINTING, 2, [], self._frame)

    def _numbers(self, robot: Robot, layout: Layout) -> FloatArray:
        numbers = self._pack(layout, 19)
        if self._feedforward is not None:
            numbers[4:7] = self._feedforward
        numbers[7:16] = self._basis.ravel()
        numbers[16:19] = self._direction
        return numbers

    def _feedforward_size(self) -> int:
        return 3

    def _number_rates(self, layout: Layout) -> FloatArray:
        rates = np.zeros(23)
        if self._acceleration is not None:
            rates[4:7] = self._acceleration
        if self._feedforward is not None:
            rates[16:19] = np.cross(self._feedforward, self._direction)
        return rates


def axis_vector(axis: ArrayLike | str, owner: str) -> FloatArray:
    """The unit vector (3,) of "x", "y", "z" or of a vector of any length but zero."""
    if isinstance(axis, str):
        if axis not in ("x", "y", "z"):
            raise SettingError(f"the axis of {owner!r} is {axis!r}; give 'x', 'y', 'z' or a vector (3,).")
        axis = [float(letter == axis) for letter in "xyz"]
    return unit_vector(axis, f"the axis of {owner!r}")


def basis_with(a: FloatArray) -> FloatArray:
    """A right-handed orthonormal basis (3, 3) whose last column is the unit vector a (3,)."""
    # The axis nearest to perpendicular to a gives a basis that is well conditioned for every a.
    first = skew(a) @ np.eye(3)[int(np.argmin(np.abs(a)))]
    first /= np.linalg.norm(first)
    return np.stack((first, skew(a) @ first, a), axis=1)


def unit_vector(value: ArrayLike, what: str) -> FloatArray:
    """`value` (3,) divided by its length, read-only; refuses zero."""
    vector = finite_vector(value, 3, what, "any unit of length")
    norm = float(np.linalg.norm(vector))
    if norm == 0.0:
        raise SettingError(f"{what} is the zero vector, which has no direction; give any other vector (3,).")
    unit = vector / norm
    unit.flags.writeable = False
    return unit
