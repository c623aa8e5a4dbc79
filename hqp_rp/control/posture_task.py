"""Posture: joints towards a target configuration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import driven_indices, is_pattern, joint_indices, real_array
from hqp_rp.control._coordinates import plain_coordinates
from hqp_rp.control._native_rows import Layout
from hqp_rp.control._row_names import velocity_names
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.core.row_kinds import POSTURE
from hqp_rp.robot.angles import TURN, warn_of_degrees
from hqp_rp.robot.robot import Robot


class PostureTask(FeedbackTask):
    """Bring joints to a target configuration q*: `E v = feedforward + gain * e` with `e = E difference(q, q*)`.

    E chooses rows of the identity. For hinges and slides the error is q* - q and d(e)/dt = -J v exactly; for ball and free
    joints it is the robot library's own difference, and that holds for small errors only.

    Args:
        target: (nq,) q* of the whole robot, rad or m, also when only some joints are chosen.
        joints: names, patterns of names ("left_*") or velocity indices of the joints to bring there; None means every
            velocity, those of a floating base too; `["*"]` the joints alone.
        gain: 1/s, >= 0: one number, or one for each chosen joint (for all joints, one for each velocity).
        feedforward: velocity of the target, rad/s or m/s, one number for each row; None means 0.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        name: default "posture".

    `target`, `feedforward`, `gain` and `weight` may be set at every step.

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range.
        RobotError: when it meets a robot without such a joint, or with another size of q.

    Warns:
        UserWarning: when it meets a robot, a hinge's target of more than a turn that its limits do not reach, or of more than
            two without limits: it looks like degrees.
    """

    __slots__ = ("_bound", "_coordinates", "_feedforward", "_indices", "_joints", "_target")

    def __init__(
        self,
        target: ArrayLike,
        *,
        joints: Sequence[str | int] | None = None,
        gain: ArrayLike = 1.0,
        feedforward: ArrayLike | None = None,
        weight: ArrayLike = 1.0,
        name: str = "",
    ) -> None:
        self._bound: Robot | None = None
        self._indices: IntArray = np.empty(0, dtype=np.int64)
        self._coordinates: IntArray = self._indices
        if joints is not None and (isinstance(joints, str) or not len(joints)):
            raise SettingError(f"joints is {joints!r}; give a sequence of joint names or velocity indices, or None.")
        self._joints = None if joints is None else tuple(joints)
        # How many velocities "all joints" means is known from the robot only.
        unknown = self._joints is None or any(is_pattern(joint) for joint in self._joints)
        super().__init__(
            None if unknown or self._joints is None else len(self._joints), name or "posture", gain, weight
        )
        self.target = target
        self.feedforward = feedforward

    @property
    def joints(self) -> tuple[str | int, ...] | None:
        """The chosen joints, or None for all."""
        return self._joints

    @property
    def target(self) -> FloatArray:
        """(nq,) q*, rad or m."""
        return self._target

    @target.setter
    def target(self, value: ArrayLike) -> None:
        array = real_array(value, f"the target of {self._name!r}")
        if array.ndim != 1:
            raise SettingError(f"the target of {self._name!r} has shape {array.shape}; it must be (nq,).")
        bad = np.flatnonzero(~np.isfinite(array))
        if bad.size:
            raise SettingError(
                f"the target of {self._name!r}[{bad[0]}] is {array[bad[0]]}; every entry must be finite."
            )
        if self._bound is not None and len(array) != self._bound.nq:
            raise SettingError(
                f"the target of {self._name!r} has shape {array.shape}; the robot has nq = {self._bound.nq}."
            )
        array.flags.writeable = False
        self._target = array
        self._packed = None

    @property
    def feedforward(self) -> FloatArray | None:
        """Velocity of the target, rad/s or m/s, one number for each row, or None; may be set at every step."""
        return self._feedforward

    @feedforward.setter
    def feedforward(self, value: ArrayLike | None) -> None:
        self._packed = None
        if value is None:
            self._feedforward = None
            return
        array = real_array(value, f"the feedforward of {self._name!r}")
        if array.ndim != 1 or not np.isfinite(array).all() or len(array) != (self._rows or len(array)):
            size = self._rows or "nv"
            raise SettingError(
                f"the feedforward of {self._name!r} is {array.tolist()}; it must be {size} finite numbers in rad/s or m/s."
            )
        array.flags.writeable = False
        self._feedforward = array

    def _layout(self, robot: Robot) -> Layout:
        self._bind(robot)
        velocities, coordinates = self._indices.tolist(), self._coordinates.tolist()
        if coordinates:
            return Layout(POSTURE, len(velocities), velocities + coordinates)
        return Layout(POSTURE, len(velocities), velocities, difference=True)

    def _numbers(self, robot: Robot, layout: Layout) -> FloatArray:
        if robot is not self._bound:
            self._bind(robot)
        m = layout.rows
        numbers = self._pack(layout, 2 * m)
        if self._feedforward is not None:
            numbers[2 * m : 3 * m] = self._feedforward
        if not layout.difference:
            numbers[3 * m :] = self._target[self._coordinates]
        return numbers

    def _number_rates(self, layout: Layout) -> FloatArray:
        m = layout.rows
        rates = np.zeros(4 * m)
        if self._acceleration is not None:
            rates[2 * m : 3 * m] = self._acceleration
        return rates

    def _bind(self, robot: Robot) -> None:
        """Find the chosen joints of this robot, once the sizes are seen to fit it."""
        owner = f"task {self._name!r}"
        if len(self._target) != robot.nq:
            raise RobotError(
                f"{owner}: the target has shape {self._target.shape}, the robot has nq = {robot.nq}; give a whole "
                "configuration, such as robot.neutral."
            )
        indices = driven_indices(robot) if self._joints is None else joint_indices(robot, self._joints, owner)
        rows = len(indices)
        given = (
            ("gain", self._gain),
            ("weight", self._weight),
            ("feedforward", self._feedforward),
            ("kp", self._kp),
            ("kd", self._kd),
            ("feedforward_acceleration", self._acceleration),
        )
        for what, value in given:
            if isinstance(value, np.ndarray) and len(value) != rows:
                raise RobotError(f"{owner}: {what} has shape {value.shape}; on this robot the task has {rows} rows.")
        coordinates = plain_coordinates(robot)[indices]
        self._warn_of_degrees(robot, indices, coordinates)
        # Empty where a chosen velocity belongs to a ball or free joint, whose difference only the robot knows.
        self._coordinates = coordinates if (coordinates >= 0).all() else coordinates[:0]
        self._bound, self._rows, self._indices = robot, rows, indices
        self._packed = None

    def _warn_of_degrees(self, robot: Robot, indices: IntArray, coordinates: IntArray) -> None:
        """Targets of hinges that are more than a turn and outside their limits; of hinges without limits, more than two."""
        chosen = np.isin(indices, getattr(robot, "hinges", ())) & (coordinates >= 0)
        joints, target = indices[chosen], self._target[coordinates[chosen]]
        lower, upper = robot.lower[joints], robot.upper[joints]
        outside = (target < lower) | (target > upper) | (np.isinf(upper - lower) & (np.abs(target) > 2.0 * TURN))
        names = velocity_names(robot)
        warn_of_degrees(f"the target of {self._name!r}", [names[i] for i in joints[outside]], target[outside])
