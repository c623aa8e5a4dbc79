"""The Jacobian pseudo-inverse (4)-(5): all levels as one, no priority."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from hqp_rp.core.closed_form import ClosedForm, Kernel
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution


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

    def kernel(self) -> Kernel:
        from hqp_rp.core.kernels.cascade import null_space

        return null_space

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        refusal = self._refusal(problem)
        if refusal is not None:
            return refusal
        matrix, rhs, _, _ = problem.stacked
        return self._run(problem, matrix, rhs, np.array([0, len(matrix)]), secondary)
