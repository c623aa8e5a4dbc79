"""J-PARSE (Guptasarma, Strong, Zhen and Kennedy 2025): singular directions projected and scaled, level by level."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar

import numpy as np

from hqp_rp.core.errors import SettingError
from hqp_rp.core.level_by_level import LevelByLevel, Svd, require_positive
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.variant import BOUNDED, LineUp, Variant


def jparse_inverse(J: FloatArray, gamma: float, gain: float = 1.0) -> FloatArray:
    """J_s^+ (J_p J_p^+ + U_s Phi U_s^T K) (n, m), as the paper composes it from matrices.

    J_s, the safety Jacobian: singular values below gamma sigma_max raised to that. J_p, the projection Jacobian: those left
    out. U_s their left singular vectors, Phi = diag(sigma_i / (gamma sigma_max)), K = gain.
    """
    U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
    floor = gamma * sigma[0]
    large = sigma > floor
    safety = U @ np.diag(np.maximum(sigma, floor)) @ Vt
    projection = U[:, large] @ np.diag(sigma[large]) @ Vt[large]
    Phi = np.diag(sigma[~large] / floor)
    task = projection @ np.linalg.pinv(projection) + gain * U[:, ~large] @ Phi @ U[:, ~large].T
    inverse: FloatArray = np.linalg.pinv(safety) @ task
    return inverse


@dataclasses.dataclass(frozen=True, kw_only=True)
class JParse(LevelByLevel):
    """A level's command along singular directions is scaled down, and inverted by singular values held away from zero.

    ::

        x_k = x_{k-1} + sum_i v_i f(sigma_i) u_i^T (b_k - A_k x_{k-1})
        f(sigma) = 1 / sigma                          where sigma > gamma sigma_max
                 = gain sigma / (gamma sigma_max)^2   elsewhere

    which is `J_s^+ (J_p J_p^+ + U_s Phi U_s^T K)` of the paper in singular vectors: the safety Jacobian J_s, the projection
    Jacobian J_p, Phi = sigma_i / (gamma sigma_max). With gain = 1 it is continuous; |f| <= 1 / (gamma sigma_max).
    sigma_max is that of A_k itself and not of what the levels above leave of it, so that a level of which little is left
    stays small. Singular values, like all that mixes metres and radians, depend on units.

    The method was published for one level; the levels below act in its null space: that is ours.

    Args:
        gamma: in (0, 1), the threshold on sigma / sigma_max.
        gain: >= 0, K, one number for all rows (the paper: one for position, one for orientation). 0 stops in singular
            directions.

    Source: arXiv 2505.00306; the formula agrees with the authors' published code.
    """

    gamma: float = 0.1
    gain: float = 1.0

    name: ClassVar[str] = "jparse"
    summary: ClassVar[str] = "singular directions scaled down and inverted by singular values held away from zero"
    source: ClassVar[str] = "Guptasarma, Strong, Zhen and Kennedy 2025"
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant(
                "J-PARSE", {}, BOUNDED, "singular directions scaled, singular values held above a tenth of the largest"
            ),
        ),
        place=30,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive("gamma", self.gamma, below=1.0)
        gain = self.gain
        if isinstance(gain, bool) or not isinstance(gain, int | float) or not 0.0 <= gain < math.inf:
            raise SettingError(f"gain is {gain!r}; it must be a finite number >= 0.")

    def step(self, A: FloatArray, e: FloatArray, Z: FloatArray, svd: Svd, size: float) -> FloatArray:
        floor = self.gamma * size
        scaled = self.gain * svd.sigma / floor / floor
        inverse = np.where(svd.sigma > floor, 1.0 / svd.sigma, scaled)
        step: FloatArray = svd.V @ (inverse * (svd.U.T @ e))
        return step
