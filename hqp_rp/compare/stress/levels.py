"""What judges the levels of many equality problems: ranges, sizes and singular values, and the optimum in double precision.

All problems of a chunk are factored together; one that is rank-deficient by the library's rule is done again by itself, since
its null spaces are of another size.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from hqp_rp.core.diagnostics import norm, two_norm
from hqp_rp.core.distance import orthogonal_cascade
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solver import RANK_TOLERANCE

_EPS = float(np.finfo(np.float64).eps)


@dataclasses.dataclass(frozen=True, slots=True)
class LevelScale:
    """One level of C equality problems, with Z an orthonormal basis of the null space of the levels before it.

    Attributes:
        range: (C, m, m) orthonormal basis of range(A_k Z) by the library's rank rule, filled up with columns of 0.
        noise: (C,) what rounding may have turned that range by, in [0, 1].
        size: (C,) ||A_k||_2. target: (C,) ||b_k||_2.
        sigma: (C,) the min(m, d)-th singular value of A_k Z over ||A_k||_2; inf where the level has more rows than freedom.
    """

    range: FloatArray
    noise: FloatArray
    size: FloatArray
    target: FloatArray
    sigma: FloatArray


def level_scales(problems: Sequence[Problem]) -> tuple[tuple[LevelScale, ...], FloatArray, FloatArray]:
    """A `LevelScale` for each level of problems of one shape; the optima (C, n) and estimates (C,) of their errors.

    Optimum and estimate are those of `orthogonal_cascade` with the library's rank rule and no free vector. The estimate of
    the noise is the certificate's.
    """
    A, b = _stacked(problems)
    count, _, n = A.shape
    Z = np.broadcast_to(np.eye(n), (count, n, n))
    x, drift, growth = np.zeros((count, n)), np.full(count, 8.0 * _EPS), np.full(count, 8.0 * n * _EPS)
    full = np.ones(count, dtype=bool)
    found = []
    offsets = problems[0].offsets.tolist()
    with np.errstate(all="ignore"):
        for first, last in itertools.pairwise(offsets):
            A_k, b_k, m, d = A[:, first:last], b[:, first:last], last - first, Z.shape[2]
            r = min(m, d)
            size, target = _spectral_norm(A_k), np.linalg.norm(b_k, axis=1)
            scale = LevelScale(np.zeros((count, m, m)), np.zeros(count), size, target, np.full(count, np.inf))
            found.append(scale)
            if r == 0:
                continue
            U, values, Vt = np.linalg.svd(A_k @ Z)
            least = values[:, r - 1]
            full &= (least > RANK_TOLERANCE * size) & (size > 0.0)
            amplified = size / least
            scale.range[:, :, :r] = U[:, :, :r]
            scale.noise[:] = np.minimum(1.0, (drift + 8.0 * _EPS) * amplified)
            if m <= d:
                scale.sigma[:] = least / size
            drift = np.minimum(1.0, drift * (1.0 + amplified) + 8.0 * _EPS * amplified)
            growth[least <= 1e-6 * size] = np.inf
            step = _times(U[:, :, :r].transpose(0, 2, 1), b_k - _times(A_k, x)) / values[:, :r]
            x = x + _times(Z, _times(Vt[:, :r].transpose(0, 2, 1), step))
            Z = Z @ Vt[:, r:].transpose(0, 2, 1)
            growth *= 1.0 + amplified
            left = np.linalg.norm(_times(A_k, x) - b_k, axis=1)
            unmet = left > 1e-12 * (size * np.linalg.norm(x, axis=1) + target)
            growth[unmet] *= 1.0 + amplified[unmet]
        x = x - _times(Z, _times(Z.transpose(0, 2, 1), x))
    for i in np.flatnonzero(~full).tolist():
        _one_by_one(problems[i], i, found)
        with np.errstate(all="ignore"):
            x[i], growth[i] = orthogonal_cascade(problems[i], np.zeros(n), RANK_TOLERANCE)
    return tuple(found), x, growth


def level_errors(problems: Sequence[Problem], scales: Sequence[LevelScale], x: FloatArray) -> FloatArray:
    """(C, p) `||P v|| - noise ||v||` over `||A_k|| ||x|| + ||b_k||`, at least 0, nan where there is no answer.

    v is the residual of the level at x (C, n), P the projector onto `LevelScale.range`.
    """
    A, b = _stacked(problems)
    size = np.linalg.norm(x, axis=1)
    errors = np.full((len(x), len(scales)), np.nan)
    answered = np.isfinite(size)
    offsets = problems[0].offsets.tolist()
    with np.errstate(all="ignore"):
        rest = _times(A, x) - b
        for k, scale in enumerate(scales):
            v = rest[:, offsets[k] : offsets[k + 1]]
            removable = np.linalg.norm(_times(scale.range.transpose(0, 2, 1), v), axis=1)
            proven = removable - scale.noise * np.linalg.norm(v, axis=1)
            relative = np.where(proven > 0.0, proven / (scale.size * size + scale.target), 0.0)
            errors[answered, k] = relative[answered]
    return errors


def _one_by_one(problem: Problem, i: int, scales: Sequence[LevelScale]) -> None:
    """Fill entry i of each level's scale for one problem."""
    Z, drift = np.eye(problem.n), 8.0 * _EPS
    for level, scale in zip(problem.levels, scales, strict=True):
        size = two_norm(level.A)
        U, values, Vt = np.linalg.svd(level.A @ Z)
        rank = int((values > RANK_TOLERANCE * size).sum()) if size else 0
        fits = 0 < level.m <= Z.shape[1]
        scale.size[i], scale.target[i] = size, norm(level.lower)
        scale.sigma[i] = (float(values[-1]) / size if size else 0.0) if fits else np.inf
        scale.range[i] = 0.0
        scale.range[i, :, :rank] = U[:, :rank]
        scale.noise[i] = 0.0
        if rank:
            amplified = size / float(values[rank - 1])
            scale.noise[i] = min(1.0, (drift + 8.0 * _EPS) * amplified)
            drift = min(1.0, drift * (1.0 + amplified) + 8.0 * _EPS * amplified)
        Z = Z @ Vt[rank:].T


def _stacked(problems: Sequence[Problem]) -> tuple[FloatArray, FloatArray]:
    """A (C, M, n) and b (C, M)."""
    return np.stack([problem.matrix for problem in problems]), np.stack([problem.lower for problem in problems])


def _spectral_norm(A: FloatArray) -> FloatArray:
    """(C,) ||A||_2 of A (C, m, n)."""
    return np.asarray(np.linalg.svd(A, compute_uv=False)[:, 0], dtype=np.float64) if A.shape[1] else np.zeros(len(A))


def _times(A: FloatArray, x: FloatArray) -> FloatArray:
    """(C, m) A x, problem by problem."""
    return np.asarray((A @ x[:, :, None])[:, :, 0], dtype=np.float64)
