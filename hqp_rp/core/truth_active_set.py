"""Lexicographic least squares with two-sided and hard rows: an active-set method in exact rational arithmetic.

Level k minimizes f(u) = 1/2 sum of squared violations, convex and once differentiable, over the polyhedron that the levels
before it left. A point is accepted only when multipliers of the right sign that make it stationary have been found
exactly (non-negative least squares, Lawson and Hanson 1974, in rationals), which proves it optimal. Otherwise what those
multipliers leave of the gradient is a direction that all active rows allow, and f falls strictly along it; Newton steps
with exact line searches then go to the minimum of the face. Faces are finite in number and none is met twice.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from flint import fmpq, fmpz_mat

from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.truth_exact import AffineSet, RationalVector, Rows, Unit, beside, integers, matrix_of, rational, root


@dataclasses.dataclass(frozen=True, slots=True)
class ActiveSetAnswer:
    """x (n,), residuals (p,), and the matrices of the rows that bind at x: hard rows first, then each level's."""

    x: FloatArray
    residuals: FloatArray
    binding: list[FloatArray]


@dataclasses.dataclass(frozen=True, slots=True)
class IntegerRows:
    """`lower <= rows u <= upper` in integers (None: no bound); one unit of it is 2**exponent in the level's own unit."""

    rows: list[list[int]]
    lower: list[int | None]
    upper: list[int | None]
    exponent: int

    @classmethod
    def of(cls, level: Level, unit: Unit) -> IntegerRows:
        """The level in the scaled unknown of `unit`."""
        entries, scale = integers(level.A)
        bounds, offset = integers(_finite_bounds(level))
        lift, n = offset - scale + unit.shift, level.n
        finite = iter([b << lift if b else 0 for b in bounds])
        lower, upper = ([next(finite) if np.isfinite(b) else None for b in side] for side in (level.lower, level.upper))
        rows = [entries[i * n : (i + 1) * n] for i in range(level.m)]
        return cls(rows, lower, upper, scale - unit.shift)

    def values(self, u: RationalVector) -> list[int]:
        """`rows u` times the denominator of u."""
        return [sum(a * b for a, b in zip(row, u.numerators, strict=True)) for row in self.rows]

    def violated(self, u: RationalVector) -> tuple[list[int], list[int]]:
        """Indices and targets of the equality rows and of the rows outside their bounds at u."""
        chosen, targets, q = [], [], u.denominator
        for i, (value, low, high) in enumerate(zip(self.values(u), self.lower, self.upper, strict=True)):
            target = high if high is not None and (value > high * q or low == high) else None
            if target is None and low is not None and value < low * q:
                target = low
            if target is not None:
                chosen.append(i)
                targets.append(target)
        return chosen, targets

    def binding(self, u: RationalVector) -> list[int]:
        """Indices of the rows that are equalities, violated or exactly at a bound at u."""
        q = u.denominator
        return [
            i
            for i, (value, low, high) in enumerate(zip(self.values(u), self.lower, self.upper, strict=True))
            if (high is not None and value >= high * q) or (low is not None and value <= low * q)
        ]

    def residual(self, u: RationalVector) -> float:
        """Norm of the violation at u, in the level's own unit."""
        return root(self.square(u), u.denominator**2, 2 * self.exponent)

    def square(self, u: RationalVector) -> int:
        """Squared norm of the violation at u, times the square of u's denominator."""
        values, q = self.values(u), u.denominator
        return sum((values[i] - target * q) ** 2 for i, target in zip(*self.violated(u), strict=True))


def solve_active_set(problem: Problem, secondary: FloatArray) -> ActiveSetAnswer | None:
    """The lexicographic optimum nearest to `secondary` (n,); None when the hard rows contradict each other."""
    n = problem.n
    hard = problem.hard if problem.hard is not None else Level(np.zeros((0, n)), np.zeros(0), np.zeros(0))
    levels = [hard, *problem.levels]
    unit = Unit.fitting([(level.A, _finite_bounds(level)) for level in levels], secondary)
    goal = unit.vector(secondary)
    region = Region(n)
    u = goal
    rows = [IntegerRows.of(level, unit) for level in levels]
    for k, level in enumerate(rows):
        u = region.minimize(level, u)
        if k == 0 and level.square(u):
            return None
    identity = [[int(i == j) for j in range(n)] for i in range(n)]
    u = region.minimize(IntegerRows(identity, list(goal.numerators), list(goal.numerators), 0), u)
    return ActiveSetAnswer(
        unit.floats(u),
        np.array([level.residual(u) for level in rows[1:]]),
        [level.A[row.binding(u)] for level, row in zip(levels, rows, strict=True)],
    )


