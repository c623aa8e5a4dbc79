"""What every closed form shares: its settings, the equality-only refusal, and how it is called: natively or in numpy."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core import _native
from hqp_rp.core.damping import Damping, NoDamping, checked_damping
from hqp_rp.core.level_damping import solve_damped
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, IntArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE, Solver, checked_secondary, require_rank_tolerance

_NOT_FINITE = list(Status).index(Status.NOT_FINITE)
_INACCURATE = list(Status).index(Status.INACCURATE)
_OVERFLOW = "An intermediate result overflowed; scale the rows or the right-hand sides."
_CHUNK = 4096  # problems that a form in numpy takes at once


@functools.lru_cache(maxsize=256)
def zeros(n: int) -> FloatArray:
    """The (n,) zero vector that stands for "no free vector"; shared, never to be written to."""
    return np.zeros(n)


def as_one(offsets: IntArray) -> IntArray:
    """Offsets of the same rows as one level."""
    return offsets[[0, -1]]


def as_one_level(
    solve: Callable[[Problem, FloatArray | None], Solution], problem: Problem, secondary: FloatArray | None
) -> Solution:
    """What `solve` makes of the rows of all levels as one level, as an answer to `problem`."""
    matrix, rhs, _, offsets = problem.stacked
    found = solve(Problem.from_stacked(matrix, rhs, rhs, as_one(offsets), names=["all"], check=False), secondary)
    return Solution(problem, found.x, found.status, found.iterations, found.message, secondary)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ClosedForm(Solver):
    """A closed form on equality levels.

    A form is either native (`native`) or written in numpy for many problems at once (`stacked`).

    Args:
        damping: what replaces 1/sigma near a singularity: `NoDamping`, `ConstantDamping`, `VariableDamping`, `Truncation`.
        rank_tolerance: a singular value of A_k restricted to the remaining null space counts as zero when it is
            <= rank_tolerance * ||A_k||_2; in [0, 1).
    """

    damping: Damping = NoDamping()
    rank_tolerance: float = RANK_TOLERANCE

    takes_metric: ClassVar[bool] = True
    exact_levels: ClassVar[int] = 0
    """On up to this many levels the undamped form returns the lexicographic optimum, in exact arithmetic."""

    def __post_init__(self) -> None:
        checked_damping(self.damping)
        require_rank_tolerance(self.rank_tolerance)

    def is_lexicographic(self, problem: Problem) -> bool:
        if not isinstance(self.damping, NoDamping) or not problem.is_equality:
            return False
        return int(np.count_nonzero(np.diff(problem.offsets))) <= self.exact_levels

    def native(self) -> _native.ClosedForm | None:
        """The native solver for these settings, where the form has one."""
        return None

    def stacked(
        self, matrix: FloatArray, rhs: FloatArray, offsets: IntArray, secondary: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """The form in numpy on N problems: (N, M, n), (N, M), (p + 1,), (N, n) -> x (N, n) and a measure (N,).

        The measure is 0 where all is well, what `_judged` understands otherwise, and nan where x is not finite.
        """
        raise NotImplementedError(f"{type(self).__name__} has neither a native nor a numpy form.")

    @functools.cached_property
    def _native_solver(self) -> _native.ClosedForm | None:
        """Made once: a control loop pays for the solve alone."""
        return self.native()

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in self.__dict__.items() if name != "_native_solver"}

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        if secondary is not None:
            secondary = checked_secondary(secondary, problem.n)
        native = self._native_solver
        solution = None if native is None else native.solve(problem, secondary)
        if solution is None:
            refusal = self._refusal(problem)
            if refusal is not None:
                return refusal
            if problem.metric is not None:
                return solve_in_metric(problem, secondary, self.solve)
            if problem.damping is not None:
                return solve_damped(problem, secondary, self.solve)
            return self._in_numpy(problem, secondary)
        if solution.x is None:
            solution.message = _OVERFLOW
        found: Solution = solution
        return found

    def _in_numpy(self, problem: Problem, secondary: FloatArray | None) -> Solution:
        matrix, rhs, _, offsets = problem.stacked
        free = zeros(problem.n) if secondary is None else secondary
        x, measure = self._stacked(matrix[None], rhs[None], offsets, free[None])
        if not np.isfinite(x).all():
            return Solution(problem, None, Status.NOT_FINITE, 0, _OVERFLOW, secondary)
        return self._judged(Solution(problem, x[0], secondary=secondary), float(measure[0]))

    def _stacked(
        self, matrix: FloatArray, rhs: FloatArray, offsets: IntArray, secondary: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        with np.errstate(all="ignore"):
            try:
                return self.stacked(matrix, rhs, offsets, secondary)
            except np.linalg.LinAlgError:  # an overflow on the way: which problem's, one by one
                if len(matrix) == 1:
                    return np.full((1, matrix.shape[2]), np.nan), np.full(1, np.nan)
        parts = [
            self._stacked(matrix[i : i + 1], rhs[i : i + 1], offsets, secondary[i : i + 1]) for i in range(len(matrix))
        ]
        return np.concatenate([x for x, _ in parts]), np.concatenate([measure for _, measure in parts])

    def solve_many(
        self,
        matrix: FloatArray,
        lower: FloatArray,
        upper: FloatArray | None,
        offsets: IntArray,
        secondary: FloatArray,
        x: FloatArray,
        codes: NDArray[np.uint8],
    ) -> None:
        if upper is not None:
            super().solve_many(matrix, lower, upper, offsets, secondary, x, codes)
            return
        if self._native_solver is not None:
            self._native_solver.solve_many(matrix, lower, offsets, secondary, x, codes)
            return
        free = np.broadcast_to(secondary, x.shape)
        for start in range(0, len(matrix), _CHUNK):
            part = slice(start, start + _CHUNK)
            x[part], measure = self._stacked(matrix[part], lower[part], offsets, free[part])
            codes[part] = np.where(measure > self.tolerance, _INACCURATE, 0)
            bad = ~np.isfinite(x[part]).all(axis=1)
            codes[part][bad] = _NOT_FINITE
            x[part][bad] = np.nan

    def _judged(self, solution: Solution, measure: float) -> Solution:
        """What a form in numpy says of its answer beyond x."""
        return solution
