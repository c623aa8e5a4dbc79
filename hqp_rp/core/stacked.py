"""Pseudo-inverses of many matrices at once, by singular values: what the studied closed forms are written in.

Arrays stand stacked: A (N, m, n) are N matrices. The rank rule and the damping policies are those of the native core.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.damping import (
    ConstantDamping,
    Damping,
    ManipulabilityDamping,
    NumericalFiltering,
    Truncation,
    VariableDamping,
)
from hqp_rp.core.problem import FloatArray, IntArray

_LARGEST_RATIO = 2.0**50  # levels further apart in size than this weigh as this: the difference is below rounding error


class Loaded(NamedTuple):
    """Levels scaled by powers of two, which rounds nothing, so that squares of their numbers do not overflow.

    Attributes:
        J: the rows of each level, (N, m_k, n), largest entry in [1/2, 1). b: (N, m_k). scale: (N, p), what a level was
            multiplied by.
        size: (N, p), ||J_k||_2.
        finite: (N,), whether every number of a problem is finite; the others are replaced by zeros.
    """

    J: list[FloatArray]
    b: list[FloatArray]
    scale: FloatArray
    size: FloatArray
    finite: NDArray[np.bool_]

    def weights(self, k: int) -> FloatArray:
        """(N, rows of levels k ... p - 1): loaded row times weight is proportional to the row as it was given."""
        rows = [J.shape[1] for J in self.J[k:]]
        unit = self.scale[:, k:].min(axis=1, keepdims=True)
        return np.repeat(np.maximum(unit / self.scale[:, k:], 1.0 / _LARGEST_RATIO), rows, axis=1)

    def unit(self, k: int) -> FloatArray:
        """(N,) what the largest of levels k ... p - 1 was multiplied by: the unit of weighted rows."""
        least: FloatArray = self.scale[:, k:].min(axis=1)
        return least


def load(matrix: FloatArray, rhs: FloatArray, offsets: IntArray) -> Loaded:
    """`Loaded` from (N, M, n), (N, M) and offsets (p + 1,)."""
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(rhs).all(axis=1))
    matrix = np.where(finite[:, None, None], matrix, 0.0)
    rhs = np.where(finite[:, None], rhs, 0.0)
    J, b, scales, sizes = [], [], [], []
    for start, end in itertools.pairwise(offsets.tolist()):
        level = matrix[:, start:end]
        largest = np.abs(level).max(axis=(1, 2), initial=0.0)
        exponent = np.where(largest > 0.0, np.clip(np.frexp(largest)[1], -1000, 1000), 0)
        scale = np.ldexp(1.0, -exponent)
        J.append(level * scale[:, None, None])
        with np.errstate(over="ignore"):
            b.append(rhs[:, start:end] * scale[:, None])
        finite &= np.isfinite(b[-1]).all(axis=1)
        scales.append(scale)
        sizes.append(two_norms(J[-1]))
    b = [np.where(finite[:, None], right, 0.0) for right in b]
    return Loaded(J, b, np.stack(scales, axis=1), np.stack(sizes, axis=1), finite)


def two_norms(A: FloatArray) -> FloatArray:
    """(N,) ||A||_2 of every matrix."""
    if min(A.shape[1:]) == 0:
        return np.zeros(len(A))
    norms: FloatArray = np.asarray(np.linalg.svd(A, compute_uv=False)[:, 0], dtype=np.float64)
    return norms


def damping_factors(sigma: NDArray[np.floating[Any]], damping: Damping, unit: FloatArray, full: bool) -> FloatArray:
    """(N, 1) eta of sigma / (sigma^2 + eta^2) for singular values (N, r), falling; of filtering that of the last one.

    unit: (N,) what the matrices were multiplied by: a policy's numbers are in the given rows' unit. full: whether all
    singular values are there, so that the last one is sigma_m of (19).
    """
    scale = unit[:, None]
    first, second = damping.parameters
    kind = damping.kind
    if kind == ConstantDamping.kind:
        return first * scale
    if kind in (VariableDamping.kind, NumericalFiltering.kind):
        ratio = (sigma[:, -1:] if full and sigma.shape[1] else np.zeros_like(scale)) / (first * scale)
        damped = np.sqrt(np.maximum((1.0 - ratio) * (1.0 + ratio), 0.0)) * second * scale
        return np.where(ratio >= 1.0, 0.0, damped)
    if kind == ManipulabilityDamping.kind:
        with np.errstate(over="ignore"):
            w = np.prod(sigma / scale, axis=1, keepdims=True) if full else np.zeros_like(scale)
        return np.where(w >= first, 0.0, np.maximum(1.0 - w / first, 0.0) * second * scale)
    return np.zeros_like(scale)


def damped_inverses(sigma: FloatArray, zero: FloatArray, damping: Damping, unit: FloatArray, full: bool) -> FloatArray:
    """What the policy puts for 1 / sigma (N, r), falling; 0 for sigma <= zero (N,). Equations (15), (17), (18)-(19).

    unit, full: as of `damping_factors`.
    """
    cut = sigma > zero[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        if damping.kind == Truncation.kind:
            return np.where(cut & (sigma > damping.parameters[0] * unit[:, None]), 1.0 / sigma, 0.0)
        factor = damping_factors(sigma, damping, unit, full)
        if damping.kind == NumericalFiltering.kind and sigma.shape[1]:
            factor = np.where(np.arange(sigma.shape[1]) == sigma.shape[1] - 1, factor, 0.0)
        # sigma / (sigma^2 + factor^2) without squaring a large number.
        above, below = factor / sigma, sigma / factor
        damped = np.where(sigma > factor, 1.0 / (sigma * (1.0 + above**2)), below / (factor * (1.0 + below**2)))
        return np.where(cut | (factor > 0.0), damped, 0.0)


def pinv_times(
    J: FloatArray, t: FloatArray, zero: FloatArray, damping: Damping, unit: FloatArray | None = None
) -> FloatArray:
    """J^# t (N, n) for J (N, m, n), t (N, m), from the factors: the residual is smaller than with J^# formed first."""
    if min(J.shape[1:]) == 0:
        return np.zeros((len(J), J.shape[2]))
    U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
    inverse = damped_inverses(sigma, zero, damping, np.ones(len(J)) if unit is None else unit, True)
    y = inverse * np.einsum("nmr,nm->nr", U, t)
    found: FloatArray = np.einsum("nrj,nr->nj", Vt, y)
    return found


