"""What allowed moves could remove from a level's residual, in double precision on orthonormal bases."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.diagnostics import norm, two_norm
from hqp_rp.core.nonnegative import nonnegative_least_squares
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.tolerances import BAND, FAR_TARGETS, MULTIPLIER, SHORT_NORMAL, STEP_COST, UNEVEN

_EPS = float(np.finfo(np.float64).eps)


class Removable(NamedTuple):
    """The removable part of a residual, what rounding may contribute to it, and the multipliers (h,) of the normals.

    rows: those it is a part of, where they are not all; scale: then their `||A|| ||x||` plus the length of their targets.
    """

    excess: float
    uncertainty: float
    multipliers: FloatArray
    rows: NDArray[np.bool_] | slice = slice(None)
    scale: float = 0.0

    @property
    def positive(self) -> int:
        """How many normals hold the level back."""
        return int((self.multipliers > MULTIPLIER * self.multipliers.max(initial=0.0)).sum())


class JudgedRows(Protocol):
    """Rows A (m, n) of one level at x: lengths ||a_i||, targets (the nearest points of their bounds), violations v.

    equality, violated: bands of no width, and rows beyond their bounds by more than the tolerance, `near` (m,).
    active: rows within it of a bound, `normals` (m, n) outward and of length one there. size: ||A||_2.
    """

    A: FloatArray
    lengths: FloatArray
    target: FloatArray
    violation: FloatArray
    equality: NDArray[np.bool_]
    violated: NDArray[np.bool_]
    active: NDArray[np.bool_]
    near: FloatArray
    normals: FloatArray
    size: float


def removable(
    A: FloatArray, v: FloatArray, Z: FloatArray, H: FloatArray, size: float, cut: float, drift: float
) -> Removable:
    """The part of v that moves d = Z z with H d <= 0 remove through A d.

    Without H it is the projection of v onto range(A Z). With H it is the same for the cone, where each move also costs
    `STEP_COST * size * ||d||`: that keeps the metric finite in directions that A does not see. Singular values of A Z up to
    `cut` do not count.
    """
    multipliers = np.zeros(len(H))
    if min(A.shape) == 0 or Z.shape[1] == 0 or size == 0.0 or not v.any():
        return Removable(0.0, 0.0, multipliers)
    U, sigma, Vt = np.linalg.svd(A @ Z)
    normals = H @ Z @ Vt.T if len(H) else H
    noise = drift + 8 * _EPS
    unclear, felt = normals[:0], np.zeros(len(H), dtype=bool)
    if len(H):
        lengths = np.sqrt(np.einsum("ij,ij->i", normals, normals))
        unclear = normals[(lengths <= SHORT_NORMAL) & (lengths > 2.0 * noise)]
        felt = lengths > SHORT_NORMAL  # the others are fixed already
        normals = normals[felt]
    if not len(normals):
        rank = int((sigma > cut).sum())
        if rank == 0:
            return Removable(0.0, 0.0, multipliers)
        excess, unsure = norm(U[:, :rank].T @ v), norm(v) * min(1.0, noise * size / float(sigma[rank - 1]))
        if len(unclear):
            unsure += max(0.0, excess - _held(sigma, U, v, unclear, Z.shape[1], size)[0])
        return Removable(excess, unsure, multipliers)
    excess, pulls, multipliers[felt] = _held(sigma, U, v, normals, Z.shape[1], size)
    unsure = min(norm(v), pulls * noise / STEP_COST)
    if len(unclear):
        unsure += max(0.0, excess - _held(sigma, U, v, np.vstack((normals, unclear)), Z.shape[1], size)[0])
    return Removable(excess, unsure, multipliers)


def _held(
    sigma: FloatArray, U: FloatArray, v: FloatArray, normals: FloatArray, d: int, size: float
) -> tuple[float, float, FloatArray]:
    """What moves that the normals (h, d) allow remove; what v and the multipliers pull; the multipliers (h,)."""
    padded = np.zeros(d)
    padded[: len(sigma)] = sigma
    metric = 1.0 / np.hypot(padded, STEP_COST * size)
    slope = np.zeros(d)
    slope[: len(sigma)] = sigma * (U.T @ v)[: len(sigma)]
    columns = (normals * metric).T
    lengths = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    weights, rest = nonnegative_least_squares(columns / lengths, -metric * slope)
    multipliers = weights / lengths
    pulls = norm(v) + float(multipliers.sum()) / size
    return norm(rest), pulls, multipliers


class Part(NamedTuple):
    """Rows (m,) of a level that are judged by themselves; by_reach: since they reach less far, not since they are shorter."""

    rows: NDArray[np.bool_]
    by_reach: bool


def smaller_parts(lengths: FloatArray, reach: FloatArray, own: int | None = None) -> list[Part]:
    """The parts of a level that are judged by themselves beside the whole.

    They hold the rows no longer than a tenth, a hundredth, ... of the longest, where lengths (m,) differ by more than `UNEVEN`,
    and the rows of no larger reach than that, where reaches `||a_i|| ||x|| + |bound_i|` (m,) do by `FAR_TARGETS`. own: only the
    first so many rows are told apart; those behind them, damping rows, belong to every part.
    """
    parts: list[Part] = []
    behind = np.ones(0 if own is None else len(lengths) - own, dtype=bool)
    for key, spread in ((lengths[:own], UNEVEN), (reach[:own], FAR_TARGETS)):
        counts = key > 0.0
        if counts.any() and float(key.max()) > spread * float(key[counts].min()):
            parts.extend(Part(np.concatenate((rows, behind)), spread == FAR_TARGETS) for rows in _below(key, counts))
    return parts


def _below(key: FloatArray, counts: NDArray[np.bool_]) -> Iterator[NDArray[np.bool_]]:
    limit, last = float(key.max()), int(counts.sum())
    for _ in range(32):
        limit *= BAND
        part = counts & (key <= limit)
        if not part.any():
            return
        if int(part.sum()) < last:
            last = int(part.sum())
            yield part


def removable_in_part(
    rows: JudgedRows,
    part: NDArray[np.bool_],
    by_reach: bool,
    Z: FloatArray,
    H: FloatArray,
    x_size: float,
    rank_tolerance: float,
    drift: float,
) -> Removable:
    """`removable` of some rows of a level by moves that the others do not feel, in the size of these rows.

    Rows of very different size weigh so differently that the norm of the whole level does not show the small ones. Of the
    others, equalities and violated rows stay where they are, and rows at their bound do not go beyond it. Of these, a row at
    its bound pulls back with no more than the violation that the tolerance hides there.

    What the others feel of these moves all the same, since the rank rule takes them for unfelt, is uncertain by what the
    others pull; where rows are alike but for what they ask for, `by_reach`, so is what rounding makes them feel.
    """
    moves = rows.equality | rows.violated
    felt = 0.0
    others = ~part
    fixed = others & moves & (rows.lengths > 0.0)
    if fixed.any() and Z.shape[1]:
        sigma, Vt = np.linalg.svd((rows.A[fixed] / rows.lengths[fixed, None]) @ Z)[1:]
        rank = int((sigma > rank_tolerance).sum())
        felt = float(sigma[rank:].max(initial=0.0))
        if rank:
            amplified = 1.0 / float(sigma[rank - 1])
            drift = min(1.0, drift * (1.0 + amplified) + 8 * _EPS * amplified)
            Z = Z @ Vt[rank:].T
    H = np.vstack((H, rows.normals[others & rows.active & ~moves]))
    pulls = part & moves
    v = np.where(moves, rows.violation, 0.0)
    bounded = part & rows.active & ~moves
    size = two_norm(rows.A[part])
    scale = size * x_size + norm(rows.target[part])
    cut = rank_tolerance * rows.size
    while True:
        own = np.flatnonzero(bounded)
        found = removable(rows.A[pulls], v[pulls], Z, np.vstack((H, rows.normals[own])), size, cut, drift)
        over = own[found.multipliers[len(H) :] > rows.near[own] * rows.lengths[own]]
        if not len(over):
            felt = (felt if felt > 16 * _EPS else 0.0) + (drift + 8 * _EPS if by_reach else 0.0)
            unsure = found.uncertainty + felt * _pull_over_part(rows, fixed, pulls, Z, cut)
            return found._replace(multipliers=found.multipliers[: len(H)], rows=part, scale=scale, uncertainty=unsure)
        bounded[over] = False
        pulls[over] = True
        v[over] = rows.near[over] * np.sign(np.einsum("ij,ij->i", rows.normals[over], rows.A[over]))


def _pull_over_part(
    rows: JudgedRows, others: NDArray[np.bool_], pulls: NDArray[np.bool_], Z: FloatArray, cut: float
) -> float:
    """By how much a move Z z of which the others feel all could move the residual of the part, to lessen theirs."""
    pull = float(np.abs(rows.violation[others]) @ rows.lengths[others])
    if pull == 0.0 or not pulls.any() or not Z.shape[1]:
        return 0.0
    sigma = np.linalg.svd(rows.A[pulls] @ Z, compute_uv=False)
    return pull / float(sigma[sigma > cut].min(initial=np.inf))
