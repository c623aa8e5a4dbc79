"""What a solver returns: an answer, an honest status, and (computed when asked for) what it did to each level."""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING, Any

from hqp_rp.core import _native

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from hqp_rp.core.conflict import Conflict
    from hqp_rp.core.diagnostics import LevelReport
    from hqp_rp.core.held_back import HeldBack
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


class Solution(_native.Solution):
    """One solver's answer to one problem.

    Attributes:
        x: (n,) answer, or None when there is none.
        status: how the solve ended (`Status`).
        iterations: solver iterations summed over levels; 0 for a closed form.
        message: a sentence with the details of a status that is not `SOLVED`; empty otherwise.
        problem: the problem that was solved.
        secondary: (n,) free vector that was given, or None.
        held: what a solver says for `active`: (hard.m + M,) integers, -1 or +1 for each satisfied row that it holds at its
            lower or upper bound; or, where its method tells no more, a number: rows this near to a bound, relative to
            ||a_i|| ||x|| + |bound|, are held; or None.
    """

    __slots__ = ()

    def __init__(
        self,
        problem: Problem,
        x: FloatArray | None,
        status: Status = Status.SOLVED,
        iterations: int = 0,
        message: str = "",
        secondary: FloatArray | None = None,
    ) -> None:
        super().__init__(problem, x, status, iterations, message, secondary)

    def require(self, *, inaccurate: bool = False) -> FloatArray:
        """x (n,), or `NoSolutionError` with the status in words, and the `conflict`, where the solve did not end in `SOLVED`.

        inaccurate: whether an answer of status INACCURATE is taken too.
        """
        x: FloatArray | None = self.x
        if x is None or not (self.status.ok or (inaccurate and self.status is Status.INACCURATE)):
            from hqp_rp.core.errors import NoSolutionError

            raise NoSolutionError(self._why())
        return x

    def _why(self) -> str:
        """The status in words, and the conflict where there is one, else the message: both would name rows twice."""
        told = self.message if self.conflict is None else str(self.conflict)
        return f"{self.status.value} {told}".rstrip()

    @property
    def held_back(self) -> tuple[HeldBack, ...]:
        """For each level that x misses: what holds it back, by the multipliers; see `hqp_rp.core.held_back`.

        Computed from (problem, x) alone when first asked for. Raises `ValueError` when there is no x to judge.
        """
        kept = self._once()
        if "held_back" not in kept:
            from hqp_rp.core.held_back import held_back

            if self.x is None:
                raise ValueError(f"There is no x to judge: {self._why()}")
            kept["held_back"] = held_back(self.problem, self.x)
        found: tuple[HeldBack, ...] = kept["held_back"]
        return found

    @property
    def conflict(self) -> Conflict | None:
        """For `INFEASIBLE`: which hard rows contradict each other, by how much, and what would help; None otherwise.

        Computed from the problem alone when first asked for; None too where the contradiction is too small to prove.
        """
        kept = self._once()
        if "conflict" not in kept and self.status is Status.INFEASIBLE:
            from hqp_rp.core.conflict import conflict_of

            kept["conflict"] = conflict_of(self.problem, self.x)
        found: Conflict | None = kept.get("conflict")
        return found

    def _once(self) -> dict[str, Any]:
        kept: dict[str, Any] | None = self.kept
        if kept is None:
            kept = self.kept = {}
        return kept

    @property
    def active(self) -> NDArray[np.int8] | None:
        """Which rows determine x: (hard.m + M,) int8, hard rows first, then the rows of the levels as they are stacked.

        ::

            +1   an equality (at both its bounds), always
            +1   above its upper bound, -1 below its lower one: a row of a level that x violates
            +1   at its upper bound, -1 at its lower one: a satisfied row that holds x back, as the solver says
             0   every other row: within its bounds, or touching one that x would keep without it

        A row is violated when it misses its bound by more than 1e-9 of ||a_i|| ||x|| + |bound|. What "holds x back" means is
        the solver's: a multiplier beyond its tolerance (`qp_cascade`, `weighted`), a place in the final working set
        (`hierarchical_active_set`, `reverse_priority_unilateral`), a row at its bound to the declared tolerance (`daqp`, which
        reports no multipliers of finished levels) or to rounding error (`saturation_null_space`). They differ only where a
        multiplier is zero or not unique. Beside damped levels every row at its bound counts as well: one that held a damped
        level back need have no multiplier in what the levels after it solve. Computed when first asked for. None where there
        is no x, or where the solver does not say.
        """
        kept = self._once()
        if "active" not in kept and self.x is not None and self.held is not None:
            from hqp_rp.core.active import active_rows

            kept["active"] = active_rows(self.problem, self.x, self.held)
        found: NDArray[np.int8] | None = kept.get("active")
        return found

    @property
    def active_rows(self) -> tuple[str, ...] | None:
        """The inequality rows among `active` in words, None where `active` is.

        Such as "velocity[3] at its upper bound", or of a `Stack` "joint limits: joint4 at its upper bound"; "at its only value"
        where the two bounds coincide, as of a joint that a limit leaves no choice.
        """
        from hqp_rp.core.active import in_words

        return None if self.active is None else in_words(self.problem, self.active)

    @property
    def levels(self) -> tuple[LevelReport, ...]:
        """Violation, residual, rank and sigma_min of each level, computed from (problem, x) alone when first asked for.

        Raises `ValueError` when there is no x to judge.
        """
        kept = self._once()
        if "levels" not in kept:
            from hqp_rp.core.diagnostics import diagnose

            if self.x is None:
                raise ValueError(f"There is no x to judge: {self.status.value} {self.message}".rstrip())
            kept["levels"] = diagnose(self.problem, self.x)
        found: tuple[LevelReport, ...] = kept["levels"]
        return found

    def plot(self) -> Figure:
        """A matplotlib figure: residual and sigma_min of each level on logarithmic axes, and x.

        Raises `MissingExtraError` without matplotlib, `ValueError` where there is no x to judge.
        """
        from hqp_rp.core.plot import solution_figure

        return solution_figure(self)

    def __reduce__(self) -> tuple[object, ...]:
        # What a subclass keeps in slots or attributes of its own is its state; what was computed is computed again.
        arguments = self.problem, self.x, self.status, self.iterations, self.message, self.secondary
        return _rebuild, (type(self), arguments, self.held), self.__getstate__()

    def __repr__(self) -> str:
        return f"Solution({self.status.name}, x={self.x}, iterations={self.iterations})"

    def _repr_html_(self) -> str:
        from hqp_rp.core.html import solution_html

        return solution_html(self)


def _rebuild(kind: type[Solution], arguments: tuple[Any, ...], held: NDArray[np.integer] | float | None) -> Solution:
    made = kind.__new__(kind)
    Solution.__init__(made, *arguments)
    made.held = held
    return made


_native.register_solution(Solution, tuple(Status))
