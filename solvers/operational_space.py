"""Operational-space control: task forces through the inertia that each task feels, with singularities handled."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from hqp_rp.core import _native
from hqp_rp.core.closed_form import ClosedForm
from hqp_rp.core.damping import NoDamping
from hqp_rp.core.errors import SettingError, unknown_name
from hqp_rp.core.problem import FloatArray, IntArray, Problem
from hqp_rp.core.stacked import load
from hqp_rp.core.variant import DAMPED, EXACT, LineUp, Variant

SINGULARITIES = ("as damping says", "selective", "blend")


def equation_khatib_sentis(J: list[FloatArray], b: list[FloatArray], M: FloatArray) -> FloatArray:
    """tau = sum_k J_{k|prev}^T Lambda_{k|prev} (b_k - J_k M^-1 tau_{k-1}); the acceleration is M^-1 tau.

    J_{k|prev} = J_k N_{k-1}, Lambda_{k|prev} = (J_{k|prev} M^-1 J_{k|prev}^T)^-1, N_k = N_{k-1} - Jbar_k J_{k|prev} with the
    dynamically consistent inverse Jbar_k = M^-1 J_{k|prev}^T Lambda_{k|prev}; N_0 = I. For regular J_k alone.
    """
    n = len(M)
    tau, N, inverse = np.zeros(n), np.eye(n), np.linalg.inv(M)
    for J_k, b_k in zip(J, b, strict=True):
        restricted = J_k @ N
        Lambda = np.linalg.pinv(restricted @ inverse @ restricted.T, rcond=1e-12)
        tau = tau + restricted.T @ Lambda @ (b_k - J_k @ inverse @ tau)
        N = N - inverse @ restricted.T @ Lambda @ restricted
    return tau


@dataclasses.dataclass(frozen=True, kw_only=True)
class OperationalSpace(ClosedForm):
    """tau = sum_k J_{k|prev}^T Lambda_{k|prev} (b_k - J_k x_{k-1}), x = M^-1 tau, with M the problem's metric.

    The unknown is v-dot and level k reads J_k v-dot = b_k, as `AccelerationStack(metric="inertia")` states it;
    J_{k|prev} = J_k N_{k-1} is what is left of the task in the dynamically consistent null space of those before it, and
    Lambda_{k|prev} = (J_{k|prev} M^-1 J_{k|prev}^T)^-1 the inertia it feels. The torque is M x, and h on top of it. In
    y = R x, M = R^T R, this is null-space priority, with the same answer: undamped it is the lexicographic optimum of least
    ||x||_M. What sets the family apart is what it does with small eigenvalues sigma_i^2 of J_{k|prev} M^-1 J_{k|prev}^T, on the
    directions u_i, with r_i = sigma_i / ||J_k R^-1||::

        "as damping says"   the policy in `damping` on all directions: lambda^2 I added, or truncated
        "selective"         1 / sigma_i -> sigma_i / (sigma_i^2 + lambda_i^2), lambda_i = (1 - s_i) high ||J_k R^-1||,
                            s_i = clip((r_i - low) / (high - low), 0, 1): directions above `high` stay exact
        "blend"             s_i / sigma_i, and a direction with s_i < 1 is left to the levels below

    A problem without a metric has M = I.

    Args:
        singularity: one of these. damping: for the first; none by default.
        low, high: 0 < low < high < 1, of the other two; ratios of singular values, so that they hold for arms of any mass.

    Source: Khatib 1987; Sentis and Khatib 2005 for N levels. "selective" is after the damping of poorly conditioned task
    directions in Isaac Lab's operational-space controller, "blend" after the singularity handler of sai-primitives: the
    idea is theirs, the thresholds' names and the formulas as written here are ours (that handler also adds torques of its own
    in singular directions, which are not here).
    """

    singularity: str = "as damping says"
    low: float = 0.01
    high: float = 0.1

    name: ClassVar[str] = "operational_space"
    summary: ClassVar[str] = "task forces through the inertia each task feels; the null-space answer in the metric M"
    source: ClassVar[str] = "Khatib 1987; Sentis and Khatib 2005"
    exact_levels: ClassVar[int] = 1_000_000
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant(
                "operational space", {}, EXACT, "Khatib and Sentis: null-space priority in the metric of the problem"
            ),
            Variant(
                "operational selective",
                {"singularity": "selective"},
                DAMPED,
                "small eigenvalues of the task inertia damped",
            ),
            Variant(
                "operational blend",
                {"singularity": "blend"},
                DAMPED,
                "singular directions blended out, left to lower levels",
            ),
        ),
        place=80,
        only_with="torques",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.singularity not in SINGULARITIES:
            raise unknown_name("singularity of operational_space", self.singularity, SINGULARITIES)
        if not 0.0 < self.low < self.high < 1.0:
            raise SettingError(f"low, high are {self.low!r}, {self.high!r}; they must be 0 < low < high < 1.")
        if self.singularity != SINGULARITIES[0] and not isinstance(self.damping, NoDamping):
            raise SettingError(
                f"singularity={self.singularity!r} brings its own damping; leave damping={self.damping!r} out."
            )

    def is_lexicographic(self, problem: Problem) -> bool:
        return self.singularity == SINGULARITIES[0] and super().is_lexicographic(problem)

    def native(self) -> _native.ClosedForm | None:
        if self.singularity != SINGULARITIES[0]:
            return None
        return _native.null_space(self.rank_tolerance, self.damping.kind, *self.damping.parameters)

    def stacked(
        self, matrix: FloatArray, rhs: FloatArray, offsets: IntArray, secondary: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        given = load(matrix, rhs, offsets)
        x = np.where(given.finite[:, None], secondary, np.nan)
        for i in np.flatnonzero(given.finite):
            Z = np.eye(matrix.shape[2])
            for k, (J, b) in enumerate(zip(given.J, given.b, strict=True)):
                size = float(given.size[i, k])
                if not size or not Z.shape[1]:
                    continue
                U, sigma, Vt = np.linalg.svd(J[i] @ Z)
                kept = int((sigma > self.rank_tolerance * size).sum())
                sigma, U, V, free = sigma[:kept], U[:, :kept], Vt[:kept].T, Vt[kept:].T
                share = np.clip((sigma / size - self.low) / (self.high - self.low), 0.0, 1.0)
                if self.singularity == "selective":
                    factor = (1.0 - share) * self.high * size
                    gain = sigma / (sigma**2 + factor**2)
                else:
                    gain = share / sigma
                    free = np.hstack((V[:, share < 1.0], free))
                x[i] += Z @ (V @ (gain * (U.T @ (b[i] - J[i] @ x[i]))))
                Z = Z @ free
        return x, np.zeros(len(matrix))
