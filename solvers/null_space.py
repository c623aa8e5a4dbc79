"""Classical null-space priority (9)-(11) on N levels, in a stable form and as the textbook writes it."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core import _native
from hqp_rp.core.closed_form import ClosedForm
from hqp_rp.core.damping import (
    ConstantDamping,
    ManipulabilityDamping,
    NoDamping,
    NumericalFiltering,
    Truncation,
    VariableDamping,
)
from hqp_rp.core.errors import unknown_name
from hqp_rp.core.problem import FloatArray, IntArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver
from hqp_rp.core.stacked import load, pinv, pinv_times
from hqp_rp.core.variant import BOUNDED, DAMPED, EXACT, LineUp, Variant

VARIANTS = ("basis", "projector")


def equation_11(J: list[FloatArray], b: list[FloatArray], zeta: FloatArray) -> FloatArray:
    """x <- x + (J_k N_{k-1})^+ (b_k - J_k x) for k = 1, ..., p, from x = zeta (n,): (11) on N levels.

    N_k = N_{k-1} - (J_k N_{k-1})^+ J_k N_{k-1}, N_0 = I; J_k (m_k, n), b_k (m_k,). For regular J_k alone.
    """
    x, N = zeta, np.eye(len(zeta))
    for J_k, b_k in zip(J, b, strict=True):
        restricted = np.linalg.pinv(J_k @ N, rcond=1e-10)
        x = x + restricted @ (b_k - J_k @ x)
        N = N - restricted @ J_k @ N
    return x


@dataclasses.dataclass(frozen=True, kw_only=True)
class NullSpace(ClosedForm):
    """x_k = x_{k-1} + (A_k N_{k-1})^# (b_k - A_k x_{k-1}) for k = 1, ..., p, from x_0 = zeta: equation (11) on N levels.

    N_k projects on the null space of [A_1; ...; A_k]. The undamped form is the lexicographic optimum nearest to zeta.

    Args:
        variant: "basis" keeps an orthonormal basis of the null space by orthogonal factorizations: every finished level
            stays at rounding error, at any condition. "projector" is the textbook recursion
            N_k = N_{k-1} - (A_k N_{k-1})^# A_k N_{k-1}, which loses the first level near an algorithmic singularity; it
            ends with `Status.INACCURATE` when a finished level was disturbed by more than the declared tolerance or, undamped,
            when the answer is found not to be the optimum.
        damping: acts on the pseudo-inverse that gives a level's answer, never on the null space it leaves.

    Source: the paper, (9)-(11); Nakamura 1987; Siciliano and Slotine 1991.
    """

    variant: Literal["basis", "projector"] = "basis"

    name: ClassVar[str] = "null_space"
    summary: ClassVar[str] = "each level in the null space of the ones before it"
    source: ClassVar[str] = "paper (9)-(11); Siciliano and Slotine 1991"
    exact_levels: ClassVar[int] = 1_000_000
    takes_damping: ClassVar[bool] = True
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant("null space", {}, EXACT, "the stable form: an orthonormal basis of the remaining null space"),
            Variant("null space textbook", {"variant": "projector"}, EXACT, "the recursion as textbooks print it"),
            Variant(
                "null space constant", {"damping": ConstantDamping(0.1)}, DAMPED, "damped everywhere along the path"
            ),
            Variant(
                "null space variable",
                {"damping": VariableDamping(0.1, 0.1)},
                DAMPED,
                "damped near singularities only, (18)-(19)",
            ),
            Variant("null space truncated", {"damping": Truncation(0.01)}, DAMPED, "small singular values cut"),
            Variant(
                "null space filtered",
                {"damping": NumericalFiltering(0.1, 0.1)},
                BOUNDED,
                "numerical filtering: the last singular direction alone is damped",
            ),
            Variant(
                "null space manipulability",
                {"damping": ManipulabilityDamping(0.05, 0.1)},
                BOUNDED,
                "damped by the manipulability, as Nakamura and Hanafusa have it",
            ),
        ),
        place=10,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.variant not in VARIANTS:
            raise unknown_name("variant of null_space", self.variant, VARIANTS)

    def refuses(self, problem: Problem) -> str | None:
        """Hard and two-sided rows, and damping of single levels beside a damping of all."""
        if problem.damping is not None and not isinstance(self.damping, NoDamping):
            return (
                f"null_space has damping {self.damping!r} for all levels and the problem has its own for single ones; give one "
                "or the other."
            )
        return super().refuses(problem)

    def native(self) -> _native.ClosedForm | None:
        if self.variant != "basis":
            return None
        return _native.null_space(self.rank_tolerance, self.damping.kind, *self.damping.parameters)

    def stacked(
        self, matrix: FloatArray, rhs: FloatArray, offsets: IntArray, secondary: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """The textbook recursion on N problems; the measure is the largest disturbance of a finished level by a later one.

        It is relative to ||A_k|| ||x|| + ||b_k||.
        """
        given = load(matrix, rhs, offsets)
        x = np.where(given.finite[:, None], secondary, np.nan)
        P = np.broadcast_to(np.eye(matrix.shape[2]), (len(matrix), matrix.shape[2], matrix.shape[2]))
        reached = []
        for k, (J, b) in enumerate(zip(given.J, given.b, strict=True)):
            zero = self.rank_tolerance * given.size[:, k]
            JP = J @ P
            x = x + pinv_times(JP, b - np.einsum("nij,nj->ni", J, x), zero, self.damping, given.scale[:, k])
            P = P - pinv(JP, zero, NoDamping()) @ JP
            reached.append(np.einsum("nij,nj->ni", J, x))
        disturbed = np.zeros(len(matrix))
        for J, b, at in zip(given.J, given.b, reached, strict=True):
            moved = np.linalg.norm(np.einsum("nij,nj->ni", J, x) - at, axis=1)
            size = np.linalg.norm(b, axis=1) + np.linalg.norm(J, axis=(1, 2)) * np.linalg.norm(x, axis=1)
            disturbed = np.maximum(disturbed, np.where(size > 0.0, moved / np.where(size > 0.0, size, 1.0), 0.0))
        return x, disturbed

    def _judged(self, solution: Solution, measure: float) -> Solution:
        fault = ""
        if measure > self.tolerance:
            fault = f"The recursive projector disturbed a finished level by {measure:.1e} of its size."
        elif self.damping.kind == 0:
            from hqp_rp.core.verify import fault_of

            assert solution.x is not None
            fault = fault_of(solution.problem, solution.x, solution.secondary, self.tolerance)
        if fault:
            solution.status = Status.INACCURATE
            solution.message = f'{fault} variant="basis" has no such fault.'
        return solution

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
        if self.variant == "basis" or self.damping.kind != 0:
            super().solve_many(matrix, lower, upper, offsets, secondary, x, codes)
        else:  # undamped, each answer is judged
            Solver.solve_many(self, matrix, lower, upper, offsets, secondary, x, codes)
