"""Angular momentum about the centre of mass: what keeps a walking or a falling robot from spinning."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import ANGULAR_AXES, axis_numbers, axis_rows, finite_vector, per_row
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot


class AngularMomentumTask:
    """L = A(q) v, the angular momentum about the centre of mass in world axes, at a target: `A v = L*`.

    In an `AccelerationStack` or a `TorqueStack`: `A v-dot = kd (L* - A v) - Adot v`. Linear momentum is that of the centre of
    mass: `CenterOfMassTask`.

    Args:
        target: (3,) L*, kg m^2/s, in world axes.
        axes: any of "rx", "ry", "rz".
        kd: 1/s, > 0. weight: > 0, one number or one for each axis.
        name: default "angular momentum".

    `target` may be set at every step. The robot needs the methods `angular_momentum_jacobian` and `angular_momentum_bias`, as
    `PinocchioRobot` has them, and `MujocoRobot` on a free base.

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range. RobotError: a robot without these methods.

    Source: Orin, Goswami and Lee 2013.
    """

    __slots__ = ("_axes", "_kd", "_name", "_target", "_weight")

    def __init__(
        self,
        target: ArrayLike = (0.0, 0.0, 0.0),
        *,
        axes: str | Sequence[str] = ANGULAR_AXES,
        kd: float = 10.0,
        weight: ArrayLike = 1.0,
        name: str = "angular momentum",
    ) -> None:
        self._name = str(name)
        self._axes, _ = axis_rows(axes, ANGULAR_AXES, f"axes of {self._name!r}")
        gain = per_row(kd, None, f"the kd of {self._name!r}", positive=True)
        if isinstance(gain, np.ndarray):
            raise SettingError(f"the kd of {self._name!r} is {gain.tolist()}; give one number for all axes.")
        self._kd = gain
        self._weight = per_row(weight, len(self._axes), f"the weight of {self._name!r}", positive=True)
        self.target = target

    @property
    def name(self) -> str:
        """What levels, reports and errors call the task."""
        return self._name

    @property
    def kd(self) -> float:
        """1/s, of an `AccelerationStack`."""
        return self._kd

    @property
    def target(self) -> FloatArray:
        """(3,) L*, kg m^2/s, in world axes."""
        return self._target

    @target.setter
    def target(self, value: ArrayLike) -> None:
        self._target = finite_vector(value, 3, f"the target of {self._name!r}", "kg m^2/s")

    def evaluate(self, robot: Robot) -> tuple[FloatArray, FloatArray]:
        """A (m, nv) and L* (m,) along the axes, both scaled by the weight."""
        rows, weight = self._rows(), self._scale()
        return weight[:, None] * _of(robot, "angular_momentum_jacobian")()[rows], weight * self._target[rows]

    def bias_acceleration(self, robot: Robot, v: FloatArray) -> FloatArray:
        """(m,) Adot v, scaled by the weight."""
        found: FloatArray = self._scale() * _of(robot, "angular_momentum_bias")(v)[self._rows()]
        return found

    def _rows(self) -> list[int]:
        return [axis - 3 for axis in axis_numbers(self._axes)]

    def _scale(self) -> FloatArray:
        return np.broadcast_to(np.asarray(self._weight, dtype=np.float64), (len(self._axes),))

    def __repr__(self) -> str:
        return f"AngularMomentumTask({self._name!r})"


def _of(robot: Robot, method: str) -> Any:
    found = getattr(robot, method, None)
    if found is None:
        raise RobotError(
            f"a {type(robot).__name__} has no method {method}(); use a PinocchioRobot, or a MujocoRobot on a free base."
        )
    return found
