"""Posture: joints towards a target configuration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import joint_indices, real_array
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.robot import Robot


class PostureTask(FeedbackTask):
    """Bring joints to a target configuration q*: `E v = feedforward + gain * e` with `e = E difference(q, q*)`.

    E chooses rows of the identity. For hinges and slides the error is q* - q and d(e)/dt = -J v exactly; for ball and free
    joints it is the robot library's own difference, and that holds for small errors only.

    Args:
        target: (nq,) q* of the whole robot, rad or m, also when only some joints are chosen.
        joints: names or velocity indices of the joints to bring there; None means all.
        gain: 1/s, >= 0: one number, or one for each chosen joint (for all joints, one for each velocity).
        feedforward: velocity of the target, rad/s or m/s, one number for each row; None means 0.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        name: default "posture".

    `target`, `feedforward`, `gain` and `weight` may be set at every step.

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range.
        RobotError: when it meets a robot without such a joint, or with another size of q.
    """

    __slots__ = ("_bound", "_feedforward", "_indices", "_joints", "_matrix", "_target")

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
        self._matrix: FloatArray | None = None
        self._indices: IntArray | None = None
        if joints is not None and (isinstance(joints, str) or not len(joints)):
            raise SettingError(f"joints is {joints!r}; give a sequence of joint names or velocity indices, or None.")
        self._joints = None if joints is None else tuple(joints)
        # How many velocities "all joints" means is known from the robot only.
        super().__init__(None if self._joints is None else len(self._joints), name or "posture", gain, weight)
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

    @property
    def feedforward(self) -> FloatArray | None:
        """Velocity of the target, rad/s or m/s, one number for each row, or None; may be set at every step."""
        return self._feedforward

    @feedforward.setter
    def feedforward(self, value: ArrayLike | None) -> None:
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

    def _bind(self, robot: Robot) -> FloatArray:
        """The rows of the identity for this robot, once the sizes are seen to fit it."""
        owner = f"task {self._name!r}"
        if len(self._target) != robot.nq:
            raise RobotError(
                f"{owner}: the target has shape {self._target.shape}, the robot has nq = {robot.nq}; give a whole "
                "configuration, such as robot.neutral."
            )
        if self._joints is None:
            indices = np.arange(robot.nv)
        else:
            indices = joint_indices(robot, self._joints, owner)
        rows = len(indices)
        for what, value in (("gain", self._gain), ("weight", self._weight), ("feedforward", self._feedforward)):
            if isinstance(value, np.ndarray) and len(value) != rows:
                raise RobotError(f"{owner}: {what} has shape {value.shape}; on this robot the task has {rows} rows.")
        matrix: FloatArray = np.eye(robot.nv)[indices]
        matrix.flags.writeable = False
        self._bound, self._rows, self._matrix = robot, rows, matrix
        self._indices = None if self._joints is None else indices
        return matrix

    def _terms(self, robot: Robot) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        matrix = self._matrix if robot is self._bound and self._matrix is not None else self._bind(robot)
        # Where q has as many entries as v, all joints are hinges and slides, and the difference is the plain one.
        plain = len(self._target) == len(matrix[0])
        error = self._target - robot.q if plain else robot.difference(robot.q, self._target)
        return matrix, error if self._indices is None else error[self._indices], self._feedforward
