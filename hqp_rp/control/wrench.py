"""Measured force and torque: where they act, whose they are, and whether the reading can be trusted."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import WORLD, finite_vector, frame_name, positive_number
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

LARGEST_READING = 1e100
"""N and N m: what is beyond it would overflow in the computation, and counts as not finite."""

Measures: TypeAlias = Literal["on_environment", "on_robot"]


class Wrench:
    """Force and torque that the robot exerts on its environment: the paper's F_e.

    Positive along an axis when the robot pushes the environment that way; a force sensor that reads what the environment
    does to the robot has the opposite sign.

    Args:
        force: (3,) N, in world axes.
        torque: (3,) N m about `point`, in world axes; default 0.
        point: (3,) m, in the world; default the world's origin.

    Raises:
        SettingError: a value of the wrong shape or not finite.
    """

    __slots__ = ("force", "point", "torque")

    force: FloatArray
    torque: FloatArray
    point: FloatArray

    def __init__(
        self, force: ArrayLike, torque: ArrayLike = (0.0, 0.0, 0.0), point: ArrayLike = (0.0, 0.0, 0.0)
    ) -> None:
        self.force = finite_vector(force, 3, "force", "N")
        self.torque = finite_vector(torque, 3, "torque", "N m")
        self.point = finite_vector(point, 3, "point", "m")

    def about(self, point: FloatArray) -> FloatArray:
        """(6,) force in N over the torque in N m about `point` (3,), both in world axes."""
        x, y, z = (self.point - point).tolist()
        a, b, c = self.force.tolist()
        result = np.empty(6)
        result[:3] = self.force
        result[3:] = self.torque
        result[3:] += (y * c - z * b, z * a - x * c, x * b - y * a)
        return result

    def __repr__(self) -> str:
        return f"Wrench(force={self.force.tolist()}, torque={self.torque.tolist()}, point={self.point.tolist()})"


class WrenchSensor:
    """Turns the readings of a force and torque sensor into `Wrench`es, and refuses the ones that cannot be trusted.

    - **Missing**: a reading that is None, or has an entry that is not finite (or beyond 1e100). The last good one stands
      in for it, turned with the robot, for at most `missing_after`; then there is a fault. Before the first good reading
      there is one at once.
    - **Frozen**: all six numbers are the same, bit for bit, for `frozen_after`. Noise changes a living sensor's numbers;
      a simulated sensor in free space reads exactly 0, so zeros count only with `zeros_freeze`. The window must be longer
      than the sensor's own period.

    Args:
        frame: the frame whose origin the torque is about.
        measures: "on_environment" for what the robot does to its environment (the paper's F_e), "on_robot" for what the
            environment does to the robot, its opposite.
        expressed_in: the frame whose axes the readings are along; default `frame`, "world" for the world's.
        missing_after: s, >= 0. frozen_after: s, > 0, or None for no such check. zeros_freeze: see above.

    Raises:
        SettingError: a value out of its range.
    """

    __slots__ = (
        "_expressed_in",
        "_fault",
        "_frame",
        "_frozen_after",
        "_last",
        "_missing",
        "_missing_after",
        "_same",
        "_sign",
        "_zeros_freeze",
    )

    def __init__(
        self,
        frame: str,
        *,
        measures: Measures,
        expressed_in: str | None = None,
        missing_after: float = 0.01,
        frozen_after: float | None = 0.1,
        zeros_freeze: bool = False,
    ) -> None:
        if measures not in ("on_environment", "on_robot"):
            raise SettingError(f"measures is {measures!r}; it must be 'on_environment' or 'on_robot'.")
        self._frame = frame_name(frame, "frame")
        self._expressed_in = frame if expressed_in is None else frame_name(expressed_in, "expressed_in")
        self._sign = 1.0 if measures == "on_environment" else -1.0
        self._missing_after = 0.0 if missing_after == 0.0 else positive_number(missing_after, "missing_after")
        self._frozen_after = None if frozen_after is None else positive_number(frozen_after, "frozen_after")
        self._zeros_freeze = bool(zeros_freeze)
        self.reset()

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the sensor uses."""
        return (self._frame, self._expressed_in)

    @property
    def fault(self) -> str:
        """Why the last `read` gave nothing, as a sentence; empty when it gave a wrench."""
        return self._fault

    def reset(self) -> None:
        """Forget all readings and faults."""
        self._fault = ""
        self._last: FloatArray | None = None
        self._missing = 0.0
        self._same = 0.0

    def read(self, robot: Robot, reading: ArrayLike | None, dt: float) -> Wrench | None:
        """The wrench of this reading, or None when there is a fault.

        Args:
            robot: at its current configuration.
            reading: (6,) force in N over torque in N m, or None when none has come.
            dt: > 0, s, since the last call.

        Raises:
            SettingError: a reading that is not six real numbers (a NaN or an infinity is a missing reading, no error).
        """
        values = None if reading is None else _six(reading)
        slack = 1e-9 * dt
        self._fault = ""
        # A NaN fails the comparison as well.
        if values is None or not (np.abs(values) <= LARGEST_READING).all():
            self._missing += dt
            if self._last is None:
                self._fault = "There has been no force reading yet."
            elif self._missing > self._missing_after + slack:
                what = "came" if values is None else "was finite"
                self._fault = f"No force reading {what} for more than {self._missing_after:g} s."
        else:
            same = self._last is not None and np.array_equal(values, self._last)
            self._same = self._same + dt if same and (self._zeros_freeze or values.any()) else 0.0
            self._missing = 0.0
            self._last = values
        if self._frozen_after is not None and self._same >= self._frozen_after - slack and not self._fault:
            self._fault = f"The force reading has not changed by a single bit for {self._frozen_after:g} s."
        if self._fault or self._last is None:
            return None
        axes = np.eye(3) if self._expressed_in == WORLD else robot.pose(self._expressed_in)[0]
        force, torque = (self._sign * self._last).reshape(2, 3) @ axes.T
        return Wrench(force, torque, np.zeros(3) if self._frame == WORLD else robot.pose(self._frame)[1])

    def __repr__(self) -> str:
        return f"WrenchSensor({self._frame!r})"


def _six(reading: ArrayLike) -> FloatArray:
    try:
        values = np.array(reading, dtype=np.float64)
    except (TypeError, ValueError):
        raise SettingError(f"The reading is {reading!r}; it must be 6 numbers in N and N m, or None.") from None
    if values.shape != (6,):
        raise SettingError(
            f"The reading has shape {values.shape}; it must be 6 numbers in N and N m, shape (6,), or None."
        )
    return values
