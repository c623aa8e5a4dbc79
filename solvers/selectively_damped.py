"""Selectively damped least squares (Buss and Kim 2005), level by level."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar

import numpy as np

from hqp_rp.core.level_by_level import LevelByLevel, Svd, require_positive
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.variant import BOUNDED, LineUp, Variant


def buss_kim(J: FloatArray, e: FloatArray, gamma_max: float) -> FloatArray:
    """The update of Buss and Kim 2005, section 4, for one end effector: J (m, n), e (m,).

    ::

        theta = clamp(sum_i clamp(v_i u_i^T e / sigma_i, gamma_i), gamma_max)
        gamma_i = gamma_max min(1, N_i / M_i),   N_i = |u_i|,   M_i = sum_l |v_i,l| |J_l| / sigma_i

    J_l the l-th column of J; clamp(w, g) scales w so that no component is greater than g.
    """
    U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
    kept = sigma > 1e-12 * sigma[0]
    return _update(U[:, kept], sigma[kept], Vt[kept].T, np.linalg.norm(J, axis=0), e, gamma_max)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SelectivelyDamped(LevelByLevel):
    """Each singular direction is damped by as much as it moves the joints in vain; no component passes gamma_max.

    ::

        x_k = x_{k-1} + clamp(sum_i clamp(v_i u_i^T e_k / sigma_i, gamma_i), gamma_max),   e_k = b_k - A_k x_{k-1}
        gamma_i = gamma_max min(1, N_i / M_i),   N_i = |u_i|,   M_i = sum_l |v_i,l| |A_k,l| / sigma_i

    u_i, sigma_i, v_i of A_k restricted to the freedom left, v_i as directions of x; A_k,l the l-th column of A_k; clamp(w, g)
    scales w so that no |component| is greater than g. N_i / M_i is how much of what the joints do along v_i shows in the
    task. So x is bounded by gamma_max for each level, whatever the singular values, and exact where targets are small.

    The method was published for one level of positions of end effectors; a level here counts as one end effector, and the
    levels below act in its null space, which damping does not change: that is ours.

    Args:
        gamma_max: > 0, in the unit of x: the largest change of one joint. The authors' pi/4 is per step of an iteration, where
            targets are displacements; for velocities it is rad/s.

    Source: Buss and Kim 2005; the formulas agree with the authors' published code.
    """

    gamma_max: float = math.pi / 4.0

    name: ClassVar[str] = "selectively_damped"
    summary: ClassVar[str] = (
        "each singular direction clamped by what it moves in vain; bounded, inexact for large targets"
    )
    source: ClassVar[str] = "Buss and Kim 2005"
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant(
                "selectively damped",
                {"gamma_max": 3.0},
                BOUNDED,
                "Buss and Kim: each singular direction clamped, at most the arm's own 3 rad/s for each level",
            ),
        ),
        place=20,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive("gamma_max", self.gamma_max)

    def step(self, A: FloatArray, e: FloatArray, Z: FloatArray, svd: Svd, size: float) -> FloatArray:
        return _update(svd.U, svd.sigma, svd.V, np.linalg.norm(A, axis=0), e, self.gamma_max)


def _update(
    U: FloatArray, sigma: FloatArray, V: FloatArray, columns: FloatArray, e: FloatArray, gamma_max: float
) -> FloatArray:
    M = columns @ np.abs(V) / sigma
    gamma = gamma_max * np.minimum(1.0, 1.0 / M)  # |u_i| = 1
    parts = V * (U.T @ e / sigma)
    largest = np.abs(parts).max(axis=0)
    over = largest > gamma
    parts = np.where(over, parts * (gamma / np.where(over, largest, 1.0)), parts)
    total: FloatArray = parts.sum(axis=1)
    most = float(np.abs(total).max())
    return total * (gamma_max / most) if most > gamma_max else total
