"""Proof of how far an answer is from the lexicographic optimum, level by level, from (problem, x) alone.

No solver and no truth is consulted: each level's excess is what could still be removed from its residual by a move that
all earlier levels and the hard rows allow, in double precision on orthonormal bases.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hqp_rp.core.diagnostics import (
    checked_point,
    norm,
    normalised,
    one_sided,
    remaining,
    require_tolerance,
    row_norms,
    times_power,
    two_norm,
)
from hqp_rp.core.level_damping import damped_level
from hqp_rp.core.metric import symmetric_root, with_inverse
from hqp_rp.core.nearest_point import nearest_point
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.removable import Part, Removable, removable, removable_in_part, smaller_parts
from hqp_rp.core.rounding import rounding_at_zero
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.tolerances import CERTIFIED, NEAR_ZERO, NEARLY_FREE, REACHED, UNEVEN

TOLERANCE = CERTIFIED
"""Default of `certify`: what a relative excess may be; also how near to its bound a row counts as active."""

PROXIMAL_STEPS = 3
"""How often a search over directions that are not damped goes on from where it came to."""

_EPS = float(np.finfo(np.float64).eps)


@dataclasses.dataclass(frozen=True, slots=True)
class LevelCertificate:
    """One level at x.

    Attributes:
        name: the level's name.
        residual: ||v||_2 of the violation v at x, in the unit of the rows.
        excess: the part of it that could be removed without spoiling an earlier level, in the same unit (see `certify`).
        scale: ||A_k||_2 ||x|| + ||b_k||, where b_k is the point of [lower, upper] nearest to A_k x; where a part of the
            level is judged worse than the whole (see `certify`), that of its rows, and `excess` and `uncertainty` are its own.
        uncertainty: what rounding may contribute to `excess`, same unit; grows with the condition of the levels so far.
        multipliers: number of inequality rows of earlier levels, or hard rows, that hold this level back at x.
    """

    name: str
    residual: float
    excess: float
    scale: float
    uncertainty: float
    multipliers: int

    @property
    def relative_excess(self) -> float:
        """excess / scale, the unit in which solvers declare their tolerance; 0 when excess is 0."""
        return self.excess / self.scale if self.excess > 0.0 else 0.0

    def accepted(self, tolerance: float) -> bool:
        """Whether the excess is at most `tolerance` * scale + uncertainty."""
        return self.excess <= tolerance * self.scale + self.uncertainty


@dataclasses.dataclass(frozen=True, slots=True)
class Certificate:
    """The verdict on x.

    Attributes:
        ok: x is the lexicographic optimum to within the tolerance.
        fault: the name of the first level at fault, "hard rows" or "least norm"; None when ok.
        sentence: the verdict in words, with the figure that decided it.
        levels: one `LevelCertificate` per level.
        hard_violation: largest violation of a hard row, in its unit.
        relative_hard_violation: largest violation of a hard row over `||a_i|| ||x|| + |bound_i|`.
        deviation: how much nearer to the secondary vector (to 0: smaller) x could be at no level's cost.
        relative_deviation: deviation / (||x|| + ||secondary||).
        deviation_uncertainty: what rounding may contribute to `relative_deviation`.
        tolerance: the tolerance that was applied.
    """

    ok: bool
    fault: str | None
    sentence: str
    levels: tuple[LevelCertificate, ...]
    hard_violation: float
    relative_hard_violation: float
    deviation: float
    relative_deviation: float
    deviation_uncertainty: float
    tolerance: float

    @property
    def relative_excess(self) -> float:
        """The largest relative excess of a level."""
        return max(level.relative_excess for level in self.levels)

    def _repr_html_(self) -> str:
        from hqp_rp.core.html import certificate_html

        return certificate_html(self)


def certify(
    problem: Problem,
    x: ArrayLike,
    secondary: ArrayLike | None = None,
    tolerance: float = TOLERANCE,
    *,
    rank_tolerance: float = RANK_TOLERANCE,
) -> Certificate:
    """How far x is from the lexicographic optimum of `problem`, level by level, without any solver.

    With Z an orthonormal basis of the null space of the rows that earlier levels hold fixed (equalities and rows that x
    violates), the excess of level k is

    - `||P v||`, P the orthogonal projector onto range(A_k Z), when no inequality row of an earlier level is active: the
      part of the residual that a move within Z removes;
    - else `min over lambda >= 0 of || Z^T (A_k^T v + H^T lambda) ||` in the metric (Z^T A_k^T A_k Z + delta^2 I)^-1, H the
      outward normals of the active rows and delta = 1e-5 ||A_k||_2: the stationarity residual with multipliers of the
      right sign, in the unit of the residual. It is what the best allowed move d removes when d itself costs delta ||d||.

    x is accepted when every excess is at most `tolerance * (||A_k|| ||x|| + ||b_k||)` plus rounding, every hard row holds
    to the same relative tolerance, and x deviates from the optimum nearest to `secondary` by no more than that tolerance
    times ||x|| + ||secondary||. Directions that the rank rule cuts count as free. Where x is at zero but for the rounding error
    of the bounds that determine it (shorter than 1e-12 of them), that rounding error counts as such for rows and for x itself.
    A normal so short in the free directions (1e-9) that it may hold or not is counted as either.

    A level whose rows differ in length by more than a factor 100 is judged in parts too: for its rows no longer than a tenth, a
    hundredth, ... of the longest, the same by moves that leave its other rows where they are, in the size of the part; and so
    are rows of which `||a_i|| ||x|| + |b_i|` differs by more than 1e6, by that size. An own inequality row at its bound then
    pulls back by no more than the violation that the tolerance hides there.

    A level with damping is judged as the level that it is, `[A_k; D_k]` (see `hqp_rp.core.level_damping`), at the point where
    it was solved: of all points that earlier levels and hard rows allow and at which its rows have the violation that they
    have at x, the one with the least `||D_k x - d_k||`. Later levels then find its rows where x has them.

    With a metric W all of this is said of y = W^(1/2) x, by the symmetric root, which no solver uses.

    Args:
        problem: the problem that x answers.
        x: (n,) finite.
        secondary: (n,) the free vector the solver was given; None means 0 (least norm).
        tolerance: >= 0, relative; a solver's own `tolerance` when its answer is judged.
        rank_tolerance: of the rank rule.

    Raises:
        ProblemError: x or secondary is not n finite numbers.
        SettingError: a tolerance that is negative or not finite.

    Source: the optimality conditions of hierarchical least squares in Escande, Mansard and Wieber 2014, section 3.
    """
    point = checked_point(x, problem.n)
    goal = np.zeros(problem.n) if secondary is None else checked_point(secondary, problem.n, "secondary")
    require_tolerance("tolerance", tolerance)
    require_tolerance("rank_tolerance", rank_tolerance)
    if problem.metric is not None:
        root, inverse = symmetric_root(problem.metric)
        plain = with_inverse(problem, inverse)
        return certify(plain, root @ point, root @ goal, tolerance, rank_tolerance=rank_tolerance)
    judge = _Judge(point, max(tolerance, TOLERANCE), rank_tolerance, rounding_at_zero(problem, point))
    hard_violation, relative_hard = judge.hard(problem.hard)
    levels = tuple(judge.level(level, damped_level(problem, k)) for k, level in enumerate(problem.levels))
    deviation, relative_deviation, uncertainty = judge.deviation(goal)

    fault, sentence = None, f"Optimal at every level to a relative {tolerance:.1e}."
    at_fault = next((level for level in levels if not level.accepted(tolerance)), None)
    if relative_hard > tolerance + 8 * _EPS * problem.n:
        fault = "hard rows"
        sentence = f"The hard rows are violated by up to {hard_violation:.3g} (relative {relative_hard:.1e})."
    elif at_fault is not None:
        fault = at_fault.name
        sentence = (
            f"{at_fault.name!r} is at fault: {at_fault.excess:.3g} of its residual {at_fault.residual:.3g} could be removed "
            f"at no cost to the levels before it (relative {at_fault.relative_excess:.1e}, allowed {tolerance:.1e})."
        )
    elif relative_deviation > tolerance + uncertainty:
        fault = "least norm"
        aim = "smaller" if secondary is None else "nearer to the secondary vector"
        sentence = (
            f"Every level is optimal, but x could be {aim} by {deviation:.3g} at no level's cost "
            f"(relative {relative_deviation:.1e})."
        )
    return Certificate(
        ok=fault is None,
        fault=fault,
        sentence=sentence,
        levels=levels,
        hard_violation=hard_violation,
        relative_hard_violation=relative_hard,
        deviation=deviation,
        relative_deviation=relative_deviation,
        deviation_uncertainty=uncertainty,
        tolerance=tolerance,
    )


class _Judge:
    """x, and what the levels judged so far hold fixed (Z) and hold back (H)."""

    def __init__(self, x: FloatArray, active_tolerance: float, rank_tolerance: float, rounding: FloatArray) -> None:
        self.x = x
        self.rounding = rounding  # (n, r) of x, where it is at zero but for that
        self.size = norm(x)
        self.active_tolerance = active_tolerance
        self.rank_tolerance = rank_tolerance
        self.Z = np.eye(len(x))
        self.H = np.zeros((0, len(x)))  # outward unit normals of active inequality rows
        self.kept: list[tuple[Level, NDArray[np.bool_]]] = []  # inequality rows that bind
        self.drift = 8 * _EPS  # sine of the angle by which rounding may have turned range(Z)

    def hard(self, hard: Level | None) -> tuple[float, float]:
        """Violation of the hard rows, absolute and relative; they then bind everything that follows."""
        if hard is None or not hard.m:
            return 0.0, 0.0
        rows = _Rows(hard, self)
        error = np.abs(rows.violation)
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = np.where(error > rows.noise, error / rows.reach, 0.0)
        self._bind(rows, rows.equality, hard)
        return times_power(float(error.max()), rows.exponent), float(relative.max())

    def level(self, level: Level, damped: Level | None = None, own: int | None = None) -> LevelCertificate:
        """Judge a level, as `damped` where it is damped; it then binds the ones after it. own: rows before its damping rows."""
        if damped is not None:
            return self._damped(level, damped)
        if level.m == 0:
            return LevelCertificate(level.name, 0.0, 0.0, 0.0, 0.0, 0)
        rows = _Rows(level, self)
        residual = norm(rows.violation)
        scale = rows.size * self.size + norm(rows.target)
        cut = self.rank_tolerance * rows.size
        parts = smaller_parts(rows.lengths, rows.reach, own)
        if parts:
            found = self._worst_part(rows, parts)
            scale, chosen = found.scale, found.rows
        else:
            pulling = rows.equality | (rows.violation != 0.0)
            found = removable(rows.A[pulling], rows.violation[pulling], self.Z, self.H, rows.size, cut, self.drift)
            chosen = slice(None)
        excess, multipliers = found.excess, found.positive
        uncertainty = (
            found.uncertainty + 4 * _EPS * (len(self.x) + level.m) * scale + two_norm(rows.A[chosen] @ self.rounding)
        )
        if parts:
            uncertainty += two_norm(rows.A[chosen]) * rows.asked_rounding()
        self._bind(rows, rows.equality | rows.violated, level)
        residual, excess, scale, uncertainty = (
            times_power(value, rows.exponent) for value in (residual, excess, scale, uncertainty)
        )
        return LevelCertificate(level.name, residual, excess, scale, uncertainty, multipliers)

    def _worst_part(self, rows: _Rows, parts: list[Part]) -> Removable:
        """Of the level and its parts, the one of which the largest share could be removed."""
        found = [
            removable_in_part(rows, *part, self.Z, self.H, self.size, self.rank_tolerance, self.drift)
            for part in (Part(np.ones_like(rows.equality), False), *parts)
        ]
        return max(found, key=lambda one: (one.excess - one.uncertainty) / one.scale if one.excess > 0.0 else 0.0)

    def deviation(self, goal: FloatArray) -> tuple[float, float, float]:
        """Distance to the nearest allowed point to `goal`: absolute, relative, and the part rounding may contribute."""
        size = self.size + norm(goal)
        if size == 0.0:
            return 0.0, 0.0, 0.0
        gap = self.x - goal
        excess, turned = removable(np.eye(len(gap)), gap, self.Z, self.H, 1.0, self.rank_tolerance, self.drift)[:2]
        return (
            excess,
            excess / size,
            (turned + two_norm(self.Z.T @ self.rounding) * len(gap)) / size + 8 * _EPS * len(gap),
        )

    def _damped(self, level: Level, damped: Level) -> LevelCertificate:
        """The damped level where it was solved; the level itself then binds at x."""
        rows = _Rows(level, self)
        # However little damping leaves a row violated, later levels keep it there.
        fixed = rows.equality | (np.abs(rows.violation) > REACHED * rows.reach + rows.noise)
        x = self._solved_at(level, damped, fixed)
        rounding = self.rounding
        if norm(x) <= NEAR_ZERO * self.size:
            rounding = np.hstack((rounding, 8 * _EPS * self.size * np.eye(len(x))))
        there = _Judge(x, self.active_tolerance, self.rank_tolerance, rounding)
        there.Z, there.drift = self.Z, self.drift
        for before, chosen in self.kept:
            other = _Rows(Level(*_chosen(before, chosen)), there)
            if other.active.any():
                there.H = np.vstack([there.H, other.normals[other.active]])
        found = there.level(damped, own=level.m)
        before_Z = self.Z
        self._bind(rows, fixed, level)
        unsure = 4 * _EPS * (len(self.x) + level.m) * rows.size * self.size  # of the violation, which is that at x
        residual, unsure = (times_power(value, rows.exponent) for value in (norm(rows.violation), unsure))
        # It moves the point where the level was solved along directions that its rows hardly see, and D with it.
        if fixed.any() and before_Z.shape[1]:
            sigma = np.linalg.svd(level.A[fixed] @ before_Z, compute_uv=False)
            least = sigma[sigma > self.rank_tolerance * two_norm(level.A)].min(initial=np.inf)
            unsure *= 1.0 + two_norm(damped.A[level.m :]) / float(least)
        return dataclasses.replace(found, residual=residual, uncertainty=found.uncertainty + unsure)

    def _solved_at(self, level: Level, damped: Level, fixed: NDArray[np.bool_]) -> FloatArray:
        """Of the points that all levels so far allow, this one's fixed rows where they are at x, the one of least ||D x||."""
        Z = self.Z
        if fixed.any() and Z.shape[1]:
            Z = remaining(level.A[fixed], Z, self.rank_tolerance)[1]
        if not Z.shape[1]:
            return self.x
        bounds = [_chosen(level, ~fixed), *(_chosen(*before) for before in self.kept)]
        G, h, _, _ = one_sided(*(np.concatenate(parts) for parts in zip(*bounds, strict=True)))
        D, d, x = damped.A[level.m :], damped.lower[level.m :], self.x
        undamped = remaining(D, Z, self.rank_tolerance)[1]
        if not undamped.shape[1]:
            return nearest_point(x, Z, G, h, D @ Z, D @ x - d)
        # A move costs a little too, and the search goes on from where it came to, which leaves no bias; then least norm.
        B = np.concatenate((D @ Z, NEARLY_FREE * two_norm(D) * np.eye(Z.shape[1])))
        for _ in range(PROXIMAL_STEPS):
            x = nearest_point(x, Z, G, h, B, np.concatenate((D @ x - d, np.zeros(Z.shape[1]))))
        return nearest_point(x, undamped, G, h, np.eye(undamped.shape[1]), undamped.T @ x)

    def _bind(self, rows: _Rows, fixed: NDArray[np.bool_], level: Level) -> None:
        if not fixed.all():
            self.kept.append((level, ~fixed))
        held = rows.A[fixed]
        if len(held) and self.Z.shape[1]:
            sigma, Vt = np.linalg.svd(held @ self.Z)[1:]
            rank = int((sigma > self.rank_tolerance * rows.size).sum())
            if rank:
                amplified = rows.size / float(sigma[rank - 1])
                lengths = rows.lengths[fixed]
                if 0.0 < float(lengths.min()) * UNEVEN < float(lengths.max()):
                    # Rows of one length have the same null space, and rounding turns it less.
                    even, turned = np.linalg.svd((held / lengths[:, None]) @ self.Z)[1:]
                    if int((even > self.rank_tolerance).sum()) == rank and float(even[rank - 1]) * amplified > 1.0:
                        amplified, Vt = 1.0 / float(even[rank - 1]), turned
                self.drift = min(1.0, self.drift * (1.0 + amplified) + 8 * _EPS * amplified)
                self.Z = self.Z @ Vt[rank:].T
        active = rows.active & ~fixed
        if active.any():
            self.H = np.vstack([self.H, rows.normals[active]])


