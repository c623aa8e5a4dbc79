"""What position, orientation and pose tasks share: one frame, chosen axes, and the frame whose axes they are."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from hqp_rp.control._checks import WORLD, axis_rows, finite_vector, frame_name
from hqp_rp.control._rotations import skew
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot


class FrameTask(FeedbackTask):
    """A feedback task on one frame, along chosen axes of the world, of the frame itself or of any other frame.

    Not used by itself: see `PositionTask`, `OrientationTask`, `PoseTask`.
    """

    __slots__ = ("_axes", "_expressed_in", "_feedforward", "_frame", "_index", "_valid")

    def __init__(
        self,
        frame: str,
        valid: tuple[str, ...],
        kind: str,
        *,
        axes: str | Sequence[str],
        expressed_in: str,
        gain: ArrayLike,
        feedforward: ArrayLike | None,
        weight: ArrayLike,
        name: str,
    ) -> None:
        self._frame = frame_name(frame, "frame")
        self._expressed_in = frame_name(expressed_in, "expressed_in")
        self._valid = valid
        label = name or f"{frame} {kind}"
        self._axes, self._index = axis_rows(axes, valid, f"axes of {label!r}")
        super().__init__(len(self._axes), label, gain, weight)
        self.feedforward = feedforward

    @property
    def frame(self) -> str:
        """The frame that the task moves."""
        return self._frame

    @property
    def axes(self) -> tuple[str, ...]:
        """The chosen axes, one for each row."""
        return self._axes

    @property
    def expressed_in(self) -> str:
        """The frame whose axes are meant; "world", the task's own frame, or any other."""
        return self._expressed_in

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the task uses."""
        return (self._frame, self._expressed_in)

    @property
    def feedforward(self) -> FloatArray | None:
        """Velocity of the target in world axes, or None for a target at rest; may be set at every step."""
        return self._feedforward

    @feedforward.setter
    def feedforward(self, value: ArrayLike | None) -> None:
        if value is None:
            self._feedforward = None
            return
        unit = "m/s and rad/s" if len(self._valid) == 6 else ("m/s" if self._valid[0] == "x" else "rad/s")
        self._feedforward = finite_vector(value, len(self._valid), f"the feedforward of {self._name!r}", unit)

    def _axes_rotation(self, robot: Robot, rotation: FloatArray) -> FloatArray | None:
        """R_f (3, 3), from the chosen axes to the world, or None for the world's own; `rotation` is the task frame's."""
        if self._expressed_in == WORLD:
            return None
        return rotation if self._expressed_in == self._frame else robot.pose(self._expressed_in)[0]

    def _turning(self, robot: Robot, jacobian: FloatArray, R_f: FloatArray, error: FloatArray) -> FloatArray:
        """(3, nv) `[e]x R_f^T J_omega`: what the turning of the axes R_f adds to d(R_f^T e)/dt, with e = `error` in R_f."""
        turning = jacobian if self._expressed_in == self._frame else robot.jacobian(self._expressed_in)
        product: FloatArray = skew(error) @ R_f.T @ turning[3:]
        return product
