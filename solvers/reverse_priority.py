"""Reverse priority (20)-(32) on N levels: the lowest level first, the first level last."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, Literal

from hqp_rp.core import _native
from hqp_rp.core.closed_form import ClosedForm, Kernel
from hqp_rp.core.errors import unknown_name

FORMS = ("columns", "projector")
PLACES = ("t_k", "everywhere")


@dataclasses.dataclass(frozen=True, kw_only=True)
class ReversePriority(ClosedForm):
    """x_k = x_{k+1} + T_k (J_k T_k)^# (b_k - J_k x_{k+1}) for k = p, ..., 1, from x_{p+1} = zeta: equation (29).

    T_k holds the first columns of the pseudo-inverse of the reverse augmented Jacobian [J_k; J_{k+1}; ...; J_p] (23)-(25),
    task k on top of all lower tasks: step k is the correction of task k that disturbs all lower tasks least, jointly.
    On two levels and undamped it is the lexicographic optimum, for dependent tasks too. On three or more conflicting
    levels it is its own answer: level 1 is exact, but the lower levels share what is left instead of ranking it.

    Args:
        form: "columns" is (29). "projector" is (20)-(22), x_k = x_{k+1} + (J_k P_{k+1})^# (b_k - J_k x_{k+1}) with P_{k+1}
            of (27): the same answer in exact arithmetic by (28).
        damping: of the pseudo-inverse that gives T_k.
        damp: "t_k" damps that pseudo-inverse alone, which keeps level 1 exact while x stays bounded through an algorithmic
            singularity (a kinematic singularity of a task itself is then not damped). "everywhere" damps (J_k T_k)^# as
            well, as a plain reading of (15) in (32) has it, and spoils every level.

    Source: the paper, (20)-(32); Flacco and De Luca 2014.
    """

    form: Literal["columns", "projector"] = "columns"
    damp: Literal["t_k", "everywhere"] = "t_k"

    name: ClassVar[str] = "reverse_priority"
    summary: ClassVar[str] = "lowest level first, each higher one corrected with the least disturbance of those below"
    source: ClassVar[str] = "paper (20)-(32); Flacco and De Luca 2014"
    exact_levels: ClassVar[int] = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.form not in FORMS:
            raise unknown_name("form of reverse_priority", self.form, FORMS)
        if self.damp not in PLACES:
            raise unknown_name("place to damp in reverse_priority", self.damp, PLACES)

    def native(self) -> _native.ClosedForm | None:
        if self.form == "projector" or (self.damp == "everywhere" and self.damping.kind != 0):
            return None
        return _native.reverse_priority(self.rank_tolerance, self.damping.kind, *self.damping.parameters)

    def kernel(self) -> Kernel:
        from hqp_rp.core.kernels import reverse

        if self.damp == "everywhere" and self.damping.kind != 0:
            return reverse.damped_projector_form if self.form == "projector" else reverse.damped_columns_form
        return reverse.projector_form if self.form == "projector" else reverse.columns_form

    def direct_kernel(self) -> Kernel | None:
        from hqp_rp.core.kernels import reverse

        plain = self.form == "columns" and (self.damp != "everywhere" or self.damping.kind == 0)
        return reverse.columns_form_of if plain else None

    def batch_kernel(self) -> int:
        from hqp_rp.core.kernels import batch

        if self.damp == "everywhere" and self.damping.kind != 0:
            return batch.DAMPED_PROJECTOR_FORM if self.form == "projector" else batch.DAMPED_COLUMNS_FORM
        return batch.PROJECTOR_FORM if self.form == "projector" else batch.COLUMNS_FORM