class Region:
    """What earlier levels left: an affine set, and inequality rows that must stay met."""

    def __init__(self, n: int) -> None:
        self.n = n
        self.equalities = AffineSet(n)
        self.rows: list[list[int]] = []
        self.lower: list[int | None] = []
        self.upper: list[int | None] = []

    def minimize(self, level: IntegerRows, u: RationalVector) -> RationalVector:
        """A minimizer of the level's violation over the region, from u in it; the region shrinks to the minimizers."""
        while True:
            direction = self._descent(level, u)
            if direction is None:
                break
            u, _ = self._search(level, u, direction)
            u = self._minimize_face(level, u)
        violated, _ = level.violated(u)
        values = level.values(u)
        self.equalities.minimize(
            Rows(
                matrix_of([level.rows[i] for i in violated], self.n),
                fmpz_mat(len(violated), 1, [values[i] for i in violated]),
                u.denominator,
            )
        )
        for i in sorted(set(range(len(level.rows))) - set(violated)):
            self.rows.append(level.rows[i])
            self.lower.append(level.lower[i])
            self.upper.append(level.upper[i])
        return u

    def _active(self, u: RationalVector) -> list[tuple[list[int], int]]:
        """(outward normal, bound along it) of the rows that are exactly at a bound at u."""
        found = []
        for row, low, high in zip(self.rows, self.lower, self.upper, strict=True):
            value = sum(a * b for a, b in zip(row, u.numerators, strict=True))
            if high is not None and value == high * u.denominator:
                found.append((row, high))
            elif low is not None and value == low * u.denominator:
                found.append(([-a for a in row], -low))
        return found

    def _descent(self, level: IntegerRows, u: RationalVector) -> list[int] | None:
        """A direction within the region along which the violation falls, or None when u is proven optimal."""
        if self.equalities.dimension == 0:
            return None
        N = self.equalities.solved()[2]
        across = N.transpose()
        slope = across * _gradient(level, u, self.n)
        normals = [normal for normal, _ in self._active(u)]
        if normals:
            slope = nonnegative_residual(slope, across * matrix_of(normals, self.n).transpose())
        if not any(slope.entries()):
            return None
        return _primitive([-int(e) for e in (N * slope).entries()])

    def _minimize_face(self, level: IntegerRows, u: RationalVector) -> RationalVector:
        """The minimum of f on the face of u, or on the smaller faces that the way there runs into."""
        face = self.equalities.copy()
        self._pin(face, u)
        while face.dimension:
            N = face.solved()[2]
            if not any((N.transpose() * _gradient(level, u, self.n)).entries()):
                break
            chosen, targets = level.violated(u)
            best = face.copy()
            best.minimize(Rows(matrix_of([level.rows[i] for i in chosen], self.n), fmpz_mat(len(targets), 1, targets)))
            end = best.nearest(RationalVector([0] * self.n, 1))
            direction = [
                b * u.denominator - a * end.denominator for a, b in zip(u.numerators, end.numerators, strict=True)
            ]
            u, blocked = self._search(level, u, _primitive(direction))
            if blocked:
                self._pin(face, u)
        return u

    def _pin(self, face: AffineSet, u: RationalVector) -> None:
        active = self._active(u)
        face.minimize(
            Rows(
                matrix_of([normal for normal, _ in active], self.n),
                fmpz_mat(len(active), 1, [bound for _, bound in active]),
            )
        )

    def _search(self, level: IntegerRows, u: RationalVector, p: list[int]) -> tuple[RationalVector, bool]:
        """The exact minimum of f along u + t p within the region, and whether a row of the region stopped it."""
        q = u.denominator
        limit: fmpq | None = None
        for row, low, high in zip(self.rows, self.lower, self.upper, strict=True):
            speed = sum(a * b for a, b in zip(row, p, strict=True))
            bound = high if speed > 0 else low
            if speed and bound is not None:
                value = sum(a * b for a, b in zip(row, u.numerators, strict=True))
                reach = fmpq(bound * q - value, speed * q)
                limit = reach if limit is None or reach < limit else limit
        step = _line_minimum(level, u, p)
        blocked = limit is not None and (step is None or limit <= step)
        if blocked:
            step = limit
        assert step is not None  # f is bounded below and falls along p: without a limit it has a minimum
        a, b = int(step.p), int(step.q)
        moved = [x * b + a * q * d for x, d in zip(u.numerators, p, strict=True)]
        return rational(moved, q * b), blocked


