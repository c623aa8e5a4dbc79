"""What a solver returns: an answer, an honest status, and (computed when asked for) what it did to each level."""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hqp_rp.core.diagnostics import LevelReport
    from hqp_rp.core.problem import FloatArray, Problem


class Status(enum.Enum):
    """How a solve ended. The value is the sentence that reports print."""

    SOLVED = "Solved to the solver's declared tolerance."
    INACCURATE = "An answer was found, but the solver could not confirm its declared tolerance."
    ITERATION_LIMIT = "The iteration limit was reached before the declared tolerance."
    INFEASIBLE = "The hard rows contradict each other: no x meets them all."
    NOT_FINITE = "The computation overflowed or produced NaN: there is no answer."
    REFUSED = "The solver cannot take this problem."

    @property
    def ok(self) -> bool:
        """True only for `SOLVED`."""
        return self is Status.SOLVED


class Solution:
    """One solver's answer to one problem.

    Attributes:
        x: (n,) answer, or None when there is none.
        status: how the solve ended (`Status`).
        iterations: solver iterations summed over levels; 0 for a closed form.
        message: a sentence with the details of a status that is not `SOLVED`; empty otherwise.
        problem: the problem that was solved.
        secondary: (n,) free vector that was given, or None.
    """

    __slots__ = ("_levels", "iterations", "message", "problem", "secondary", "status", "x")

    def __init__(
        self,
        problem: Problem,
        x: FloatArray | None,
        status: Status = Status.SOLVED,
        iterations: int = 0,
        message: str = "",
        secondary: FloatArray | None = None,
    ) -> None:
        self.problem = problem
        self.x = x
        self.status = status
        self.iterations = iterations
        self.message = message
        self.secondary = secondary
        self._levels: tuple[LevelReport, ...] | None = None

    @property
    def levels(self) -> tuple[LevelReport, ...]:
        """Violation, residual, rank and sigma_min of each level, computed from (problem, x) alone when first asked for.

        Raises `ValueError` when there is no x to judge.
        """
        if self._levels is None:
            from hqp_rp.core.diagnostics import diagnose

            if self.x is None:
                raise ValueError(f"There is no x to judge: {self.status.value} {self.message}".rstrip())
            self._levels = diagnose(self.problem, self.x)
        return self._levels

    def __repr__(self) -> str:
        return f"Solution({self.status.name}, x={self.x}, iterations={self.iterations})"
