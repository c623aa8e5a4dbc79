"""The pseudo-inverse of all levels as one (1)-(5): least squares without priority."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core import _native
from hqp_rp.core.closed_form import ClosedForm, as_one, as_one_level
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, IntArray, Problem
from hqp_rp.core.solution import Solution
from hqp_rp.core.variant import SOFT, LineUp, Variant


def equation_5(J: list[FloatArray], b: list[FloatArray], zeta: FloatArray) -> FloatArray:
    """x = J^+ b + (I - J^+ J) zeta with J = [J_1; ...; J_p] (m, n), b (m,), zeta (n,)."""
    stacked, rhs = np.vstack(J), np.concatenate(b)
    inverse = np.linalg.pinv(stacked)
    x: FloatArray = inverse @ rhs + (np.eye(len(zeta)) - inverse @ stacked) @ zeta
    return x


@dataclasses.dataclass(frozen=True, kw_only=True)
class PseudoInverse(ClosedForm):
    """x = J^+ b + (I - J^+ J) zeta with J = [A_1; ...; A_p], b = [b_1; ...; b_p]: equations (4)-(5).

    The least-squares answer of least norm over all rows at once: levels keep no order, and a level weighs by the size of
    its rows. J^+ by an orthogonal factorization, so rank-deficient J is allowed. `zeta` is the `secondary` vector.

    Source: the paper, (1)-(5), (16)-(17).
    """

    name: ClassVar[str] = "pseudo_inverse"
    summary: ClassVar[str] = "least squares over all levels at once, without priority"
    source: ClassVar[str] = "paper (1)-(5), (17)"
    exact_levels: ClassVar[int] = 1
    variants: ClassVar[LineUp] = LineUp(
        (Variant("pseudo-inverse", {}, SOFT, "all levels as one: the classical solution without priority"),),
        place=100,
    )

    def native(self) -> _native.ClosedForm | None:
        return _native.null_space(self.rank_tolerance, self.damping.kind, *self.damping.parameters)

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        refusal = self._refusal(problem)
        if refusal is None and problem.metric is not None:
            return solve_in_metric(problem, secondary, self.solve)
        return refusal or as_one_level(super().solve, problem, secondary)

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
        super().solve_many(matrix, lower, upper, as_one(offsets) if upper is None else offsets, secondary, x, codes)