def pinv(J: FloatArray, zero: FloatArray, damping: Damping, unit: FloatArray | None = None) -> FloatArray:
    """J^# (N, n, m) of every matrix."""
    if min(J.shape[1:]) == 0:
        return np.zeros((len(J), J.shape[2], J.shape[1]))
    U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
    inverse = damped_inverses(sigma, zero, damping, np.ones(len(J)) if unit is None else unit, True)
    found: FloatArray = np.swapaxes(Vt, 1, 2) @ (inverse[:, :, None] * np.swapaxes(U, 1, 2))
    return found


def by_rank(
    A: FloatArray, zero: FloatArray, which: IntArray
) -> Iterator[tuple[IntArray, int, FloatArray, FloatArray, FloatArray]]:
    """Groups of matrices of one rank: (their numbers among `which`, rank, U, sigma, Vt with the full Vt).

    A singular value counts as zero when it is <= zero (N,).
    """
    U, sigma, Vt = np.linalg.svd(A, full_matrices=True)
    ranks = (sigma > zero[:, None]).sum(axis=1)
    for rank in np.unique(ranks):
        own = np.flatnonzero(ranks == rank)
        yield which[own], int(rank), U[own], sigma[own], Vt[own]


def range_projector(T: FloatArray) -> FloatArray:
    """T T^+ (N, n, n), from the left singular vectors of T (N, n, d) whose singular values are above 1e-12 of the largest."""
    U, sigma, _ = np.linalg.svd(T, full_matrices=False)
    Q = U * (sigma > 1e-12 * sigma[:, :1])[:, None, :]
    projector: FloatArray = Q @ np.swapaxes(Q, 1, 2)
    return projector
