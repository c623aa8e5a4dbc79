"""Centre of mass of the whole robot, or of parts of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import LINEAR_AXES, axis_numbers, axis_rows, finite_vector, frame_name
from hqp_rp.control._native_rows import Layout, NativeRows
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.errors import RobotError, SettingError
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
        bodies: names of frames: only what moves with these bodies and what they carry counts, such as "left_arm" or
            ["torso", "head"]. None means the whole robot. Robots of MuJoCo and Pinocchio have it (`part_center_of_mass`).
        gain: 1/s, >= 0, one number or one for each row.
        feedforward: (3,) velocity of the target in world axes, m/s; None means 0.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        name: default "centre of mass".

    `target`, `feedforward`, `gain` and `weight` may be set at every step.

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range; an axis that does not exist.
        RobotError: at a robot that cannot tell its parts, or parts that are fixed to the world or without mass.
    """

    __slots__ = ("_axes", "_bodies", "_feedforward", "_target")

    def __init__(
        self,
        target: ArrayLike,
        *,
        axes: str | Sequence[str] = "xyz",
        bodies: str | Sequence[str] | None = None,
        gain: ArrayLike = 1.0,
        feedforward: ArrayLike | None = None,
        weight: ArrayLike = 1.0,
        name: str = "",
    ) -> None:
        chosen = (bodies,) if isinstance(bodies, str) else bodies
        self._bodies = None if chosen is None else tuple(frame_name(body, "each of bodies") for body in chosen)
        if self._bodies == ():
            raise SettingError("bodies names none; give names of frames, or None for the whole robot.")
        label = name or " ".join(["centre of mass", *(["of", ", ".join(self._bodies)] if self._bodies else [])])
        self._axes, _ = axis_rows(axes, LINEAR_AXES, f"axes of {label!r}")
        super().__init__(len(self._axes), label, gain, weight)
        self.target = target
        self.feedforward = feedforward

    @property
    def axes(self) -> tuple[str, ...]:
        """The chosen world axes, one for each row."""
        return self._axes

    @property
    def bodies(self) -> tuple[str, ...] | None:
        """What counts; None is the whole robot."""
        return self._bodies

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the task uses."""
        return self._bodies or ()

    @property
    def native(self) -> NativeRows | None:
        """The task itself for the whole robot; parts are asked of the robot."""
        own = type(self).evaluate is CenterOfMassTask.evaluate
        return self if own and self._bodies is None else None

    def evaluate(self, robot: Robot) -> tuple[FloatArray, FloatArray]:
        """Jacobian (m, nv) and rate (m,) at the robot's current configuration, both scaled by the weight."""
        return super().evaluate(robot) if self._bodies is None else self._of_parts(robot, plain=False)

    def _evaluated(self, robot: Robot, *, plain: bool) -> tuple[FloatArray, FloatArray]:
        return super()._evaluated(robot, plain=plain) if self._bodies is None else self._of_parts(robot, plain=plain)

    def bias_acceleration(self, robot: Robot, v: FloatArray) -> FloatArray | None:
        """(m,) Jdot v of parts at the velocity v (nv,), scaled by the weight; None where the robot does not tell it."""
        ask = getattr(robot, "part_center_of_mass_bias_acceleration", None)
        # A subclass with rows of its own has another Jdot v.
        if ask is None or self._bodies is None or type(self).evaluate is not CenterOfMassTask.evaluate:
            return None
        weighted: FloatArray = self._weight * ask(self._bodies, v)[axis_numbers(self._axes)]
        return weighted

    def _of_parts(self, robot: Robot, *, plain: bool) -> tuple[FloatArray, FloatArray]:
        """Jacobian and rate, or without weights and the error."""
        center, J = center_of_mass(robot, self._bodies, self._name)
        rows = axis_numbers(self._axes)
        error = (self._target - center)[rows]
        if plain:
            return J[rows], error
        forward = 0.0 if self._feedforward is None else self._feedforward[rows]
        weight = np.broadcast_to(self._weight, (len(rows),))
        return weight[:, None] * J[rows], weight * (forward + self._gain * error)

    @property
    def target(self) -> FloatArray:
        """(3,) c* in the world, m."""
        return self._target

    @target.setter
    def target(self, value: ArrayLike) -> None:
        self._target = finite_vector(value, 3, f"the target of {self._name!r}", "m")
        self._patch(2 * len(self._axes) + 15, self._target)  # as in `_numbers`

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
        numbers, own = self._pack(layout, 21), 2 * layout.rows
        if self._feedforward is not None:
            numbers[own : own + 3] = self._feedforward
        numbers[own + 15 : own + 18] = self._target
        return numbers

    def _feedforward_size(self) -> int:
        return 3

    def _number_rates(self, layout: Layout) -> FloatArray:
        rates, own = np.zeros(2 * layout.rows + 21), 2 * layout.rows
        if self._acceleration is not None:
            rates[own : own + 3] = self._acceleration
        if self._feedforward is not None:
            rates[own + 15 : own + 18] = self._feedforward
        return rates

    def _ahead(self, rows: int) -> FloatArray:
        return np.zeros(rows) if self._acceleration is None else self._acceleration[axis_numbers(self._axes)]


def center_of_mass(robot: Robot, bodies: Sequence[str] | None, owner: str) -> tuple[FloatArray, FloatArray]:
    """Centre of mass (3,) of the whole robot or of what these bodies carry, and its Jacobian (3, nv).

    Raises `RobotError` for a robot that cannot tell its parts.
    """
    if bodies is None:
        return robot.center_of_mass(), robot.center_of_mass_jacobian()
    part = getattr(robot, "part_center_of_mass", None)
    if part is None:
        raise RobotError(
            f"{owner!r}: a {type(robot).__name__} does not tell the centre of mass of a part; load the robot as MujocoRobot "
            "or PinocchioRobot, or leave `bodies` out."
        )
    center, jacobian = part(bodies)
    return center, jacobian
