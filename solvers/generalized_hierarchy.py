"""Generalized hierarchical control (Liu, Tan and Padois 2016): priorities between strict and none."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar, TypeAlias

import numpy as np

from hqp_rp.core.errors import SettingError
from hqp_rp.core.level_by_level import OVERFLOW
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.shares import checked_shares
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE, Solver, require_rank_tolerance
from hqp_rp.core.variant import DAMPED, LineUp, Variant

Priorities: TypeAlias = float | tuple[tuple[float, ...], ...]


@dataclasses.dataclass(frozen=True, kw_only=True)
class GeneralizedHierarchy(Solver):
    """x = sum_i P_i(alpha_i) A_i^+ b_i: each level's own answer, projected as far out of the others' way as alpha says.

    ::

        P_i = I - B^T Lambda B
        B (r, n)      Gram-Schmidt of the rows of all levels, those with the greatest alpha_ij first
        Lambda (r, r) diagonal, alpha_ij of the level j that a row of B came from

    alpha_ij = 1: level i is strictly below level j, projected into its null space. 0: level j does not matter to level i.
    Between: partly. alpha_ii = 0: level i is present; 1: it is gone. With the default, alpha_ij = 1 for j < i and 0
    otherwise, this is `singularity_robust`, (13): level 1 exact, the others projected but not corrected; alpha from 1 to 0
    leads from there to the sum of all levels' own answers. x is continuous in alpha as long as no rank changes, so that
    priorities are swapped without a jump by moving alpha_12 from 0 to 1 while alpha_21 goes from 1 to 0.

    Args:
        alpha: one number in [0, 1] for all pairs with j < i, or p rows of p numbers each in [0, 1].
        rank_tolerance: a row that is this small beside its level after Gram-Schmidt depends on the rows before it; in [0, 1).

    Source: Liu, Tan and Padois 2016, whose quadratic program has limits as well; without limits it is this sum. The text was
        not at hand; the docstring rests on its abstract and on what its successors (Han et al. 2021) say of it.
    """

    alpha: Priorities = 1.0
    rank_tolerance: float = RANK_TOLERANCE

    name: ClassVar[str] = "generalized_hierarchy"
    summary: ClassVar[str] = "levels' own answers, each projected out of the others' way to a degree; no jump in a swap"
    source: ClassVar[str] = "Liu, Tan and Padois 2016"
    takes_metric: ClassVar[bool] = True
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant(
                "generalized hierarchy",
                {},
                DAMPED,
                "strict priorities by generalized projectors: (13), and partly strict ones",
            ),
        ),
        place=180,
        only_with="transitions",
    )

    def __post_init__(self) -> None:
        meant = "a number, or p rows of p numbers, in [0, 1]"
        rows = checked_shares(self.alpha, "alpha", "priority", meant, depth=2)
        if isinstance(rows, tuple) and (not rows or any(len(row) != len(rows) for row in rows)):
            raise SettingError(
                f"alpha has rows of {[len(row) for row in rows]} numbers; it must be p rows of p numbers."
            )
        object.__setattr__(self, "alpha", rows)
        require_rank_tolerance(self.rank_tolerance)

    def refuses(self, problem: Problem) -> str | None:
        """Hard and two-sided rows, damped levels, and a number of levels that alpha is not for."""
        if isinstance(self.alpha, tuple) and len(self.alpha) != problem.p:
            return f"alpha is for {len(self.alpha)} levels and the problem has {problem.p}."
        return super().refuses(problem)

    def is_lexicographic(self, problem: Problem) -> bool:
        return problem.p == 1 and self._priorities(1)[0, 0] == 0.0 and problem.is_equality

    def _priorities(self, p: int) -> FloatArray:
        if isinstance(self.alpha, tuple):
            return np.array(self.alpha, dtype=np.float64).reshape(p, p)
        return np.tril(np.full((p, p), float(self.alpha)), -1)

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """The sum; `secondary` (n,) fills the null space of all levels. See `Solver.solve`."""
        refusal = self._refusal(problem)
        if refusal is not None:
            return refusal
        if problem.metric is not None:
            return solve_in_metric(problem, secondary, self.solve)
        matrix, rhs, _, offsets = problem.stacked
        levels = [matrix[a:b] for a, b in zip(offsets[:-1].tolist(), offsets[1:].tolist(), strict=True)]
        with np.errstate(all="ignore"):
            try:
                x = self._sum(levels, rhs, offsets.tolist(), secondary, problem.n)
            except np.linalg.LinAlgError:
                x = np.full(problem.n, math.nan)
        if not np.isfinite(x).all():
            return Solution(problem, None, Status.NOT_FINITE, 0, OVERFLOW, secondary)
        return Solution(problem, x, secondary=secondary)

    def _sum(
        self, levels: list[FloatArray], rhs: FloatArray, offsets: list[int], secondary: FloatArray | None, n: int
    ) -> FloatArray:
        alpha = self._priorities(len(levels))
        x = np.zeros(n)
        for i, A in enumerate(levels):
            if len(A):
                own = _least_squares(A, rhs[offsets[i] : offsets[i + 1]], self.rank_tolerance)
                x = x + own - _projected(levels, alpha[i], own, self.rank_tolerance)
        if secondary is not None:
            x = x + secondary - _projected(levels, np.ones(len(levels)), secondary, self.rank_tolerance)
        return x


def _least_squares(A: FloatArray, b: FloatArray, tolerance: float) -> FloatArray:
    U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
    kept = sigma > tolerance * sigma[0]
    found: FloatArray = Vt[kept].T @ (U[:, kept].T @ b / sigma[kept])
    return found


def _projected(levels: list[FloatArray], alpha: FloatArray, v: FloatArray, tolerance: float) -> FloatArray:
    """B^T Lambda B v: an orthonormal basis of all levels' rows, level by level, the greatest alpha first.

    Within a level, and among levels of one alpha, the basis is that of their span: the order of rows does not matter.
    """
    n = len(v)
    Z = np.eye(n)
    out = np.zeros(n)
    for value in sorted({float(a) for a in alpha if a > 0.0}, reverse=True):
        for A in [levels[j] for j in range(len(levels)) if alpha[j] == value and len(levels[j])]:
            if not Z.shape[1]:
                break
            sigma, Vt = np.linalg.svd(A @ Z)[1:]
            rank = int(np.count_nonzero(sigma > tolerance * np.linalg.norm(A, 2)))
            basis = Z @ Vt[:rank].T
            out = out + value * basis @ (basis.T @ v)
            Z = Z @ Vt[rank:].T
    return out
