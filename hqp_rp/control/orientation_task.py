"""Orientation of a frame."""

from __future__ import annotations

from hqp_rp.control._checks import ANGULAR_AXES, rotation
from hqp_rp.control.frame_task import FrameTask
from hqp_rp.core.problem import FloatArray


class OrientationTask(FrameTask[FloatArray]):
    """Turn a frame R to a target R*: `R_f^T J_omega v = R_f^T feedforward + gain * e` with `e = R_f^T log(R* R^T)`.

    log(R* R^T) is the rotation vector, in world axes, that takes R to R*; R_f holds the axes of `expressed_in`.

    J is the geometric Jacobian (angular velocity), not the derivative of the logarithm: with a constant target and world
    axes, de/dt = -J_r(e)^-1 J v, where J_r is the right Jacobian of SO(3). Both agree for small errors. Because
    J_r(e)^-1 e = e, meeting all three rows still gives exactly de/dt = -gain e (one gain for all rows), however large the
    error; and d(|e|^2 / 2)/dt = -e^T J v holds for every v. The geometric form is chosen because its rank and its
    singularities belong to the robot alone, not to the target, and because a missed row then is an angular velocity. For a
    single direction of the frame, which has its own exact error, use `PointingTask`.

    The error jumps by 2 pi where |e| = pi: keep reference orientations less than half a turn away.

    Args:
        frame: name of the frame.
        target: R* in the world: a rotation matrix (3, 3) from target to world, or a unit quaternion (4,) in the order
            (w, x, y, z), SciPy's `Rotation`, mink's `SO3` or Pinocchio's `Quaternion`.
        axes: any of "rx", "ry", "rz"; one row for each, rotation about that axis. None means all three.
        expressed_in: whose axes they are: "world", `frame` itself, or any other frame of the robot.
        gain: 1/s, >= 0, one number or one for each row.
        feedforward: (3,) angular velocity of the target in world axes, rad/s; None means 0.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        name: default "<frame> orientation".

    `target`, `feedforward`, `gain` and `weight` may be set at every step.

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range; a target that is no rotation; an axis
            that does not exist.
    """

    __slots__ = ()

    _kind, _valid, _unit = "orientation", ANGULAR_AXES, "rad/s"

    def _checked(self, target: object) -> FloatArray:
        return rotation(target, f"the target of {self._name!r}")

    def _pose(self) -> tuple[FloatArray, None]:
        return self._target, None
