"""Chiaverini's singularity-robust task priority (13) on N levels."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from hqp_rp.core.closed_form import ClosedForm
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.core.stacked import by_rank, load, pinv_times
from hqp_rp.core.variant import DAMPED, LineUp, Variant


def equation_13(J: list[FloatArray], b: list[FloatArray], zeta: FloatArray) -> FloatArray:
    """x = J_1^+ b_1 + N_1 J_2^+ b_2 + N_2 J_3^+ b_3 + ... + N_p zeta, N_k = I - J^+ J, J = [J_1; ...; J_k]: (13)."""
    n = len(zeta)
    x, N = np.zeros(n), np.eye(n)
    for k, (J_k, b_k) in enumerate(zip(J, b, strict=True)):
        x = x + N @ np.linalg.pinv(J_k) @ b_k
        above = np.vstack(J[: k + 1])
        N = np.eye(n) - np.linalg.pinv(above, rcond=1e-10) @ above
    return x + N @ zeta


@dataclasses.dataclass(frozen=True, kw_only=True)
class SingularityRobust(ClosedForm):
    """x = A_1^# b_1 + N_1 A_2^# b_2 + N_2 A_3^# b_3 + ... + N_p zeta, with N_k the projector on null([A_1; ...; A_k]).

    A level's pseudo-inverse never sees the levels before it, so the answer stays bounded at an algorithmic singularity, at
    the price of an error in every level but the first, even where all levels could be met. It is not lexicographic.
    N_k from an orthonormal basis. Damping acts on each level's own pseudo-inverse.

    Source: the paper, (13); Chiaverini 1997.
    """

    name: ClassVar[str] = "singularity_robust"
    summary: ClassVar[str] = "each level's own pseudo-inverse, projected once; bounded, but inexact below level 1"
    source: ClassVar[str] = "paper (13); Chiaverini 1997"
    exact_levels: ClassVar[int] = 1
    variants: ClassVar[LineUp] = LineUp(
        (Variant("singularity robust", {}, DAMPED, "Chiaverini's (13): bounded, inexact below level 1"),),
        place=70,
    )

    def stacked(
        self, matrix: FloatArray, rhs: FloatArray, offsets: IntArray, secondary: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        given = load(matrix, rhs, offsets)
        n = matrix.shape[2]
        steps = [
            pinv_times(J, b, self.rank_tolerance * given.size[:, k], self.damping, given.scale[:, k])
            for k, (J, b) in enumerate(zip(given.J, given.b, strict=True))
        ]
        x = np.where(given.finite[:, None], 0.0, np.full(secondary.shape, np.nan))
        # Problems whose levels keep the same ranks share one basis shape; Z (., n, d) spans what levels leave free.
        groups = [(np.arange(len(matrix)), np.broadcast_to(np.eye(n), (len(matrix), n, n)))]
        for k, J in enumerate(given.J):
            following = []
            for which, Z in groups:
                x[which] += np.einsum("nid,njd,nj->ni", Z, Z, steps[k][which])
                if J.shape[1] == 0 or Z.shape[2] == 0:
                    following.append((which, Z))
                    continue
                zero = self.rank_tolerance * given.size[which, k]
                positions = np.arange(len(which))
                for own, rank, _, _, Vt in by_rank(J[which] @ Z, zero, positions):
                    following.append((which[own], Z[own] @ np.swapaxes(Vt[:, rank:], 1, 2)))
            groups = following
        for which, Z in groups:
            x[which] += np.einsum("nid,njd,nj->ni", Z, Z, secondary[which])
        return x, np.zeros(len(matrix))
