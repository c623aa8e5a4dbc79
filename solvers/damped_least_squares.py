"""Damped least squares (6)-(7), (14)-(19): all levels as one, regularized by a weight matrix."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hqp_rp.core import _native
from hqp_rp.core.closed_form import ClosedForm, as_one, as_one_level
from hqp_rp.core.damping import ConstantDamping, Damping, VariableDamping
from hqp_rp.core.errors import SettingError
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, IntArray, Problem
from hqp_rp.core.solution import Solution
from hqp_rp.core.variant import SOFT, LineUp, Variant


def equation_7(J: list[FloatArray], b: list[FloatArray], zeta: FloatArray, eta: float, W: FloatArray) -> FloatArray:
    """x = (J^T J + lambda)^-1 (J^T b + lambda zeta), lambda = eta^2 W, J = [J_1; ...; J_p] (m, n), b (m,), zeta (n,)."""
    stacked, rhs = np.vstack(J), np.concatenate(b)
    weight = eta**2 * W
    solved = np.linalg.solve(stacked.T @ stacked + weight, stacked.T @ rhs + weight @ zeta)
    return np.asarray(solved, dtype=np.float64)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DampedLeastSquares(ClosedForm):
    """min ||J x - b||^2 + ||x - zeta||_lambda^2, whose answer is x = (J^T J + lambda)^-1 (J^T b + lambda zeta).

    J = [A_1; ...; A_p] stacks all levels, without priority; ||x||_lambda^2 = x^T lambda x; lambda = eta^2 W, with eta from
    the damping policy and W the weight matrix, so W alone as in (7) is `ConstantDamping(1.0)`. It is computed from the
    singular values of J W^(-1/2), sigma_i / (sigma_i^2 + eta^2), and J^T J is never formed; with a variable policy (19)
    watches the smallest of them.

    As printed, the free-vector term of (7) is (I - (J^T J + lambda)^-1 (J^T J + lambda)) zeta = 0 for every zeta. Here it
    is (I - (J^T J + lambda)^-1 J^T J) zeta, the minimizer of (6) around zeta, which tends to (5) as lambda -> 0.

    Args:
        damping: eta; constant(0.1) by default, variable (18)-(19), truncation, or none.
        weight: W, symmetric positive definite (n, n), or (n,) for a diagonal; None means the problem's own metric, or the
            identity.

    Source: the paper, (6)-(7), (14)-(19); Wampler 1986; Nakamura and Hanafusa 1986.
    """

    damping: Damping = ConstantDamping(0.1)
    weight: ArrayLike | None = dataclasses.field(default=None, compare=False)
    root: FloatArray | None = dataclasses.field(default=None, init=False, repr=False, compare=False)

    name: ClassVar[str] = "damped_least_squares"
    summary: ClassVar[str] = "damped least squares over all levels at once, without priority"
    source: ClassVar[str] = "paper (6)-(7), (14)-(19)"
    exact_levels: ClassVar[int] = 1
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant("DLS constant", {"damping": ConstantDamping(0.1)}, SOFT, "all levels as one, damped everywhere"),
            Variant(
                "DLS variable",
                {"damping": VariableDamping(0.1, 0.1)},
                SOFT,
                "all levels as one, damped near singularities",
            ),
        ),
        place=110,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.weight is not None:
            object.__setattr__(self, "root", _root(self.weight))

    def native(self) -> _native.ClosedForm | None:
        return _native.null_space(self.rank_tolerance, self.damping.kind, *self.damping.parameters)

    def is_lexicographic(self, problem: Problem) -> bool:
        return self.weight is None and super().is_lexicographic(problem)

    def refuses(self, problem: Problem) -> str | None:
        if self.root is not None and len(self.root) != problem.n:
            return f"weight is for {len(self.root)} unknowns and the problem has {problem.n}."
        if self.root is not None and problem.metric is not None:
            return (
                "damped_least_squares has a weight and the problem a metric, which are the same thing; give one or the "
                "other."
            )
        return super().refuses(problem)

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        refusal = self._refusal(problem)
        if refusal is not None:
            return refusal
        if problem.metric is not None:
            return solve_in_metric(problem, secondary, self.solve)
        if self.root is None:
            return as_one_level(super().solve, problem, secondary)
        # With W = R^T R and y = R x, ||x||_W = ||y||: plain damping of J R^-1.
        matrix, rhs, _, offsets = problem.stacked
        turned = _solved(self.root.T, matrix.T).T.copy()
        free = None if secondary is None else self.root @ secondary
        found = as_one_level(super().solve, Problem.from_stacked(turned, rhs, rhs, offsets, check=False), free)
        x = None if found.x is None else _solved(self.root, found.x)
        return Solution(problem, x, found.status, 0, found.message, secondary)

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
        if upper is not None or self.root is None:
            rows = as_one(offsets) if upper is None else offsets
            super().solve_many(matrix, lower, upper, rows, secondary, x, codes)
            return
        turned = np.swapaxes(_solved(self.root.T, np.swapaxes(matrix, 1, 2)), 1, 2).copy()
        super().solve_many(turned, lower, None, as_one(offsets), secondary @ self.root.T, x, codes)
        x[:] = _solved(self.root, x.T).T


def _solved(A: FloatArray, B: FloatArray) -> FloatArray:
    """A^-1 B."""
    return np.asarray(np.linalg.solve(A, B), dtype=np.float64)


def _root(weight: ArrayLike) -> FloatArray:
    """R upper triangular with R^T R = weight."""
    W = np.array(weight, dtype=np.float64)
    if W.ndim == 1:
        W = np.diag(W)
    if W.ndim != 2 or W.shape[0] != W.shape[1] or not np.isfinite(W).all():
        raise SettingError(f"weight has shape {W.shape}; it must be n finite numbers or a finite matrix (n, n).")
    if not np.allclose(W, W.T, rtol=1e-12, atol=0.0):
        raise SettingError("weight is not symmetric; give (W + W.T) / 2 if that is what is meant.")
    try:
        return np.array(np.linalg.cholesky(W).T, dtype=np.float64, order="C")
    except np.linalg.LinAlgError:
        least = float(np.linalg.eigvalsh(W)[0])
        raise SettingError(
            f"weight is not positive definite (smallest eigenvalue {least:g}); every direction needs a positive weight."
        ) from None
