"""Position of a frame's origin."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from hqp_rp.control._checks import LINEAR_AXES, WORLD, finite_vector
from hqp_rp.control.frame_task import FrameTask
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot


class PositionTask(FrameTask):
    """Bring a frame's origin p to a target p*: `J v = R_f^T feedforward + gain * e` with `e = R_f^T (p* - p)`.

    R_f holds the axes of `expressed_in`. In axes that turn with the robot, J is the exact derivative of e,
    `J = R_f^T J_p - [e]x R_f^T J_omega,f`, so d(e)/dt = -J v holds for every choice and a component along a moving axis
    converges even where the others are left free. In world axes J is the geometric Jacobian J_p.

    Args:
        frame: name of the frame.
        target: (3,) p* in the world, m.
        axes: any of "x", "y", "z": a string such as "xz" or a sequence; one row for each.
        expressed_in: whose axes they are: "world", `frame` itself, or any other frame of the robot.
        gain: 1/s, >= 0, one number or one for each row.
        feedforward: (3,) velocity of the target in world axes, m/s; None means 0.
        weight: > 0, one number or one for each row; see `FeedbackTask`.
        name: default "<frame> position".

    `target`, `feedforward`, `gain` and `weight` may be set at every step.

    Raises:
        SettingError: a value of the wrong shape, not finite, or out of its range; an axis that does not exist.
    """

    __slots__ = ("_target",)

    def __init__(
        self,
        frame: str,
        target: ArrayLike,
        *,
        axes: str | Sequence[str] = "xyz",
        expressed_in: str = WORLD,
        gain: ArrayLike = 1.0,
        feedforward: ArrayLike | None = None,
        weight: ArrayLike = 1.0,
        name: str = "",
    ) -> None:
        super().__init__(
            frame,
            LINEAR_AXES,
            "position",
            axes=axes,
            expressed_in=expressed_in,
            gain=gain,
            feedforward=feedforward,
            weight=weight,
            name=name,
        )
        self.target = target

    @property
    def target(self) -> FloatArray:
        """(3,) p* in the world, m."""
        return self._target

    @target.setter
    def target(self, value: ArrayLike) -> None:
        self._target = finite_vector(value, 3, f"the target of {self._name!r}", "m")

    def _terms(self, robot: Robot) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        rotation, origin = robot.pose(self._frame)
        jacobian = robot.jacobian(self._frame)
        J, error, feedforward = jacobian[:3], self._target - origin, self._feedforward
        R_f = self._axes_rotation(robot, rotation)
        if R_f is not None:
            error = R_f.T @ error
            J = R_f.T @ J - self._turning(robot, jacobian, R_f, error)
            feedforward = None if feedforward is None else R_f.T @ feedforward
        if self._rows == 3 and isinstance(self._index, slice):
            return J, error, feedforward
        index = self._index
        return J[index], error[index], None if feedforward is None else feedforward[index]
