"""The task protocol, and the proportional feedback that the library's own tasks share."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import finite_vector, per_row
from hqp_rp.control._native_rows import Layout, NativeTask
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot


@runtime_checkable
class Task(Protocol):
    """What a robot should do at its current configuration: rows `J v = rate` on its velocity v (nv,).

    Anything with a `name` and an `evaluate` is a task. A task that also has `frames`, the names of the frames it uses,
    has them checked when a stack first meets a robot. An `AccelerationStack` also takes its `kd` and `bias_acceleration`.
    """

    @property
    def name(self) -> str:
        """What levels, reports and errors call the task."""
        ...

    def evaluate(self, robot: Robot) -> tuple[FloatArray, FloatArray]:
        """Jacobian (m, nv) and rate (m,) at the robot's current configuration. m may change between calls."""
        ...


class FeedbackTask(NativeTask):
    """A task with an error to drive to zero: `J v = feedforward + gain * error`, rows scaled by `weight`.

    The error is what is missing (target minus actual). With a constant target, d(error)/dt = -J v unless the task's own
    docstring says otherwise, so where the rows are met, error(t) = exp(-gain t) error(0).

    Args:
        rows: m, the number of rows; None when only a robot can tell.
        name: what levels, reports and errors call the task.
        gain: 1/s, >= 0: one number, or one for each row. In discrete time keep gain * dt <= 1.
        weight: > 0, one number or one for each row: how rows of the same level are weighed against each other when they
            cannot all be met, and how metres are weighed against radians. Priorities between levels ignore it.

    In an `AccelerationStack` the same task reads

        J v-dot = a_ff + kd (feedforward - J v) + kp error - (Jdot v - d/dt feedforward)

    with `feedforward_acceleration` a_ff, and kp = gain^2, kd = 2 gain unless they are set: where the rows are met, the error is
    (1 + gain t) exp(-gain t) error(0) from rest, critically damped.

    Raises:
        SettingError: a gain or weight of the wrong shape or sign.
    """

    __slots__ = ("_acceleration", "_gain", "_kd", "_kp", "_name", "_rows", "_weight")

    def __init__(self, rows: int | None, name: str, gain: ArrayLike, weight: ArrayLike) -> None:
        self._alone = None
        self._gains_given = 0
        self._rows = rows
        self._name = str(name)
        self._kp: float | FloatArray | None = None
        self._kd: float | FloatArray | None = None
        self._acceleration: FloatArray | None = None
        self.gain = gain
        self.weight = weight

    @property
    def name(self) -> str:
        """What levels, reports and errors call the task."""
        return self._name

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the task uses."""
        return ()

    @property
    def gain(self) -> float | FloatArray:
        """1/s, one number or (m,); may be set at any time."""
        return self._gain

    @gain.setter
    def gain(self, value: ArrayLike) -> None:
        self._gain = per_row(value, self._rows, f"the gain of {self._name!r}", positive=False)
        self._gains_given += 1
        self._packed = None

    @property
    def weight(self) -> float | FloatArray:
        """One number or (m,); may be set at any time."""
        return self._weight

    @weight.setter
    def weight(self, value: ArrayLike) -> None:
        self._weight = per_row(value, self._rows, f"the weight of {self._name!r}", positive=True)
        self._packed = None

    @property
    def kp(self) -> float | FloatArray | None:
        """1/s^2, one number or (m,), of an `AccelerationStack`; None means gain^2. May be set at any time."""
        return self._kp

    @kp.setter
    def kp(self, value: ArrayLike | None) -> None:
        self._kp = None if value is None else per_row(value, self._rows, f"the kp of {self._name!r}", positive=False)
        self._gains_given += 1
        self._packed = None

    @property
    def kd(self) -> float | FloatArray | None:
        """1/s, one number or (m,), of an `AccelerationStack`; None means 2 gain. May be set at any time."""
        return self._kd

    @kd.setter
    def kd(self, value: ArrayLike | None) -> None:
        self._kd = None if value is None else per_row(value, self._rows, f"the kd of {self._name!r}", positive=False)
        self._gains_given += 1
        self._packed = None

    @property
    def feedforward_acceleration(self) -> FloatArray | None:
        """Acceleration of the target, as `feedforward` is its velocity, or None for 0; of an `AccelerationStack`."""
        return self._acceleration

    @feedforward_acceleration.setter
    def feedforward_acceleration(self, value: ArrayLike | None) -> None:
        what = f"the feedforward_acceleration of {self._name!r}"
        size = self._feedforward_size() or np.size(value if value is not None else 0)
        self._acceleration = None if value is None else finite_vector(value, size, what, "m/s^2 or rad/s^2")
        self._packed = None

    def _feedforward_size(self) -> int | None:
        """How many numbers a feed-forward has; None when only a robot can tell."""
        return self._rows

    def _feedback(self) -> tuple[float | FloatArray, float | FloatArray]:
        """kp in 1/s^2 and kd in 1/s, one number or (m,) each."""
        kp = self._gain * self._gain if self._kp is None else self._kp
        return kp, 2.0 * self._gain if self._kd is None else self._kd

    def _second_order(self, rows: int) -> tuple[FloatArray, FloatArray]:
        kp, kd = self._feedback()
        return np.broadcast_to(kp, (rows,)), np.broadcast_to(kd, (rows,))

    def _ahead(self, rows: int) -> FloatArray:
        """(m,) the feed-forward acceleration along the rows, of a task that is not native."""
        return np.zeros(rows) if self._acceleration is None else self._acceleration

    def error(self, robot: Robot) -> FloatArray:
        """(m,) target minus actual at the robot's current configuration, before the weight."""
        return self._evaluated(robot, plain=True)[1]

    def _pack(self, layout: Layout, more: int) -> FloatArray:
        """Gain and weight, m numbers each, then 0 for `more` numbers."""
        m = layout.rows
        numbers = np.zeros(2 * m + more)
        numbers[:m] = self._gain
        numbers[m : 2 * m] = self._weight
        return numbers

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._name!r})"
