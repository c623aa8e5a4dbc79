"""Our own exact solver: lexicographic least squares with two-sided rows at any level and hard rows, by active sets."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, ClassVar

import numpy as np

from hqp_rp.core import _native
from hqp_rp.core.errors import SettingError
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.row_names import contradicting
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE, Solver, checked_secondary, require_rank_tolerance
from hqp_rp.core.variant import QP, LineUp, Variant
from hqp_rp.core.verify import fault_of

_STATUSES = tuple(Status)
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
    A level whose rows that count can all be met is met by one factorization, without multipliers. What rows of very different
    length in one level miss by is taken from the orthogonal complement of their factor, accurate in each row's own length.
    A level with damping (`hqp_rp.core.level_damping`) is searched with its damping rows, then its own rows keep what they
    reached. Near a singularity, where multipliers close to rounding error decide, where long rows drown short ones in theirs,
    and where hard rows contradict each other by next to nothing, the answer is verified before it is called solved; where
    that fails it is `INACCURATE`.

    Args:
        rank_tolerance: the library's rank rule, in [0, 1).
        max_iterations: working sets factored (`Solution.iterations` counts them) before `Status.ITERATION_LIMIT`; None means
            200 + 10 per row, of problems with damping 200 + 20 per row and 10 per unknown and level.
        warm_start: start from the last answer to a problem with the same rows at each level and its active rows, as long as
            that is worth it. An answer does not depend on what came before: a search that came from afar, or near a
            singularity, where rounding decides which rows are active, is done once more from nothing.
        least_violation: when the hard rows contradict each other, put the point that violates them least (and, among such
            points, the lexicographic optimum) into `x`, still with `Status.INFEASIBLE`; otherwise x is None.

    One object may be shared between threads; copies and pickles of it start without a warm start.

    Source: Escande, Mansard and Wieber 2014; Dimitrov, Sherikov and Wieber 2015. Goldfarb and Idnani 1983 for the guess; Cox
    and Higham 1998 for rows of different length.
    The level-by-level search with fresh factorizations, guess and block pivots is ours.
    """

    rank_tolerance: float = RANK_TOLERANCE
    max_iterations: int | None = None
    warm_start: bool = True
    least_violation: bool = False

    name: ClassVar[str] = "hierarchical_active_set"
    summary: ClassVar[str] = "exact lexicographic optimum with two-sided rows at any level and hard rows"
    source: ClassVar[str] = "Escande, Mansard and Wieber 2014; Dimitrov, Sherikov and Wieber 2015"
    takes_inequalities: ClassVar[bool] = True
    takes_hard: ClassVar[bool] = True
    takes_damping: ClassVar[bool] = True
    takes_metric: ClassVar[bool] = True
    variants: ClassVar[LineUp] = LineUp(
        (Variant("active set", {}, QP, "one active set over the whole hierarchy, no QP back end"),),
        place=140,
    )

    def __post_init__(self) -> None:
        require_rank_tolerance(self.rank_tolerance)
        limit = self.max_iterations
        if limit is not None and (not isinstance(limit, int) or isinstance(limit, bool) or limit < 1):
            raise SettingError(f"max_iterations is {limit!r}; it must be None or an integer of at least 1.")

    def is_lexicographic(self, problem: Problem) -> bool:
        return True

    @functools.cached_property
    def _native(self) -> _native.ActiveSet:
        limit = -1 if self.max_iterations is None else self.max_iterations
        return _native.ActiveSet(self.rank_tolerance, limit, self.warm_start, self.least_violation)

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in self.__dict__.items() if name != "_native"}

    def reset(self) -> None:
        """Forget warm starts."""
        self._native.reset()

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """The lexicographic optimum nearest to `secondary` (n,); see `Solver.solve`."""
        if secondary is not None:
            secondary = checked_secondary(secondary, problem.n)
        if problem.metric is not None:
            return solve_in_metric(problem, secondary, self.solve)
        found: Any = self._native.solve(problem, secondary)
        if type(found) is not tuple:
            solution: Solution = found
            return solution
        return self._otherwise(problem, secondary, *found)

    def _otherwise(
        self, problem: Problem, secondary: FloatArray | None, code: int, iterations: int, x: FloatArray, side: Any
    ) -> Solution:
        """What a search that did not end in `SOLVED` says; an answer near a singularity is verified."""
        status = _STATUSES[code]
        if status is Status.INACCURATE:
            fault = fault_of(problem, x, secondary, self.tolerance, rank_tolerance=self.rank_tolerance)
            if not fault:
                status = Status.SOLVED
            solution = Solution(problem, x, status, iterations, fault, secondary)
            solution.held = side
            return solution
        if status is Status.INFEASIBLE:
            message = f"{contradicting(problem, np.flatnonzero(side))}: no x meets them all."
            least = x if self.least_violation else None
            return Solution(problem, least, status, iterations, message, secondary)
        if status is Status.ITERATION_LIMIT:
            searched = len(side) if problem.damping is None else 2 * len(side) + problem.n * problem.p
            limit = 200 + 10 * searched if self.max_iterations is None else self.max_iterations
            message = f"No optimal working set in {limit} iterations; raise max_iterations."
            return Solution(problem, None, status, iterations, message, secondary)
        return Solution(problem, None, Status.NOT_FINITE, iterations, _OVERFLOW, secondary)
