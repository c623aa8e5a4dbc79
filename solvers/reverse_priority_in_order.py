"""Reverse priority repaired for three and more levels: each correction disturbs the lower levels in their order. Ours."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from hqp_rp.core.closed_form import ClosedForm
from hqp_rp.core.damping import NoDamping, NumericalFiltering, VariableDamping
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.core.stacked import damped_inverses, load
from hqp_rp.core.variant import BOUNDED, LineUp, Variant


def in_order(J: list[FloatArray], b: list[FloatArray], zeta: FloatArray) -> FloatArray:
    """x <- x + dx_k for k = p, ..., 1 from x = zeta (n,): dx_k the lexicographic optimum of

        J_k dx = b_k - J_k x,  J_{k+1} dx = 0,  ...,  J_p dx = 0,  least ||dx||

    by null-space priority from matrices; for regular J_k alone.
    """
    x = zeta
    for k in range(len(J) - 1, -1, -1):
        dx, N = np.zeros(len(zeta)), np.eye(len(zeta))
        for j in range(k, len(J)):
            restricted = np.linalg.pinv(J[j] @ N, rcond=1e-10)
            target = b[k] - J[k] @ x if j == k else np.zeros(len(b[j]))
            dx = dx + restricted @ (target - J[j] @ dx)
            N = N - restricted @ J[j] @ N
        x = x + dx
    return x


@dataclasses.dataclass(frozen=True, kw_only=True)
class ReversePriorityInOrder(ClosedForm):
    """Lowest level first; each higher one is corrected with the least disturbance of those below, in their order. **Ours.**

    ::

        x <- x + dx_k,  k = p, ..., 1:    dx_k the lexicographic optimum of
                                          J_k dx = b_k - J_k x,  J_{k+1} dx = 0,  ...,  J_p dx = 0,  least ||dx||

    The paper's (29) lets a correction disturb all lower levels together, and is lexicographic on two levels only. Here it
    disturbs level k + 1 least, then k + 2, and so on, and undamped the answer is the lexicographic optimum nearest to zeta
    on any number of levels (proof: the page "Reverse priority, repaired"), so it grows beyond all bounds near an algorithmic
    singularity, as every exact method does. Damping acts on the pseudo-inverses that keep disturbances small, never on the
    one that corrects level k: level 1 is met to rounding, and ||x|| is bounded wherever each level by itself is regular.
    With a policy that sets in at a threshold (`VariableDamping`, `ManipulabilityDamping`) the answer is still the
    lexicographic one where no singular value is below it.

    It costs p (p + 1) / 2 factorizations where (29) takes p, and its bound is worse: lower levels are met at any joint
    velocity before higher ones correct them. `null_space` with the same policy costs less and damps level 1 too, where J_1
    itself is near singular.

    Args:
        damping: of (J_j N)^# for j > k, N the null space of J_k, ..., J_{j-1}. `NumericalFiltering` is refused as in
            `reverse_priority`.

    Source: ours, after the paper's (20)-(29) and Flacco and De Luca 2014.
    """

    name: ClassVar[str] = "reverse_priority_in_order"
    summary: ClassVar[str] = (
        "reverse priority that disturbs lower levels in their order: lexicographic on any number of levels"
    )
    source: ClassVar[str] = "ours, after paper (20)-(29)"
    exact_levels: ClassVar[int] = 1_000_000
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant(
                "reverse in order",
                {"damping": VariableDamping(0.1, 0.1)},
                BOUNDED,
                "ours: lower levels disturbed in their order, lexicographic away from singularities",
            ),
        ),
        place=60,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.damping, NumericalFiltering):
            raise SettingError(
                f"damping is {self.damping!r}, which leaves all but one direction undamped, so that x is not bounded; give "
                "VariableDamping(delta, maximum)."
            )

    def stacked(
        self, matrix: FloatArray, rhs: FloatArray, offsets: IntArray, secondary: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        given = load(matrix, rhs, offsets)
        x = np.where(given.finite[:, None], secondary, np.nan)
        for i in np.flatnonzero(given.finite):
            levels = [(J[i], b[i]) for J, b in zip(given.J, given.b, strict=True)]
            x[i] = self._one(levels, given.scale[i], given.size[i], x[i])
        return x, np.zeros(len(matrix))

    def _one(
        self, levels: list[tuple[FloatArray, FloatArray]], scale: FloatArray, size: FloatArray, x: FloatArray
    ) -> FloatArray:
        present = [k for k, (J, _) in enumerate(levels) if len(J)]
        for place in range(len(present) - 1, -1, -1):
            k = present[place]
            for _ in range(2):  # once more where a step cancels most of what lower levels had put into x
                before = np.abs(x).max()
                x = x + self._correction(levels, present[place:], levels[k][1] - levels[k][0] @ x, scale, size)
                if not before > 4.0 * np.abs(x).max():
                    break
        return x

    def _correction(
        self,
        levels: list[tuple[FloatArray, FloatArray]],
        order: list[int],
        missing: FloatArray,
        scale: FloatArray,
        size: FloatArray,
    ) -> FloatArray:
        """dx (n,): `missing` for the first level of `order`, no disturbance of the others, in their order."""
        n = levels[order[0]][0].shape[1]
        dx, Z = np.zeros(n), np.eye(n)
        for j in order:
            if not Z.shape[1]:
                break
            J = levels[j][0]
            first = j == order[0]
            U, sigma, Vt = np.linalg.svd(J @ Z)
            zero = self.rank_tolerance * size[j]
            rank = int(np.count_nonzero(sigma > zero))
            policy = NoDamping() if first else self.damping
            full = len(sigma) == min(len(J), Z.shape[1])
            inverse = damped_inverses(sigma[None], np.array([zero]), policy, scale[j : j + 1], full)[0, :rank]
            along = U[:, :rank].T @ (missing if first else -(J @ dx))
            dx = dx + Z @ (Vt[:rank].T @ (inverse * along))
            Z = Z @ Vt[rank:].T
        return dx
