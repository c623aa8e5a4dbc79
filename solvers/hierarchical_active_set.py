"""Our own exact solver: lexicographic least squares with two-sided rows at any level and hard rows, by active sets."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from hqp_rp.core.closed_form import free_copy, zeros
from hqp_rp.core.errors import SettingError
from hqp_rp.core.kernels.active_set_codes import DELICATE, INFEASIBLE, LIMIT, NOT_FINITE, SOLVED
from hqp_rp.core.problem import FloatArray, IntArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE, Solver
from hqp_rp.core.verify import fault_of

_OVERFLOW = "An intermediate result overflowed; scale the rows or the bounds."


@dataclasses.dataclass(frozen=True, kw_only=True)
class HierarchicalActiveSet(Solver):
    """The lexicographic optimum with two-sided rows at every level and hard rows, to rounding error.

    Level by level, `min ||w_k||^2` over the points that keep what earlier levels reached, with w_k the violation of
    `lower_k <= A_k x <= upper_k`; then `min ||x - zeta||`. The rows that count are factored by orthogonal transformations in
    the freedom that finished levels left. A level of equalities whose least squares would cross kept rows gets a guess of its
    active rows from a dual method on the level made strictly convex; the guess is corrected by block pivots (every row that
    the step crosses enters, every row whose multiplier has the wrong sign leaves), and where those do not end, a primal search
    takes over: the step goes as far as the first row allows, one row leaves at a time, and after a step of length zero has
    repeated Bland's rule chooses, so that it cannot cycle. Whichever way, the same conditions of optimality end the search,
    from a fresh factorization. Rows that a finished level determines leave for good; satisfied rows are kept as rows.
    A level whose rows that count can all be met is met by one factorization, without multipliers. Near a singularity, where
    multipliers close to rounding error decide, and where hard rows contradict each other by next to nothing, the answer is
    verified before it is called solved; where that fails it is `INACCURATE`.

    Args:
        rank_tolerance: the library's rank rule, in [0, 1).
        max_iterations: working sets factored (`Solution.iterations` counts them) before `Status.ITERATION_LIMIT`; None means
            200 + 10 per row.
        warm_start: start from the last answer and its active rows, when the sizes agree. The optimum does not depend on it.
        least_violation: when the hard rows contradict each other, put the point that violates them least (and, among such
            points, the lexicographic optimum) into `x`, still with `Status.INFEASIBLE`; otherwise x is None.

    Source: Escande, Mansard and Wieber 2014; Dimitrov, Sherikov and Wieber 2015. Goldfarb and Idnani 1983 for the guess.
    The level-by-level search with fresh factorizations, guess and block pivots is ours.
    """

    rank_tolerance: float = RANK_TOLERANCE
    max_iterations: int | None = None
    warm_start: bool = True
    least_violation: bool = False
    _kept: dict[tuple[int, int, int], tuple[FloatArray, IntArray]] = dataclasses.field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    name: ClassVar[str] = "hierarchical_active_set"
    summary: ClassVar[str] = "exact lexicographic optimum with two-sided rows at any level and hard rows"
    source: ClassVar[str] = "Escande, Mansard and Wieber 2014; Dimitrov, Sherikov and Wieber 2015"
    takes_inequalities: ClassVar[bool] = True
    takes_hard: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not isinstance(self.rank_tolerance, int | float) or not 0.0 <= self.rank_tolerance < 1.0:
            raise SettingError(f"rank_tolerance is {self.rank_tolerance!r}; it must be a number in [0, 1).")
        limit = self.max_iterations
        if limit is not None and (not isinstance(limit, int) or isinstance(limit, bool) or limit < 1):
            raise SettingError(f"max_iterations is {limit!r}; it must be None or an integer of at least 1.")

    def is_lexicographic(self, problem: Problem) -> bool:
        return True

    def reset(self) -> None:
        self._kept.clear()

    @functools.cached_property
    def _search(self) -> Callable[..., int]:
        """The compiled search, loaded when first needed."""
        from hqp_rp.core.kernels.active_set_direct import active_set_entry

        return active_set_entry()

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in self.__dict__.items() if name != "_search"}

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        n = problem.n
        shape = (problem.hard_rows, problem.rows, n)
        warm = self.warm_start
        kept = self._kept.pop(shape, None) if warm else None  # nobody else starts from it meanwhile
        rows = shape[0] + shape[1]
        x, side = (np.zeros(n), np.zeros(rows, np.int64)) if kept is None else kept
        limit = self._limit(rows)
        free = zeros(n) if secondary is None else free_copy(secondary, n)
        address = problem.address
        try:
            found = self._search(address, free, self.rank_tolerance, limit, self.least_violation, x, side)
        except (ValueError, np.linalg.LinAlgError):  # numba's SVD meets an overflow that arose on the way
            found = NOT_FINITE
        code, iterations = found & 7, found >> 3
        if code == SOLVED:
            if warm:
                self._kept[shape] = x, side
                x, side = x.copy(), side.copy()
            solution = Solution(problem, x, Status.SOLVED, iterations, "", secondary)
            solution.held = side
            return solution
        return self._otherwise(problem, secondary, x, side, code, iterations, kept is not None)

    def _otherwise(
        self,
        problem: Problem,
        secondary: FloatArray | None,
        x: FloatArray,
        side: IntArray,
        code: int,
        iterations: int,
        guessed: bool,
    ) -> Solution:
        """What a search that did not end in `SOLVED` says; once more from nothing where a guess may be to blame."""
        if code == DELICATE:
            fault = fault_of(problem, x, secondary, self.tolerance, rank_tolerance=self.rank_tolerance)
            solution = Solution(problem, x, Status.INACCURATE if fault else Status.SOLVED, iterations, fault, secondary)
            solution.held = side
            if self.warm_start:
                self._kept[problem.hard_rows, problem.rows, problem.n] = x.copy(), side.copy()
            return solution
        if (
            guessed
        ):  # a guess may lead into a cycle, out of what numbers hold, or to rows that all but contradict each other
            return self.solve(problem, secondary)
        if code == INFEASIBLE:
            names = ", ".join(str(i) for i in np.flatnonzero(side))
            message = f"Hard rows {names} contradict each other: no x meets them all."
            least = x if self.least_violation else None
            return Solution(problem, least, Status.INFEASIBLE, iterations, message, secondary)
        if code == LIMIT:
            limit = self._limit(len(side))
            message = f"No optimal working set in {limit} iterations; raise max_iterations."
            return Solution(problem, None, Status.ITERATION_LIMIT, iterations, message, secondary)
        return Solution(problem, None, Status.NOT_FINITE, iterations, _OVERFLOW, secondary)

    def _limit(self, rows: int) -> int:
        return 200 + 10 * rows if self.max_iterations is None else self.max_iterations
