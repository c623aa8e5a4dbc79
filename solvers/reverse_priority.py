"""Reverse priority (20)-(32) on N levels: the lowest level first, the first level last."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, Literal

import numpy as np

from hqp_rp.core import _native
from hqp_rp.core.closed_form import ClosedForm
from hqp_rp.core.damping import ConstantDamping, Damping, NoDamping, NumericalFiltering, Truncation, VariableDamping
from hqp_rp.core.errors import SettingError, unknown_name
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.core.stacked import Loaded, by_rank, damping_factors, load, pinv, pinv_times, range_projector, two_norms
from hqp_rp.core.variant import DAMPED, EXACT, LineUp, Variant

FORMS = ("columns", "projector")
PLACES = ("t_k", "everywhere")


def equation_29(J: list[FloatArray], b: list[FloatArray], zeta: FloatArray) -> FloatArray:
    """x <- x + T_k (J_k T_k)^+ (b_k - J_k x) for k = p, ..., 1, from x = zeta (n,): (29).

    T_k (n, m_k): the first m_k columns of [J_k; J_{k+1}; ...; J_p]^+ (23)-(25); J_k (m_k, n), b_k (m_k,).
    """
    x = zeta
    for k in range(len(J) - 1, -1, -1):
        T_k = np.linalg.pinv(np.vstack(J[k:]), rcond=1e-10)[:, : len(J[k])]
        x = x + T_k @ np.linalg.pinv(J[k] @ T_k, rcond=1e-10) @ (b[k] - J[k] @ x)
    return x


def equation_22(J: list[FloatArray], b: list[FloatArray], zeta: FloatArray) -> FloatArray:
    """x <- x + (J_k P_{k+1})^+ (b_k - J_k x) for k = p, ..., 1: (22), P_{k+1} = T_k T_k^+ + N_k of (27).

    N_k projects on the null space of [J_k; ...; J_p], where J_k N_k = 0: it drops out, by (28).
    """
    x = zeta
    for k in range(len(J) - 1, -1, -1):
        T_k = np.linalg.pinv(np.vstack(J[k:]), rcond=1e-10)[:, : len(J[k])]
        P = T_k @ np.linalg.pinv(T_k, rcond=1e-10)
        x = x + np.linalg.pinv(J[k] @ P, rcond=1e-10) @ (b[k] - J[k] @ x)
    return x


def require_whole(damping: Damping, remedy: str) -> None:
    """Raises `SettingError` for a policy that T_k cannot be damped by."""
    if isinstance(damping, NumericalFiltering):
        raise SettingError(
            f"damping is {damping!r}, which damps one direction of a pseudo-inverse, and T_k is regularized as a whole; "
            f"{remedy}."
        )


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
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant("reverse priority", {}, EXACT, "equation (29), undamped; lexicographic on two levels only"),
            Variant(
                "reverse T_k constant",
                {"damping": ConstantDamping(0.1)},
                DAMPED,
                "damping in the pseudo-inverse that gives T_k only",
            ),
            Variant(
                "reverse T_k variable",
                {"damping": VariableDamping(0.1, 0.1)},
                DAMPED,
                "the same, near singularities only",
            ),
            Variant(
                "reverse all damped",
                {"damping": ConstantDamping(0.1), "damp": "everywhere"},
                DAMPED,
                "a plain reading of (15) in (32): every pseudo-inverse damped",
            ),
        ),
        place=50,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.form not in FORMS:
            raise unknown_name("form of reverse_priority", self.form, FORMS)
        if self.damp not in PLACES:
            raise unknown_name("place to damp in reverse_priority", self.damp, PLACES)
        if self.damp == "t_k":
            require_whole(self.damping, "give damp='everywhere', or VariableDamping(delta, maximum)")

    def native(self) -> _native.ClosedForm | None:
        if self.form == "projector" or (self.damp == "everywhere" and self.damping.kind != 0):
            return None
        return _native.reverse_priority(self.rank_tolerance, self.damping.kind, *self.damping.parameters)

    def stacked(
        self, matrix: FloatArray, rhs: FloatArray, offsets: IntArray, secondary: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        given = load(matrix, rhs, offsets)
        x = np.where(given.finite[:, None], secondary, np.nan)
        everywhere = self.damp == "everywhere" and self.damping.kind != 0
        for k in range(len(given.J) - 1, -1, -1):
            if given.J[k].shape[1] == 0:
                continue
            if everywhere:
                x = x + self._damped_step(given, k, x)
                continue
            for _ in range(2):  # once more where a step cancels most of what lower levels had put into x
                before = np.abs(x).max(axis=1)
                x = x + self._projected_step(given, k, x)
                if not (before > 4.0 * np.abs(x).max(axis=1)).any():
                    break
        return x, np.zeros(len(matrix))

    def _damped_step(self, given: Loaded, k: int, x: FloatArray) -> FloatArray:
        """(29) or (22) with every pseudo-inverse damped, as a plain reading of (15) in (32) has it."""
        weights, unit = given.weights(k), given.unit(k)
        rows = np.concatenate(given.J[k:], axis=1) * weights[:, :, None]
        m = given.J[k].shape[1]
        T = pinv(rows, self.rank_tolerance * two_norms(rows), self.damping, unit)[:, :, :m]
        J_k = rows[:, :m]
        t = (given.b[k] - np.einsum("nij,nj->ni", given.J[k], x)) * weights[:, :m]
        if self.form == "projector":
            zero = self.rank_tolerance * two_norms(J_k)
            return pinv_times(J_k @ range_projector(T), t, zero, self.damping, unit)
        inner = J_k @ T
        step = pinv_times(inner, t, self.rank_tolerance * two_norms(inner), self.damping)
        moved: FloatArray = np.einsum("nij,nj->ni", T, step)
        return moved

    def _projected_step(self, given: Loaded, k: int, x: FloatArray) -> FloatArray:
        """(J_k P)^+ (b_k - J_k x), P the projector on range(T_k), T_k damped by the policy: (22) with (27)-(28)."""
        n = x.shape[1]
        step = np.zeros_like(x)
        t = given.b[k] - np.einsum("nij,nj->ni", given.J[k], x)
        weights, unit = given.weights(k), given.unit(k)
        lower = np.concatenate([*given.J[k + 1 :], np.zeros((len(x), 0, n))], axis=1)
        policy = self.damping
        spans = [(np.arange(len(x)), np.broadcast_to(np.eye(n), (len(x), n, n)))]
        factor = damping_factors(np.zeros((len(x), 0)), policy, unit, True)[:, 0]
        if policy.kind not in (NoDamping.kind, ConstantDamping.kind):
            weighted = np.concatenate((given.J[k], lower), axis=1) * weights[:, :, None]
            sigma = np.linalg.svd(weighted, compute_uv=False)
            if isinstance(policy, Truncation):
                spans = [
                    (own, np.swapaxes(Vt[:, :kept], 1, 2))
                    for own, kept, _, _, Vt in by_rank(weighted, policy.threshold * unit, np.arange(len(x)))
                    if kept
                ]
            else:
                factor = damping_factors(sigma, policy, unit, True)[:, 0]
        m = given.J[k].shape[1]
        for which, V in spans:
            J, B = given.J[k][which] @ V, lower[which] @ V
            zero = self.rank_tolerance * given.size[which, k]
            for own, rank, _, _, Vt in by_rank(J, zero, np.arange(len(which))):
                if rank == 0:
                    continue
                Y, Z = np.swapaxes(Vt[:, :rank], 1, 2), np.swapaxes(Vt[:, rank:], 1, 2)
                T = Y
                if Z.shape[2] and B.shape[1]:  # the least disturbance of the lower rows along each direction of Y
                    D = weights[which[own], m:, None]
                    BZ, BY = B[own] @ Z, B[own] @ Y
                    cut = self.rank_tolerance * two_norms(B[own]) * D.min(axis=(1, 2))
                    alone = factor[which[own]]
                    by = ConstantDamping(1.0) if alone.any() else NoDamping()
                    small = np.where(alone > 0.0, -1.0, cut)
                    T = Y - Z @ (pinv(D * BZ, small, by, alone) @ (D * BY))
                P = np.linalg.qr(T)[0]
                restricted = np.einsum("nij,njr->nir", J[own], P)
                answer = pinv_times(restricted, t[which[own]], zero[own], NoDamping())
                step[which[own]] = np.einsum("nij,njr,nr->ni", V[own], P, answer)
        return step
