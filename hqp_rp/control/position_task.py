"""Position of a frame's origin."""

from __future__ import annotations

from numpy.typing import ArrayLike

from hqp_rp.control._checks import LINEAR_AXES, position
from hqp_rp.control.frame_task import FrameTask
from hqp_rp.core.problem import FloatArray


class PositionTask(FrameTask[FloatArray]):
    """Bring a frame's origin p to a target p*: `J v = R_f^T feedforward + gain * e` with `e = R_f^T (p* - p)`.

    R_f holds the axes of `expressed_in`. In axes that turn with the robot, J is the exact derivative of e,
    `J = R_f^T J_p - [e]x R_f^T J_omega,f`, so d(e)/dt = -J v holds for every choice and a component along a moving axis
    converges even where the others are left free. In world axes J is the geometric Jacobian J_p.

    Args:
        frame: name of the frame.
        target: (3,) p* in the world, m; of an `SE3` of mink or Pinocchio, its position.
        axes: any of "x", "y", "z": a string such as "xz" or a sequence; one row for each. None means all three.
        expressed_in: whose axes they are: "world", `frame` itself, or any other frame of the robot.
        gain: 1/s, >= 0, one number or one for each row.
        feedforward: (3,) velocity of the target in world axes, m/s; None means 0.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        point: (3,) m, the point of the frame that is meant, in its own axes, such as the tip of a tool; None means its
            origin.
        name: default "<frame> position".

    `target`, `feedforward`, `gain` and `weight` may be set at every step.

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range; an axis that does not exist.
    """

    __slots__ = ()

    _kind, _valid, _unit = "position", LINEAR_AXES, "m/s"

    def _checked(self, target: ArrayLike) -> FloatArray:
        return position(target, f"the target of {self._name!r}")

    def _pose(self) -> tuple[None, FloatArray]:
        return None, self._target
