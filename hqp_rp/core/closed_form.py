"""What every closed form shares: its settings, the equality-only refusal, and the call of its compiled kernel."""

from __future__ import annotations

import abc
import dataclasses
import functools
from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hqp_rp.core import _native
from hqp_rp.core.damping import Damping, NoDamping, checked_damping
from hqp_rp.core.errors import ProblemError, SettingError
from hqp_rp.core.problem import FloatArray, IntArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE, Solver

Kernel = Callable[..., float]
"""(matrix, rhs, offsets, free vector, rank tolerance, damping kind, its two parameters, answer) -> 0 if not finite."""

_NOT_FINITE = list(Status).index(Status.NOT_FINITE)
_INACCURATE = list(Status).index(Status.INACCURATE)
_OVERFLOW = "An intermediate result overflowed; scale the rows or the right-hand sides."


@functools.lru_cache(maxsize=256)
def zeros(n: int) -> FloatArray:
    """The (n,) zero vector that stands for "no free vector"; shared, never to be written to."""
    return np.zeros(n)


def free_copy(secondary: ArrayLike, n: int) -> FloatArray:
    """A copy of the free vector that compiled code may write to. Raises `ProblemError` where it is not (n,)."""
    x = np.array(secondary, dtype=np.float64)
    if x.shape != (n,):
        raise ProblemError(f"secondary has shape {x.shape}; it must be ({n},), one number for each unknown.")
    return x


@dataclasses.dataclass(frozen=True, kw_only=True)
class ClosedForm(Solver):
    """A closed form on equality levels.

    Args:
        damping: what replaces 1/sigma near a singularity: `NoDamping`, `ConstantDamping`, `VariableDamping`, `Truncation`.
        rank_tolerance: a singular value of A_k restricted to the remaining null space counts as zero when it is
            <= rank_tolerance * ||A_k||_2; in [0, 1).
    """

    damping: Damping = NoDamping()
    rank_tolerance: float = RANK_TOLERANCE

    exact_levels: ClassVar[int] = 0
    """On up to this many levels the undamped form returns the lexicographic optimum, in exact arithmetic."""

    def __post_init__(self) -> None:
        checked_damping(self.damping)
        if not isinstance(self.rank_tolerance, int | float) or not 0.0 <= self.rank_tolerance < 1.0:
            raise SettingError(f"rank_tolerance is {self.rank_tolerance!r}; it must be a number in [0, 1).")

    def is_lexicographic(self, problem: Problem) -> bool:
        if not isinstance(self.damping, NoDamping) or not problem.is_equality:
            return False
        return int(np.count_nonzero(np.diff(problem.offsets))) <= self.exact_levels

    @abc.abstractmethod
    def kernel(self) -> Kernel:
        """The compiled kernel for these settings."""

    def direct_kernel(self) -> Kernel | None:
        """The same kernel for a described problem, where there is one: (problem's address, settings' address, x) -> code.

        x holds the free vector, then the answer; see `hqp_rp.core.kernels.direct`.
        """
        return None

    @functools.cached_property
    def _bound(self) -> tuple[Kernel, float, int, float, float]:
        """The kernel and its settings, looked up once: a control loop pays for the solve alone."""
        first, second = self.damping.parameters
        return self.kernel(), float(self.rank_tolerance), self.damping.kind, first, second

    @functools.cached_property
    def _direct(self) -> tuple[Kernel, int, FloatArray] | None:
        """The direct kernel's machine code, and the address of its settings beside the array that holds them."""
        kernel = self.direct_kernel()
        if kernel is None:
            return None
        from hqp_rp.core.kernels.direct import closed_form_entry

        settings = np.array([self.rank_tolerance, self.damping.kind, *self.damping.parameters])
        return closed_form_entry(kernel), int(settings.__array_interface__["data"][0]), settings

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in self.__dict__.items() if name not in {"_bound", "_direct", "_native_solver"}}

    def native(self) -> _native.ClosedForm | None:
        """The native solver for these settings, where the form has one."""
        return None

    @functools.cached_property
    def _native_solver(self) -> _native.ClosedForm | None:
        return self.native()

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        native = self._native_solver
        if native is not None:
            solution: Solution | None = native.solve(problem, secondary)
            if solution is not None:
                if solution.x is None:
                    solution.message = _OVERFLOW
                return solution
        if problem.hard_rows or not problem.is_equality:
            refusal = self._refusal(problem)
            if refusal is not None:
                return refusal
        direct = self._direct
        if direct is None:
            matrix, rhs, _, offsets = problem.stacked
            return self._run(problem, matrix, rhs, offsets, secondary)
        address = problem.address
        x = np.zeros(problem.n) if secondary is None else free_copy(secondary, problem.n)
        try:
            code = direct[0](address, direct[1], x)
        except (ValueError, np.linalg.LinAlgError):  # numba's SVD meets an overflow that arose on the way
            code = 0.0
        if secondary is None and code is True:
            return Solution(problem, x)
        return self._answer(problem, x, code, secondary)

    def _run(
        self, problem: Problem, matrix: FloatArray, rhs: FloatArray, offsets: IntArray, secondary: FloatArray | None
    ) -> Solution:
        kernel, tolerance, kind, first, second = self._bound
        x = np.empty(problem.n)
        free = zeros(problem.n) if secondary is None else secondary
        try:
            code = kernel(matrix, rhs, offsets, free, tolerance, kind, first, second, x)
        except (ValueError, np.linalg.LinAlgError):
            code = 0.0
        return self._answer(problem, x, code, secondary)

    def _answer(self, problem: Problem, x: FloatArray, code: float, secondary: FloatArray | None) -> Solution:
        if not code:
            return Solution(problem, None, Status.NOT_FINITE, 0, _OVERFLOW, secondary)
        solution = Solution(problem, x, secondary=secondary)
        return solution if code is True else self._judged(solution, code)

    def batch_kernel(self) -> int | None:
        """Which closed form of `kernels.batch` this is, or None when it has none (problems are then solved one by one)."""
        return None

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
        if upper is None and self._native_solver is not None:
            self._native_solver.solve_many(matrix, lower, offsets, secondary, x, codes)
            return
        which = self.batch_kernel()
        if upper is not None or which is None:
            super().solve_many(matrix, lower, upper, offsets, secondary, x, codes)
            return
        from hqp_rp.core.kernels import batch

        _, tolerance, kind, first, second = self._bound
        code = np.empty(len(matrix))
        settings = (tolerance, kind, first, second)
        if which == batch.NULL_SPACE:
            batch.batch_null_space(matrix, lower, offsets, secondary, *settings, x, code)
        else:
            batch.batch_one_by_one(which, matrix, lower, offsets, secondary, *settings, x, code)
        codes[:] = np.where(code == 0.0, _NOT_FINITE, np.where(code - 1.0 > self.tolerance, _INACCURATE, 0))
        x[code == 0.0] = np.nan

    def _judged(self, solution: Solution, code: float) -> Solution:
        """What a kernel that returns more than True says of its answer."""
        return solution
