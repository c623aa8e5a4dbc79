"""Chiaverini's singularity-robust task priority (13) on N levels."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

from hqp_rp.core.closed_form import ClosedForm, Kernel


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

    def kernel(self) -> Kernel:
        from hqp_rp.core.kernels.robust import singularity_robust

        return singularity_robust

    def batch_kernel(self) -> int:
        from hqp_rp.core.kernels import batch

        return batch.SINGULARITY_ROBUST
