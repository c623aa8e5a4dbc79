"""What the joint torques themselves should be."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import per_row
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray


class TorqueTask:
    """The joint torques themselves, in a level of a `TorqueStack`: `tau = target`, one row for each driven velocity.

    As the last level with the target 0 it makes effort small; with the gravity torque as the target, effort beyond it.

    Args:
        target: (number of driven velocities,) N m or N, or one number for all.
        weight: > 0, one number, or one for each.
        name: default "joint torques".

    `target` and `weight` may be set at every step.

    Raises:
        SettingError: a value of the wrong shape or not finite.
    """

    __slots__ = ("_name", "_target", "_weight")

    def __init__(self, target: ArrayLike = 0.0, *, weight: ArrayLike = 1.0, name: str = "joint torques") -> None:
        self._name = str(name)
        self.target = target
        self.weight = weight

    @property
    def name(self) -> str:
        """What levels, reports and errors call the task."""
        return self._name

    @property
    def target(self) -> FloatArray:
        """() or (driven velocities,) N m or N."""
        return self._target

    @target.setter
    def target(self, value: ArrayLike) -> None:
        array = np.array(value, dtype=np.float64)
        if array.ndim > 1 or not np.isfinite(array).all():
            raise SettingError(
                f"the target of {self._name!r} is {value!r}; give one finite number, or one for each driven velocity."
            )
        array.flags.writeable = False
        self._target = array

    @property
    def weight(self) -> float | FloatArray:
        """One number, or one for each driven velocity."""
        return self._weight

    @weight.setter
    def weight(self, value: ArrayLike) -> None:
        self._weight = per_row(value, None, f"the weight of {self._name!r}", positive=True)

    def __repr__(self) -> str:
        return f"TorqueTask({self._name!r})"
