"""What a control loop sends at one step, and whether a solver's answer may be sent."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Callable, Container

from hqp_rp.core._native import is_finite
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution, Status


class Mode(enum.Enum):
    """What a control loop is doing. The value is the sentence that reports print."""

    RUNNING = "The command is the solver's answer."
    HOLDING = "Something failed: the command goes to zero."
    STOPPED = "Something failed: the command is zero until a reset."


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Command:
    """One control step.

    Attributes:
        v: (nv,) the velocity to send, rad/s or m/s; always finite, read-only.
        mode: what the loop was doing.
        told: what `reason` says, or what says it.
        problem: what was asked of the solver, or None when it was not asked; `MotionRunner.problem` is there in every mode.
        solution: what the solver answered, or None.
        scale: in [0, 1], by which the answer was shortened to meet limits; 1 where it was not.
        solve_time: s, wall clock of the solver's call alone; 0 when it was not asked.
    """

    v: FloatArray
    mode: Mode
    told: str | Callable[[], str] = dataclasses.field(default="", repr=False)
    problem: Problem | None = None
    solution: Solution | None = None
    scale: float = 1.0
    solve_time: float = 0.0

    @property
    def reason(self) -> str:
        """Why it does not run, in words; empty while it runs. Where hard rows contradict each other it is made when asked for,
        some milliseconds that a control loop need not spend."""
        return self.told if isinstance(self.told, str) else self.told()


def conflict_reason(solution: Solution, otherwise: str) -> str:
    """Why the answer of status INFEASIBLE may not be sent: the status and its conflict in words, or what `otherwise` says."""
    conflict = solution.conflict
    return otherwise if conflict is None else f"The solver failed: {solution.status.value} {conflict}"


def fault_of(solution: Solution, accepted: Container[Status], nv: int) -> str:
    """Why the answer may not be sent to a robot with nv velocities, as a sentence; empty where it may."""
    x, status = solution.x, solution.status
    if x is None or status not in accepted:
        if status is Status.REFUSED:
            return f"The solver refuses this problem: {solution.message or status.value}"
        return f"The solver failed: {status.value} {solution.message}".rstrip()
    if x.shape != (nv,):
        return f"The solver failed: its x has shape {x.shape}; the robot has nv = {nv}."
    if not is_finite(x):
        return f"The solver failed: its x is not finite, though it says: {solution.status.value}"
    return ""
