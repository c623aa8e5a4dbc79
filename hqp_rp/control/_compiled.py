"""Tasks whose rows are made by compiled code, alone or together with those of a whole stack."""

from __future__ import annotations

import abc
import dataclasses
from typing import TYPE_CHECKING

from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.frames import Point
from hqp_rp.robot.robot import Robot

if TYPE_CHECKING:
    from hqp_rp.control._assembly import Assembly


@dataclasses.dataclass(frozen=True, slots=True)
class Layout:
    """What of a task's rows does not change from step to step.

    Attributes:
        kind: one of `hqp_rp.core.row_kinds`. rows: m.
        index: axes (0 ... 5) or velocity indices, one for each row.
        frame: the frame that moves. axes: the frame whose axes are meant, None for the world.
        difference: whether only the robot can subtract q from the task's `target`.
    """

    kind: int
    rows: int
    index: list[int]
    frame: str | Point | None = None
    axes: str | None = None
    difference: bool = False


class CompiledTask(abc.ABC):
    """A task that states its rows as numbers. Every setter must reset `_packed`."""

    __slots__ = ("_alone", "_packed")

    _alone: Assembly | None
    _packed: FloatArray | None

    @abc.abstractmethod
    def _layout(self, robot: Robot) -> Layout:
        """What of the rows does not change on this robot."""

    @abc.abstractmethod
    def _numbers(self, robot: Robot, layout: Layout) -> FloatArray:
        """What may be set at every step: gain and weight (m each), then what the kind needs."""

    @property
    def compiled(self) -> CompiledTask | None:
        """The task itself, or None where a subclass has an `evaluate` of its own."""
        return self if type(self).evaluate is CompiledTask.evaluate else None

    def jacobian(self, robot: Robot) -> FloatArray:
        """(m, nv) Jacobian at the robot's current configuration, before the weight."""
        return self._evaluated(robot, plain=True)[0]

    def evaluate(self, robot: Robot) -> tuple[FloatArray, FloatArray]:
        """Jacobian (m, nv) and rate (m,) at the robot's current configuration, both scaled by the weight."""
        return self._evaluated(robot, plain=False)

    def _evaluated(self, robot: Robot, *, plain: bool) -> tuple[FloatArray, FloatArray]:
        alone = self._alone
        if alone is None or alone.robot is not robot:
            from hqp_rp.control._assembly import TASK, Assembly

            alone = self._alone = Assembly(((TASK, _Itself(self)),), robot, False, repr)
        matrix, rate, _ = alone.rows(plain=plain)
        return matrix, rate


class _Itself:
    """A task as an item, whatever `evaluate` a subclass gives it."""

    def __init__(self, task: CompiledTask) -> None:
        self.compiled = task

    def __repr__(self) -> str:
        return repr(self.compiled)