class _Rows:
    """A level's rows at x, divided by the power of two that brings A's largest entry into [0.5, 1)."""

    def __init__(self, level: Level, judge: _Judge) -> None:
        self.A, self.exponent = normalised(level.A)
        self.size = two_norm(self.A)
        lower = np.ldexp(level.lower, -self.exponent)
        upper = np.ldexp(level.upper, -self.exponent)
        value = self.A @ judge.x
        self.target = np.minimum(np.maximum(value, lower), upper)
        self.violation = value - self.target
        self.equality = lower == upper
        lengths = np.sqrt(np.einsum("ij,ij->i", self.A, self.A))
        self.reach = lengths * judge.size + np.abs(self.target)
        self.noise = row_norms(self.A @ judge.rounding)
        self.lengths = lengths
        if self.equality.all():
            self.violated = self.active = np.zeros_like(self.equality)
            self.near, self.normals = np.zeros_like(lengths), np.zeros_like(self.A)
            return
        self.near = near = judge.active_tolerance * self.reach + self.noise
        above, below = value >= upper - near, value <= lower + near
        self.violated = np.abs(self.violation) > near
        # A band narrower than the tolerance holds its row from both sides.
        self.equality = self.equality | (above & below & ~self.violated)
        self.active = (above | below) & (lengths > 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            self.normals = np.where(above, 1.0, -1.0)[:, None] * self.A / lengths[:, None]

    def asked_rounding(self) -> float:
        """What rounding of the largest target of the rows, as a length of x, may add to x where the level is solved."""
        lengths = np.where(self.lengths > 0.0, self.lengths, self.size)
        return 8 * _EPS * float((np.abs(self.target) / lengths).max()) if self.size > 0.0 else 0.0


def _chosen(level: Level, rows: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray, FloatArray]:
    return level.A[rows], level.lower[rows], level.upper[rows]
