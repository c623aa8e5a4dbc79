"""Pose of a frame: position over orientation in one task."""

from __future__ import annotations

from numpy.typing import ArrayLike

from hqp_rp.control._checks import TWIST_AXES, pose
from hqp_rp.control.frame_task import FrameTask
from hqp_rp.core.problem import FloatArray


class PoseTask(FrameTask[tuple[FloatArray, FloatArray]]):
    """The rows of `PositionTask` over those of `OrientationTask`, along any of the six axes, in one level.

    Rows are in m/s and rad/s; where they cannot all be met, `weight` says how a metre is weighed against a radian. The
    error is [R_f^T (p* - p); R_f^T log(R* R^T)], and each half keeps the convention of its own task: exact for the position,
    geometric for the orientation.

    Args:
        frame: name of the frame.
        target: (R*, p*) as `robot.pose` returns it (R* may be a quaternion (w, x, y, z); p* (3,) in m), or a homogeneous
            matrix (4, 4) from target to world, or an `SE3` of mink or Pinocchio.
        axes: any of "x", "y", "z", "rx", "ry", "rz", in the order the rows shall have. None means all six.
        expressed_in: whose axes they are: "world", `frame` itself, or any other frame of the robot.
        gain: 1/s, >= 0, one number or one for each row.
        feedforward: (6,) velocity of the target in world axes: m/s of its origin, then rad/s; None means 0.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        point: (3,) m, the point of the frame that is meant, in its own axes, such as the tip of a tool; None means its
            origin.
        name: default "<frame> pose".

    `target`, `feedforward`, `gain` and `weight` may be set at every step.

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range; a target that is no pose; an axis that
            does not exist.
    """

    __slots__ = ()

    _kind, _valid, _unit = "pose", TWIST_AXES, "m/s and rad/s"

    def _checked(self, target: tuple[ArrayLike, ArrayLike] | ArrayLike) -> tuple[FloatArray, FloatArray]:
        return pose(target, f"the target of {self._name!r}")

    def _pose(self) -> tuple[FloatArray, FloatArray]:
        return self._target
