"""Tasks and limits whose rows are made by native code, alone or together with those of a whole stack."""

from __future__ import annotations

import abc
import dataclasses
from typing import TYPE_CHECKING, ClassVar

from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.frames import Point
from hqp_rp.robot.robot import Robot

if TYPE_CHECKING:
    from hqp_rp.control._stack_rows import StackRows


@dataclasses.dataclass(frozen=True, slots=True)
class Layout:
    """What of the rows does not change from step to step.

    Attributes:
        kind: one of `hqp_rp.core.row_kinds`. rows: m.
        index: for each row an axis (0 ... 5), a velocity index, or, of a box, a place in q (-1: none); of a posture then for
            each row a place in q, unless `difference`.
        frame: the frame that moves. axes: the frame whose axes are meant, None for the world.
        difference: whether only the robot can subtract q from the task's `target`.
        accelerated: whether the velocity before the step is needed. jerked: whether the acceleration before it is, too.
    """

    kind: int
    rows: int
    index: list[int]
    frame: str | Point | None = None
    axes: str | None = None
    difference: bool = False
    accelerated: bool = False
    jerked: bool = False


class NativeRows(abc.ABC):
    """Rows stated as numbers. Every setter must reset `_packed`, or `_patch` the numbers that it alone decides.

    `_made` is the last result of `_numbers`: where it is the same object as before, nothing but patches happened.
    """

    __slots__ = ("_alone", "_made", "_packed", "_packed_on")

    _alone: StackRows | None
    _made: FloatArray | None
    _packed: FloatArray | None
    _packed_on: Robot

    @property
    @abc.abstractmethod
    def name(self) -> str:
        """What levels, reports and errors call it."""

    @property
    @abc.abstractmethod
    def native(self) -> NativeRows | None:
        """Itself, or None where a subclass makes its rows in a way of its own."""

    @abc.abstractmethod
    def _layout(self, robot: Robot) -> Layout:
        """What of the rows does not change on this robot."""

    @abc.abstractmethod
    def _numbers(self, robot: Robot, layout: Layout) -> FloatArray:
        """What may be set at every step, in the order that the kind's kernel says."""

    def _current(self, robot: Robot, layout: Layout) -> FloatArray:
        """`_numbers`, made anew only when something was set or another robot asks."""
        if self._packed is None or self._packed_on is not robot:
            self._packed, self._packed_on = self._numbers(robot, layout), robot
            self._made = self._packed
        return self._packed

    def _patch(self, first: int, values: FloatArray) -> None:
        """Set the numbers from `first` on, which nothing else depends on: a target that moves at every step."""
        if self._packed is not None:
            numbers = self._packed.copy()
            numbers[first : first + len(values)] = values
            self._packed = numbers

    def _require_velocity(self) -> None:
        raise SettingError(
            f"limit {self.name!r} bounds accelerations, so it needs the velocity before this step: "
            "stack.problem(robot, dt, v); zeros for a robot at rest."
        )

    def _require_acceleration(self) -> None:
        raise SettingError(
            f"limit {self.name!r} bounds jerks, so it needs velocity and acceleration before this step: "
            "stack.problem(robot, dt, v, a); zeros for a robot at rest."
        )

    def _by_itself(self, robot: Robot, kind: int) -> StackRows:
        alone = self._alone
        if alone is None or alone.robot is not robot:
            from hqp_rp.control._stack_rows import LIMIT, StackRows

            alone = self._alone = StackRows(((kind, _Itself(self)),), robot, kind == LIMIT, repr)
        return alone


class NativeTask(NativeRows):
    """A task; its numbers begin with gain and weight, one for each row. `_gains_given` counts how often gains were set."""

    __slots__ = ("_gains_given",)

    _gains_given: int

    @abc.abstractmethod
    def _second_order(self, rows: int) -> tuple[FloatArray, FloatArray]:
        """kp (m,) in 1/s^2 and kd (m,) in 1/s, of an `AccelerationStack`."""

    @abc.abstractmethod
    def _number_rates(self, layout: Layout) -> FloatArray:
        """How the numbers of `_numbers` change in time: velocities of places, accelerations of targets."""

    @property
    def native(self) -> NativeRows | None:
        """The task itself, or None where a subclass has an `evaluate` of its own."""
        return self if type(self).evaluate is NativeTask.evaluate else None

    def jacobian(self, robot: Robot) -> FloatArray:
        """(m, nv) Jacobian at the robot's current configuration, before the weight."""
        return self._evaluated(robot, plain=True)[0]

    def evaluate(self, robot: Robot) -> tuple[FloatArray, FloatArray]:
        """Jacobian (m, nv) and rate (m,) at the robot's current configuration, both scaled by the weight."""
        return self._evaluated(robot, plain=False)

    def _evaluated(self, robot: Robot, *, plain: bool) -> tuple[FloatArray, FloatArray]:
        from hqp_rp.control._stack_rows import TASK

        matrix, rate, _ = self._by_itself(robot, TASK).rows(plain=plain)
        return matrix, rate


class NativeLimit(NativeRows):
    """A limit on every velocity: a box."""

    __slots__ = ()

    row_unit: ClassVar[str] = "rad/s or m/s"

    @property
    def native(self) -> NativeRows | None:
        """The limit itself, or None where a subclass has `rows` of its own."""
        return self if type(self).rows is NativeLimit.rows else None

    def rows(
        self, robot: Robot, dt: float, v: FloatArray | None, a: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The identity (nv, nv), lower (nv,) and upper (nv,), rad/s or m/s; v and a are of the step before."""
        from hqp_rp.control._stack_rows import LIMIT

        return self._by_itself(robot, LIMIT).rows(dt, v, a)


class _Itself:
    """An item whose rows the native core makes, whatever its class makes of `evaluate` or `rows`."""

    def __init__(self, rows: NativeRows) -> None:
        self.native = rows

    def __repr__(self) -> str:
        return repr(self.native)