def _line_minimum(level: IntegerRows, u: RationalVector, p: list[int]) -> fmpq | None:
    """The t > 0 at which the slope of f along u + t p, continuous, rising and piecewise linear, reaches zero."""
    q = u.denominator
    pieces: list[tuple[fmpq, fmpq, fmpq]] = []  # (from t, slope's value at 0 and rate that begin to count there)
    value, rate = fmpq(0), fmpq(0)
    for row, at, low, high in zip(level.rows, level.values(u), level.lower, level.upper, strict=True):
        speed = sum(a * b for a, b in zip(row, p, strict=True))
        if not speed:
            continue
        squared = fmpq(speed * speed)
        for bound, above in ((high, True), (low, False)):
            if bound is None or (low == high and not above):
                continue
            gap = fmpq(at - bound * q, q)
            offset, crossing = gap * speed, -gap / speed
            outside = low == high or (gap > 0 if above else gap < 0)
            if outside:
                value, rate = value + offset, rate + squared
                if low != high and crossing > 0:
                    pieces.append((crossing, -offset, -squared))
            elif crossing >= 0 and (speed > 0) == above:
                pieces.append((crossing, offset, squared))
    for start, offset, squared in [*sorted(pieces, key=lambda piece: piece[0]), (None, fmpq(0), fmpq(0))]:
        if rate > 0 and (start is None or value + rate * start >= 0):
            return -value / rate
        value, rate = value + offset, rate + squared
    return None


def nonnegative_residual(slope: fmpz_mat, normals: fmpz_mat) -> fmpz_mat:
    """A positive multiple of `slope + normals w`, d x 1, at the w >= 0 (k,) that makes its norm least (Lawson-Hanson).

    Exact. It is zero just when -slope is in the cone of the normals; else each normal makes with it an angle <= 90 degrees.
    """
    k = normals.ncols()
    across = normals.transpose()
    passive: list[int] = []
    weights = [fmpq(0)] * k
    residual, scale = slope, 1
    while True:
        pull = [-int(e) for e in (across * residual).entries()]
        entering = [i for i in range(k) if i not in passive and pull[i] > 0]
        if not entering:
            return residual
        passive.append(max(entering, key=lambda i: pull[i]))
        while True:
            columns = fmpz_mat(normals.nrows(), len(passive), [row[i] for row in normals.table() for i in passive])
            turned = columns.transpose()
            solved, den, _ = beside(turned * columns, -(turned * slope)).rref()
            best = [fmpq(row[len(passive)], den) for row in solved.table()]
            if all(weight > 0 for weight in best):
                break
            ratio = min(weights[i] / (weights[i] - w) for i, w in zip(passive, best, strict=True) if w <= 0)
            for i, w in zip(passive, best, strict=True):
                weights[i] = weights[i] + ratio * (w - weights[i])
            passive = [i for i in passive if weights[i] > 0]
            weights = [w if i in passive else fmpq(0) for i, w in enumerate(weights)]
        for i, w in zip(passive, best, strict=True):
            weights[i] = w
        scale = abs(int(den))
        numerators = [int((w * scale).p) for w in best]
        residual = slope * scale + columns * fmpz_mat(len(passive), 1, numerators)


def _gradient(level: IntegerRows, u: RationalVector, n: int) -> fmpz_mat:
    """Gradient of f at u times the denominator of u, n x 1."""
    chosen, targets = level.violated(u)
    A = matrix_of([level.rows[i] for i in chosen], n)
    return A.transpose() * (A * u.column - fmpz_mat(len(targets), 1, targets) * u.denominator)


def _primitive(vector: list[int]) -> list[int]:
    common = math.gcd(*vector)
    return [e // common for e in vector]


def _finite_bounds(level: Level) -> FloatArray:
    bounds: FloatArray = np.concatenate([level.lower, level.upper])
    finite: FloatArray = bounds[np.isfinite(bounds)]
    return finite
