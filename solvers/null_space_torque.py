"""Torques projected into null spaces: successive or augmented, statically, dynamically or stiffness consistent."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core.errors import SettingError, unknown_name
from hqp_rp.core.metric import checked_metric
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE, Solver, checked_secondary, require_rank_tolerance
from hqp_rp.core.variant import DAMPED, LineUp, Variant

PROJECTIONS = ("augmented", "successive")
CONSISTENCIES = ("dynamic", "static", "stiffness")
_OVERFLOW = "An intermediate result overflowed; scale the rows or the right-hand sides."


@dataclasses.dataclass(frozen=True, kw_only=True)
class NullSpaceTorque(Solver):
    """tau = sum_k N_k tau_k, tau_k = J_k^T Lambda_k b_k, and x = M^-1 tau, with M the problem's metric.

    The unknown is v-dot and level k reads J_k v-dot = b_k, as `AccelerationStack(metric="inertia")` states it;
    Lambda_k = (J_k M^-1 J_k^T)^-1 is the task's own inertia, so that each task alone would have its acceleration.
    N_k keeps lower torques out of higher tasks, with J^W+ = W^-1 J^T (J W^-1 J^T)^-1::

        N(J) = I - J^T (J^W+)^T
        projection="augmented"    N_k = N([J_1; ...; J_{k-1}])
        projection="successive"   N_k = N(J_1) N(J_2) ... N(J_{k-1})
        consistency="dynamic"     W = M: lower torques do not accelerate the first task, J_1 M^-1 N_k = 0
        consistency="static"      W = I: at rest lower torques put no force on it, but they accelerate it
        consistency="stiffness"   W = `stiffness`: so for a displacement of springs in the joints

    What holds, in exact arithmetic: dynamic consistency keeps level 1 exact, with the augmented projection every
    level also from
    those below it; the successive projection lets levels from the second on disturb one another, since N(J_1) N(J_2) is no
    projector unless the tasks are orthogonal. No variant is lexicographic: Lambda_k b_k is not corrected for what
    the projection
    takes away, nor for what higher levels do to task k. `operational_space` does both. A problem without a metric has M = I.

    Args:
        projection, consistency: as above. stiffness: K, symmetric positive definite (n, n) or (n,), for "stiffness".
        rank_tolerance: singular values of J W^(-1/2) up to this times the largest count as zero.

    Source: Dietrich, Ott and Albu-Schaeffer 2015.
    """

    projection: str = "augmented"
    consistency: str = "dynamic"
    stiffness: ArrayLike | None = dataclasses.field(default=None, compare=False)
    rank_tolerance: float = RANK_TOLERANCE

    name: ClassVar[str] = "null_space_torque"
    summary: ClassVar[str] = "torques of each task, projected into the null space of those before it"
    source: ClassVar[str] = "Dietrich, Ott and Albu-Schaeffer 2015"
    takes_metric: ClassVar[bool] = True
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant("projected torques", {}, DAMPED, "augmented, dynamically consistent: exact on level 1 alone"),
            Variant("projected torques static", {"consistency": "static"}, DAMPED, "the same, statically consistent"),
            Variant("projected torques successive", {"projection": "successive"}, DAMPED, "the same, successive"),
        ),
        place=90,
        only_with="torques",
    )

    def __post_init__(self) -> None:
        if self.projection not in PROJECTIONS:
            raise unknown_name("projection of null_space_torque", self.projection, PROJECTIONS)
        if self.consistency not in CONSISTENCIES:
            raise unknown_name("consistency of null_space_torque", self.consistency, CONSISTENCIES)
        if (self.stiffness is None) is (self.consistency == "stiffness"):
            raise SettingError('stiffness goes with consistency="stiffness", and only with it; give both or neither.')
        require_rank_tolerance(self.rank_tolerance)

    def refuses(self, problem: Problem) -> str | None:
        """A stiffness of another size; hard and two-sided rows."""
        if self.stiffness is not None and len(np.asarray(self.stiffness)) != problem.n:
            return f"stiffness is for {len(np.asarray(self.stiffness))} unknowns and the problem has {problem.n}."
        return super().refuses(problem)

    def is_lexicographic(self, problem: Problem) -> bool:
        """True for one level without rank loss at most, which only its numbers can tell: False."""
        return False

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """The acceleration of the projected torques; `secondary` (n,) is one more, lowest, acceleration. See `Solver.solve`."""
        refusal = self._refusal(problem)
        if refusal is not None:
            return refusal
        free = checked_secondary(secondary, problem.n)
        n = problem.n
        M = np.eye(n) if problem.metric is None else problem.metric
        with np.errstate(all="ignore"):
            try:
                x = np.asarray(np.linalg.solve(M, self._torque(problem, M, free)), dtype=np.float64)
            except np.linalg.LinAlgError:
                x = np.full(n, np.nan)
        if not np.isfinite(x).all():
            return Solution(problem, None, Status.NOT_FINITE, 0, _OVERFLOW, secondary)
        solution = Solution(problem, x, Status.SOLVED, 0, "", secondary)
        solution.held = np.zeros(problem.rows, np.int8)
        return solution

    def _torque(self, problem: Problem, M: FloatArray, free: FloatArray | None) -> FloatArray:
        n = problem.n
        if self.consistency == "dynamic":
            W = M
        elif self.consistency == "static":
            W = np.eye(n)
        else:
            assert self.stiffness is not None
            W = checked_metric(self.stiffness, n)
        tau, N, above = np.zeros(n), np.eye(n), np.zeros((0, n))
        for level in problem.levels:
            if not level.m:
                continue
            J = level.A
            # J^T Lambda b = M J^M+ b
            tau = tau + N @ (M @ (self._inverse(J, M) @ level.lower))
            if self.projection == "successive":
                N = N @ (np.eye(n) - J.T @ self._inverse(J, W).T)
            else:
                above = np.vstack((above, J))
                N = np.eye(n) - above.T @ self._inverse(above, W).T
        return tau if free is None else tau + N @ (M @ free)

    def _inverse(self, J: FloatArray, W: FloatArray) -> FloatArray:
        """J^W+ (n, m)."""
        R = np.linalg.cholesky(W).T
        turned = np.linalg.solve(R.T, J.T).T
        return np.asarray(np.linalg.solve(R, np.linalg.pinv(turned, rcond=self.rank_tolerance)), dtype=np.float64)
