"""What position, orientation and pose tasks share: one frame, chosen axes, and the frame whose axes they are."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import (
    LINEAR_AXES,
    TWIST_AXES,
    WORLD,
    axis_numbers,
    axis_rows,
    finite_vector,
    frame_name,
    frame_point,
)
from hqp_rp.control._native_rows import Layout
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.row_kinds import FRAME
from hqp_rp.robot.robot import Robot

Target = TypeVar("Target")


class FrameTask(FeedbackTask, Generic[Target]):
    """A feedback task on one frame, along chosen axes of the world, of the frame itself or of any other frame.

    Not used by itself: see `PositionTask`, `OrientationTask`, `PoseTask`.
    """

    __slots__ = ("_axes", "_expressed_in", "_feedforward", "_frame", "_point", "_target")

    _kind: ClassVar[str]
    _valid: ClassVar[tuple[str, ...]]
    _unit: ClassVar[str]

    def __init__(
        self,
        frame: str,
        target: Any,
        *,
        axes: str | Sequence[str] | None = None,
        expressed_in: str = WORLD,
        gain: ArrayLike = 1.0,
        feedforward: ArrayLike | None = None,
        weight: ArrayLike = 1.0,
        point: ArrayLike | None = None,
        name: str = "",
    ) -> None:
        self._frame = frame_name(frame, "frame")
        self._expressed_in = frame_name(expressed_in, "expressed_in")
        label = name or f"{frame} {self._kind}"
        self._axes, _ = axis_rows(self._valid if axes is None else axes, self._valid, f"axes of {label!r}")
        super().__init__(len(self._axes), label, gain, weight)
        if point is not None and not any(axis in LINEAR_AXES for axis in self._axes):
            raise SettingError(f"{label!r} turns its frame alone, where a point changes nothing; leave `point` out.")
        self._point = frame_point(point, label)
        self.feedforward = feedforward
        self.target = target

    @abc.abstractmethod
    def _checked(self, target: Any) -> Target:
        """The target as it is kept, read-only; raises `SettingError` for one that is none."""

    @abc.abstractmethod
    def _pose(self) -> tuple[FloatArray | None, FloatArray | None]:
        """R* and p*, None for the half that the task does not have."""

    @property
    def target(self) -> Target:
        """What the frame is brought to, as the constructor takes it; may be set at every step."""
        return self._target

    @target.setter
    def target(self, value: Any) -> None:
        self._target: Target = self._checked(value)
        rotation, origin = self._pose()
        place = 2 * len(self._axes) + 6  # as in `_numbers`
        if rotation is not None:
            self._patch(place, rotation.ravel())
        if origin is not None:
            self._patch(place + 9, origin)

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
    def point(self) -> FloatArray:
        """(3,) m, the point of the frame that is meant, in the frame's own axes: where a tool is."""
        return self._point

    @property
    def feedforward(self) -> FloatArray | None:
        """Velocity of the target in world axes, or None for a target at rest; may be set at every step."""
        return self._feedforward

    @feedforward.setter
    def feedforward(self, value: ArrayLike | None) -> None:
        what = f"the feedforward of {self._name!r}"
        self._feedforward = None if value is None else finite_vector(value, len(self._valid), what, self._unit)
        self._packed = None

    def row_names(self, robot: Robot) -> list[str]:
        """The chosen axes, one for each row."""
        return list(self._axes)

    def row_units(self, robot: Robot) -> list[str]:
        """The unit of each row; "" where a weight scales them."""
        scaled = bool(np.any(np.asarray(self._weight) != 1.0))
        return ["" if scaled else "m/s" if axis in LINEAR_AXES else "rad/s" for axis in self._axes]

    def _layout(self, robot: Robot) -> Layout:
        axes = None if self._expressed_in == WORLD else self._expressed_in
        return Layout(FRAME, len(self._axes), axis_numbers(self._axes), self._frame, axes)

    def _numbers(self, robot: Robot, layout: Layout) -> FloatArray:
        numbers, own = self._pack(layout, 21), 2 * layout.rows
        if self._feedforward is not None:
            first = own + TWIST_AXES.index(self._valid[0])
            numbers[first : first + len(self._valid)] = self._feedforward
        rotation, origin = self._pose()
        if rotation is not None:
            numbers[own + 6 : own + 15] = rotation.ravel()
        if origin is not None:
            numbers[own + 15 : own + 18] = origin
        numbers[own + 18 :] = self._point
        return numbers

    def _feedforward_size(self) -> int:
        return len(self._valid)

    def _number_rates(self, layout: Layout) -> FloatArray:
        rates, own = np.zeros(2 * layout.rows + 21), 2 * layout.rows
        first = own + TWIST_AXES.index(self._valid[0])
        if self._acceleration is not None:
            rates[first : first + len(self._valid)] = self._acceleration
        if self._feedforward is not None and self._valid[0] == "x":
            rates[own + 15 : own + 18] = self._feedforward[:3]
        return rates
