"""Reverse priority with unilateral rows: hard rows are the top level, which reverse priority executes last."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from hqp_rp.core import _native
from hqp_rp.core.closed_form import ClosedForm
from hqp_rp.core.damping import ConstantDamping, NoDamping
from hqp_rp.core.errors import SettingError
from hqp_rp.core.level_damping import solve_with_damped_targets
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.row_names import contradicting
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.stacked import load
from hqp_rp.core.tolerances import UNILATERAL_ROUNDING
from hqp_rp.core.variant import WITHIN, LineUp, Variant
from hqp_rp.core.verify import hard_excess

_STATUSES = tuple(Status)
_OVERFLOW = "An intermediate result overflowed; scale the rows or the bounds."


@dataclasses.dataclass(frozen=True, kw_only=True)
class ReversePriorityUnilateral(ClosedForm):
    """Reverse priority (29) on the levels, then one more step for the hard rows that would otherwise be violated.

    ::

        y = the reverse-priority answer of the levels alone
        x = y + T_0 (J_0 T_0)^# (c_0 - J_0 y),    J_0 x = c_0 the active hard rows at their bounds

    T_0 holds the first columns of [J_0; A_1; ...; A_p]^+: of all moves that meet the active rows, x - y is the one that
    disturbs the levels least, jointly. A row is active when it would be violated without, and only while its multiplier
    pushes it inwards, so x is the minimizer of `||A (x - y)||` (then of `||x - y||`) over the hard rows: no jump when a row
    enters or leaves, where the levels together determine x. With damping lambda, `||A d||^2 + lambda^2 ||d||^2` replaces
    `||A d||^2`, and x is continuous whatever the levels determine.

    From the source: hard rows as the top level, executed last, only the active ones. Ours: the search for the active set,
    an exact active-set method with multipliers, in which rows in conflict end in `Status.INFEASIBLE` with their numbers.

    A level with damping of its own asks for what null-space priority would reach with that damping and no hard rows.

    One level, undamped, gives the lexicographic optimum; more levels share what the hard rows leave instead of ranking it.
    Two-sided levels are refused.

    Args:
        damping: `NoDamping` or `ConstantDamping`, of the pseudo-inverse that gives each T_k, T_0 included.
        max_iterations: working sets tried before `Status.ITERATION_LIMIT`.

    Source: Flacco and De Luca 2015; the paper, (23)-(29).
    """

    max_iterations: int = 1000

    name: ClassVar[str] = "reverse_priority_unilateral"
    summary: ClassVar[str] = "reverse priority, then the active hard rows with the least disturbance of all levels"
    source: ClassVar[str] = "Flacco and De Luca 2015; paper (23)-(29)"
    takes_hard: ClassVar[bool] = True
    takes_damping: ClassVar[bool] = True
    exact_levels: ClassVar[int] = 2
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant(
                "reverse priority unilateral", {}, WITHIN, "hard rows that are active enter as the level executed last"
            ),
        ),
        place=160,
        only_with="limits",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.damping, NoDamping | ConstantDamping):
            raise SettingError(
                f"damping is {self.damping!r}; reverse_priority_unilateral takes NoDamping() or ConstantDamping(...)."
            )
        limit = self.max_iterations
        if isinstance(limit, bool) or not isinstance(limit, int) or limit < 1:
            raise SettingError(f"max_iterations is {limit!r}; it must be an integer of at least 1.")

    def is_lexicographic(self, problem: Problem) -> bool:
        """True for up to two undamped equality levels, with hard rows for one."""
        levels = int(np.count_nonzero(np.diff(problem.offsets)))
        return super().is_lexicographic(problem) and (problem.hard is None or not problem.hard.m or levels <= 1)

    def native(self) -> _native.ClosedForm | None:
        return _native.reverse_priority(self.rank_tolerance, self.damping.kind, *self.damping.parameters)

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """The answer with the least disturbance of the levels; see `Solver.solve`."""
        if problem.metric is not None and self.refuses(problem) is None:
            return solve_in_metric(problem, secondary, self.solve)
        if problem.damping is not None and self.refuses(problem) is None:
            return solve_with_damped_targets(problem, secondary, self.rank_tolerance, self.solve)
        hard = problem.hard
        if hard is None or not hard.m:
            solution = super().solve(problem, secondary)
        else:
            matrix, lower, upper, offsets = problem.stacked
            levels = Problem.from_stacked(matrix, lower, upper, offsets, names=problem.names, check=False)
            found = super().solve(levels, secondary)
            solution = Solution(problem, found.x, found.status, found.iterations, found.message, secondary)
        if solution.x is None:
            return solution
        if hard is None or hard_excess(hard, solution.x) <= UNILATERAL_ROUNDING:  # no hard row is active
            solution.held = np.zeros(len(problem.matrix) + (0 if hard is None else hard.m), np.int8)
            return solution
        return self._held(problem, hard, solution.x, secondary)

    def _held(self, problem: Problem, hard: Level, y: FloatArray, secondary: FloatArray | None) -> Solution:
        kept = (rows := self._disturbance_rows(problem)) @ y
        m, M = hard.m, len(rows)
        search = Problem.from_stacked(rows, kept, kept, np.array([0, M]), names=["disturbance"], hard=hard, check=False)
        x, side = y.copy(), np.zeros(m + M, np.int64)
        code, iterations = _native.active_set(search, y, self.rank_tolerance, self.max_iterations, False, x, side)
        status = _STATUSES[code]
        if status is Status.NOT_FINITE:
            return Solution(problem, None, status, iterations, _OVERFLOW, secondary)
        if status is Status.INFEASIBLE:
            message = f"{contradicting(problem, np.flatnonzero(side[:m]))}: no x meets them all."
            return Solution(problem, None, status, iterations, message, secondary)
        if status is Status.ITERATION_LIMIT:
            message = f"No optimal set of active rows in {self.max_iterations} iterations; raise max_iterations."
            return Solution(problem, None, status, iterations, message, secondary)
        excess = hard_excess(hard, x)
        message = "" if excess <= self.tolerance else f"A hard row is violated by a relative {excess:.1e}."
        if message:  # an x that breaks a hard row is never returned
            return Solution(problem, None, Status.INACCURATE, iterations, message, secondary)
        status = Status.SOLVED
        solution = Solution(problem, x, status, iterations, message, secondary)
        solution.held = np.zeros(m + len(problem.matrix), np.int8)
        solution.held[:m] = side[:m]
        return solution

    def _disturbance_rows(self, problem: Problem) -> FloatArray:
        """The rows of all levels (M, n), and lambda I below them when damped: what a move of the hard rows should spare.

        As they were given, but for one power of two for all and levels of less than 2^-50 of the largest, which weigh as that.
        """
        matrix, rhs, _, offsets = problem.stacked
        given = load(matrix[None], rhs[None], offsets)
        rows: FloatArray = np.concatenate([J[0] for J in given.J]) * given.weights(0)[0][:, None]
        first, _ = self.damping.parameters
        if self.damping.kind == 0:
            return rows
        return np.concatenate((rows, first * given.unit(0)[0] * np.eye(problem.n)))
