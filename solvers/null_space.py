"""Classical null-space priority (9)-(11) on N levels, in a stable form and as the textbook writes it."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, Literal

from hqp_rp.core import _native
from hqp_rp.core.closed_form import ClosedForm, Kernel
from hqp_rp.core.errors import unknown_name
from hqp_rp.core.solution import Solution, Status

VARIANTS = ("basis", "projector")


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

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.variant not in VARIANTS:
            raise unknown_name("variant of null_space", self.variant, VARIANTS)

    def native(self) -> _native.ClosedForm | None:
        if self.variant != "basis":
            return None
        return _native.null_space(self.rank_tolerance, self.damping.kind, *self.damping.parameters)

    def kernel(self) -> Kernel:
        from hqp_rp.core.kernels import cascade

        return cascade.null_space if self.variant == "basis" else cascade.null_space_projector

    def direct_kernel(self) -> Kernel | None:
        from hqp_rp.core.kernels import cascade

        return cascade.null_space_of if self.variant == "basis" else None

    def _judged(self, solution: Solution, code: float) -> Solution:
        if self.variant == "basis" or solution.x is None:
            return solution
        fault = ""
        if code - 1.0 > self.tolerance:
            fault = f"The recursive projector disturbed a finished level by {code - 1.0:.1e} of its size."
        elif self.damping.kind == 0:
            from hqp_rp.core.verify import fault_of

            fault = fault_of(solution.problem, solution.x, solution.secondary, self.tolerance)
        if fault:
            solution.status = Status.INACCURATE
            solution.message = f'{fault} variant="basis" has no such fault.'
        return solution

    def batch_kernel(self) -> int | None:
        from hqp_rp.core.kernels import batch

        if self.variant == "basis":
            return batch.NULL_SPACE
        return None if self.damping.kind == 0 else batch.NULL_SPACE_PROJECTOR  # undamped, each answer is judged
