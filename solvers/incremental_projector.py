"""Task priority with an incremental projector and damping by the bound on each level's step (Baerlocher and Boulic 2004)."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar

import numpy as np

from hqp_rp.core.level_by_level import LevelByLevel, Svd, require_positive
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.variant import BOUNDED, LineUp, Variant


def baerlocher_boulic(J: list[FloatArray], b: list[FloatArray], largest_step: float) -> FloatArray:
    """x <- x + (J_k P_{k-1})^{+lambda_k} (b_k - J_k x), P_k = P_{k-1} - (J_k P_{k-1})^+ (J_k P_{k-1}), P_0 = I.

    lambda_k by `damping_factor`. J_k (m_k, n), b_k (m_k,). For matrices of which the projector is regular enough.
    """
    n = J[0].shape[1]
    x, P = np.zeros(n), np.eye(n)
    for J_k, b_k in zip(J, b, strict=True):
        projected, e = J_k @ P, b_k - J_k @ x
        U, sigma, Vt = np.linalg.svd(projected, full_matrices=False)
        kept = sigma > 1e-10
        if kept.any():
            lam = damping_factor(float(sigma[kept][-1]), float(np.linalg.norm(e)), largest_step)
            inverse = sigma[kept] / (sigma[kept] ** 2 + lam**2)
            x = x + Vt[kept].T @ (inverse * (U[:, kept].T @ e))
        P = P - np.linalg.pinv(projected, rcond=1e-10) @ projected
    return x


def damping_factor(smallest: float, error: float, largest_step: float) -> float:
    """lambda >= 0 with which a damped step on an error of that norm is at most `largest_step` long.

    ::

        d = error / largest_step
        lambda = d / 2                             where sigma <= d / 2
               = sqrt(sigma (d - sigma))           where d / 2 <= sigma <= d
               = 0                                 where d <= sigma,    sigma the smallest singular value that is not zero

    since sigma / (sigma^2 + lambda^2) is at most 1 / d for the smallest, and is largest, 1 / (2 lambda), at sigma = lambda.
    """
    d = error / largest_step
    if smallest <= 0.5 * d:
        return 0.5 * d
    return math.sqrt(smallest * (d - smallest)) if smallest < d else 0.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class IncrementalProjector(LevelByLevel):
    """x_k = x_{k-1} + (A_k P_{k-1})^{+lambda_k} (b_k - A_k x_{k-1}), each level's lambda_k just enough to bound its step.

    P_k = P_{k-1} - (A_k P_{k-1})^+ (A_k P_{k-1}): the projector on the null space of all levels so far is updated and never
    built anew, and damping is not in it. Here it stands as an orthonormal basis, which is the same and keeps its
    precision. lambda_k is 0 where the undamped step is bounded anyway (see `damping_factor`), so that with a large enough
    bound this is `null_space`, and with any bound ||x|| <= p * largest_step for p levels.

    Args:
        largest_step: b_max > 0, in the unit of x: no level's step is longer.

    Source: Baerlocher and Boulic 2004, with the damping factor of Maciejewski and Klein 1988. Neither text was at hand: the
        bound is proved in `damping_factor` and the tests.
    """

    largest_step: float = 1.0

    name: ClassVar[str] = "incremental_projector"
    summary: ClassVar[str] = "null-space priority, each level damped just enough to bound its step"
    source: ClassVar[str] = "Baerlocher and Boulic 2004"
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant(
                "incremental projector",
                {"largest_step": 3.0},
                BOUNDED,
                "Baerlocher and Boulic: no level's step longer than the arm's own 3 rad/s",
            ),
        ),
        place=40,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive("largest_step", self.largest_step)

    def step(self, A: FloatArray, e: FloatArray, Z: FloatArray, svd: Svd, size: float) -> FloatArray:
        along = svd.U.T @ e
        lam = damping_factor(float(svd.sigma[-1]), float(np.linalg.norm(along)), self.largest_step)
        ratio = lam / svd.sigma
        step: FloatArray = svd.V @ (along / (svd.sigma * (1.0 + ratio**2)))
        return step
