"""Set-based tasks (Moe, Antonelli, Teel, Pettersen and Schrimpf 2016): two-sided rows that are tasks only at a bound."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from hqp_rp.core import _native
from hqp_rp.core.closed_form import zeros
from hqp_rp.core.errors import SettingError
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE, Solver
from hqp_rp.core.variant import WITHIN, LineUp, Variant

_OVERFLOW = "An intermediate result overflowed; scale the rows or the right-hand sides."


@dataclasses.dataclass(frozen=True, kw_only=True)
class SetBased(Solver):
    """Null-space priority over the modes of the set-based tasks, the fewest active ones first.

    A two-sided row, `lower <= a x <= upper`, is a set-based task: left out where x keeps it, an equality of its level, at
    the bound that it would pass, where x would not. A mode says which of them are active. Modes are tried by how many are
    active, the bound nearer to the answer without active tasks first, and the first whose answer keeps all the others is
    the answer (the tangent cone rule, on velocities: a task at a bound may move away from it and not further out). Hard
    rows are the level above all others; they too are kept or active.

    In the source an active task is frozen, a x = 0, since its bounds are those of a position; here bounds are those of x
    itself, as every limit of this library states them, and 0 is the bound of a task that is at its limit.

    What the method does not do is weigh active tasks by multipliers: the first mode that fits may hold a task that should
    leave, and a soft row that cannot be met is held all the same. It is exact on equalities, and in general not the
    lexicographic optimum; `hierarchical_active_set` is.

    Args:
        max_modes: > 0. 2^j modes of j rows are all that there are; beyond this many the search ends with
            `Status.ITERATION_LIMIT`.
        slack: >= 0, relative: a row that is passed by less is kept.
        rank_tolerance: as of `null_space`.

    Source: Moe, Antonelli, Teel, Pettersen and Schrimpf 2016.
    """

    max_modes: int = 500
    slack: float = 1e-9
    rank_tolerance: float = RANK_TOLERANCE

    name: ClassVar[str] = "set_based"
    summary: ClassVar[str] = "null-space priority, two-sided rows active at a bound, the fewest first"
    source: ClassVar[str] = "Moe, Antonelli, Teel, Pettersen and Schrimpf 2016"
    takes_inequalities: ClassVar[bool] = True
    takes_hard: ClassVar[bool] = True
    takes_metric: ClassVar[bool] = True
    variants: ClassVar[LineUp] = LineUp(
        (Variant("set-based tasks", {}, WITHIN, "two-sided rows active at a bound, the fewest first"),),
        place=170,
        only_with="limits",
    )

    def __post_init__(self) -> None:
        limit = self.max_modes
        if isinstance(limit, bool) or not isinstance(limit, int) or limit < 1:
            raise SettingError(f"max_modes is {limit!r}; it must be an integer of at least 1.")
        for name in ("slack", "rank_tolerance"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value < 1.0:
                raise SettingError(f"{name} is {value!r}; it must be a number in [0, 1).")

    def is_lexicographic(self, problem: Problem) -> bool:
        return problem.is_equality and (problem.hard is None or not problem.hard.m)

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """The answer of the first mode that keeps every row that is not active; see `Solver.solve`."""
        refusal = self._refusal(problem)
        if refusal is not None:
            return refusal
        if problem.metric is not None:
            return solve_in_metric(problem, secondary, self.solve)
        rows = problem.with_hard
        search = _Modes(rows.matrix, rows.lower, rows.upper, rows.offsets.tolist(), secondary, self)
        tried = 0
        for active in search.modes():
            if tried == self.max_modes:
                told = (
                    f"No mode of the first {self.max_modes} keeps every row that is not active; raise max_modes, or use a "
                    "solver with multipliers, such as hierarchical_active_set."
                )
                return Solution(problem, None, Status.ITERATION_LIMIT, tried, told, secondary)
            tried += 1
            x = search.answer(active)
            if x is None:
                return Solution(problem, None, Status.NOT_FINITE, tried, _OVERFLOW, secondary)
            hard_rows = int(rows.offsets[1])
            if search.keeps(x, active, hard_rows):
                solution = Solution(problem, x, Status.SOLVED, tried, secondary=secondary)
                held = np.zeros(len(rows.matrix), np.int8)
                for row, side in active.items():
                    held[row] = side
                solution.held = held
                return solution
        told = "No mode keeps every row that is not active: the bounds contradict one another, or more rows than can be active."
        return Solution(problem, None, Status.INFEASIBLE, tried, told, secondary)


class _Modes:
    """The modes of one problem and their answers."""

    def __init__(
        self,
        matrix: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        offsets: list[int],
        secondary: FloatArray | None,
        settings: SetBased,
    ) -> None:
        self.matrix, self.lower, self.upper, self.offsets = matrix, lower, upper, offsets
        self.free = zeros(matrix.shape[1]) if secondary is None else secondary
        self.slack = settings.slack
        self.cascade = _native.null_space(settings.rank_tolerance, 0, 0.0, 0.0)
        self.equality = lower == upper
        self.size = np.linalg.norm(matrix, axis=1)

    def modes(self) -> Iterator[dict[int, int]]:
        """Which rows are active, and at which bound (-1 lower, +1 upper), the fewest first; those that x passes come first."""
        first = self.answer({})
        sets = [int(i) for i in np.flatnonzero(~self.equality)]
        if first is not None:
            excess = self._excess(first)
            sets.sort(key=lambda i: -excess[i])
        sides = {i: [s for s, b in ((-1, self.lower[i]), (1, self.upper[i])) if np.isfinite(b)] for i in sets}
        if first is not None:
            with np.errstate(all="ignore"):
                nearer_upper = np.abs(self.matrix @ first - self.upper) <= np.abs(self.matrix @ first - self.lower)
            for i in sets:
                sides[i].sort(key=lambda s: (s > 0) != nearer_upper[i])
        for count in range(len(sets) + 1):
            for chosen in itertools.combinations(sets, count):
                for bounds in itertools.product(*(sides[i] for i in chosen)):
                    yield dict(zip(chosen, bounds, strict=True))

    def answer(self, active: dict[int, int]) -> FloatArray | None:
        """Null-space priority of the equalities and of what is active, hard rows first; None where it is not finite."""
        taken = self.equality.copy()
        target = self.lower.copy()
        for row, side in active.items():
            taken[row] = True
            target[row] = self.lower[row] if side < 0 else self.upper[row]
        ends = np.concatenate(([0], np.cumsum(taken)))[self.offsets].astype(np.int64)
        A, b = np.ascontiguousarray(self.matrix[taken]), np.ascontiguousarray(target[taken])
        found = self.cascade.solve(Problem.from_stacked(A, b, b, ends, check=False), self.free)
        x: FloatArray | None = None if found is None else found.x
        return x

    def keeps(self, x: FloatArray, active: dict[int, int], hard_rows: int) -> bool:
        """Whether every row that is not active is kept, and every hard row, active or equality, is met."""
        excess = self._excess(x)
        must = ~self.equality
        must[:hard_rows] = True
        for row in active:
            if row >= hard_rows:
                must[row] = False
        return bool((excess[must] <= 0.0).all())

    def _excess(self, x: FloatArray) -> FloatArray:
        """(M,) by how much rows are passed, beyond the slack."""
        with np.errstate(all="ignore"):
            value = self.matrix @ x
            over, under = value - self.upper, self.lower - value
            nearer = np.where(over > under, self.upper, self.lower)  # another bound, far away, says nothing of this one
            nearer = np.where(np.isfinite(nearer), np.abs(nearer), 0.0)
            excess: FloatArray = np.maximum(over, under) - self.slack * (self.size * np.linalg.norm(x) + nearer)
        return excess
