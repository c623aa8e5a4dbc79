"""Pose of a frame: position over orientation in one task."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import TWIST_AXES, WORLD, pose
from hqp_rp.control._rotations import rotation_log
from hqp_rp.control.frame_task import FrameTask
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot


class PoseTask(FrameTask):
    """The rows of `PositionTask` over those of `OrientationTask`, along any of the six axes, in one level.

    Rows are in m/s and rad/s; where they cannot all be met, `weight` says how a metre is weighed against a radian. The
    error is [R_f^T (p* - p); R_f^T log(R* R^T)], and each half keeps the convention of its own task: exact for the position,
    geometric for the orientation.

    Args:
        frame: name of the frame.
        target: (R*, p*) as `robot.pose` returns it (R* may be a quaternion (w, x, y, z); p* (3,) in m), or a homogeneous
            matrix (4, 4) from target to world.
        axes: any of "x", "y", "z", "rx", "ry", "rz", in the order the rows shall have.
        expressed_in: whose axes they are: "world", `frame` itself, or any other frame of the robot.
        gain: 1/s, >= 0, one number or one for each row.
        feedforward: (6,) velocity of the target in world axes: m/s of its origin, then rad/s; None means 0.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        name: default "<frame> pose".

    `target`, `feedforward`, `gain` and `weight` may be set at every step.

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range; a target that is no pose; an axis that
            does not exist.
    """

    __slots__ = ("_target",)

    def __init__(
        self,
        frame: str,
        target: tuple[ArrayLike, ArrayLike] | ArrayLike,
        *,
        axes: str | Sequence[str] = TWIST_AXES,
        expressed_in: str = WORLD,
        gain: ArrayLike = 1.0,
        feedforward: ArrayLike | None = None,
        weight: ArrayLike = 1.0,
        name: str = "",
    ) -> None:
        super().__init__(
            frame,
            TWIST_AXES,
            "pose",
            axes=axes,
            expressed_in=expressed_in,
            gain=gain,
            feedforward=feedforward,
            weight=weight,
            name=name,
        )
        self.target = target

    @property
    def target(self) -> tuple[FloatArray, FloatArray]:
        """(R* (3, 3), p* (3,) in m); a homogeneous matrix (4, 4) may be assigned as well."""
        return self._target

    @target.setter
    def target(self, value: tuple[ArrayLike, ArrayLike] | ArrayLike) -> None:
        self._target = pose(value, f"the target of {self._name!r}")

    def _terms(self, robot: Robot) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        R, p = robot.pose(self._frame)
        J = robot.jacobian(self._frame)
        target, origin = self._target
        error = np.empty(6)
        error[:3] = origin - p
        error[3:] = rotation_log(target.dot(R.T))
        feedforward = self._feedforward
        R_f = self._axes_rotation(robot, R)
        if R_f is not None:
            error = (error.reshape(2, 3) @ R_f).ravel()
            turning = self._turning(robot, J, R_f, error[:3])
            J = np.concatenate((R_f.T @ J[:3] - turning, R_f.T @ J[3:]))
            feedforward = None if feedforward is None else (feedforward.reshape(2, 3) @ R_f).ravel()
        if self._rows == 6 and isinstance(self._index, slice):
            return J, error, feedforward
        index = self._index
        return J[index], error[index], None if feedforward is None else feedforward[index]
