"""What methods share that take one level after the other, each in the freedom that the levels before it leave."""

from __future__ import annotations

import abc
import dataclasses
from typing import ClassVar

import numpy as np

from hqp_rp.core.diagnostics import two_norm
from hqp_rp.core.errors import SettingError
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE, Solver

OVERFLOW = "An intermediate result overflowed; scale the rows or the right-hand sides."


@dataclasses.dataclass(frozen=True, kw_only=True)
class LevelByLevel(Solver):
    """`x <- x + step(A_k, b_k - A_k x, Z)`, level by level; Z (n, d) is an orthonormal basis of the freedom left.

    What freedom a level leaves is decided by the rank rule alone, whatever its step does: levels never leak upwards.

    Args:
        rank_tolerance: a singular value of A_k Z counts as zero when it is <= rank_tolerance * ||A_k||_2; in [0, 1).
    """

    rank_tolerance: float = RANK_TOLERANCE

    takes_metric: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not isinstance(self.rank_tolerance, int | float) or not 0.0 <= self.rank_tolerance < 1.0:
            raise SettingError(f"rank_tolerance is {self.rank_tolerance!r}; it must be a number in [0, 1).")

    @abc.abstractmethod
    def step(self, A: FloatArray, e: FloatArray, Z: FloatArray, svd: Svd, size: float) -> FloatArray:
        """What a level adds to x, (n,), in the span of Z.

        Args:
            A: (m, n) the level's rows. e: (m,) what they miss. Z: (n, d).
            svd: of A Z, singular values that the rank rule counts as zero left out.
            size: ||A||_2.
        """

    def is_lexicographic(self, problem: Problem) -> bool:
        return False

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """The answer of the recursion; `secondary` (n,) fills what all levels leave free. See `Solver.solve`."""
        refusal = self._refusal(problem)
        if refusal is not None:
            return refusal
        if problem.metric is not None:
            return solve_in_metric(problem, secondary, self.solve)
        x, Z = np.zeros(problem.n), np.eye(problem.n)
        matrix, rhs, _, offsets = problem.stacked
        with np.errstate(all="ignore"):
            try:
                for start, end in zip(offsets[:-1].tolist(), offsets[1:].tolist(), strict=True):
                    if start == end or not Z.shape[1]:
                        continue
                    A = matrix[start:end]
                    size = two_norm(A)
                    U, sigma, Vt = np.linalg.svd(A @ Z)
                    rank = int(np.count_nonzero(sigma > self.rank_tolerance * size))
                    if rank:
                        svd = Svd(U[:, :rank], sigma[:rank], Z @ Vt[:rank].T)
                        x = x + self.step(A, rhs[start:end] - A @ x, Z, svd, size)
                    Z = Z @ Vt[rank:].T
            except np.linalg.LinAlgError:
                x = np.full(problem.n, np.nan)
            if secondary is not None:
                x = x + Z @ (Z.T @ secondary)
        if not np.isfinite(x).all():
            return Solution(problem, None, Status.NOT_FINITE, 0, OVERFLOW, secondary)
        return Solution(problem, x, secondary=secondary)


@dataclasses.dataclass(frozen=True)
class Svd:
    """`A Z = U diag(sigma) (Z^T V)^T`, singular values above the rank rule's zero, falling.

    Attributes:
        U: (m, r). sigma: (r,) > 0. V: (n, r), right singular vectors as directions of x.
    """

    U: FloatArray
    sigma: FloatArray
    V: FloatArray


def require_positive(name: str, value: object, *, below: float = np.inf) -> None:
    """Raises `SettingError` for what is no finite number in (0, below)."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < below:
        told = "a finite number > 0" if below == np.inf else f"a number > 0 and below {below:g}"
        raise SettingError(f"{name} is {value!r}; it must be {told}.")
