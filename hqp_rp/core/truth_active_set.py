"""Lexicographic least squares with two-sided and hard rows: an active-set method in exact rational arithmetic.

Level k minimizes f(u) = 1/2 sum of squared violations, convex, once differentiable and piecewise quadratic, over the
polyhedron that the levels before it left. A point is accepted only when multipliers of the right sign that make it
stationary have been found exactly, which proves it optimal. Otherwise what those multipliers leave of the gradient
(non-negative least squares, Lawson and Hanson 1974, in rationals) is a direction that all active rows allow, and f falls
strictly along it. Then the minimum over the cell of the new point is taken: the points that have the same rows at a bound
and the same rows violated, where f is one quadratic.

It cannot cycle, however degenerate the rows are: a cell and its rows at a bound determine the minimum on their affine hull,
so the value of f there; there are finitely many of them, and f falls strictly from one to the next.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from flint import fmpq, fmpz_mat

from hqp_rp.core.errors import WorkLimitError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.truth_cone import held, nonnegative_residual
from hqp_rp.core.truth_exact import AffineSet, RationalVector, Rows, Unit, matrix_of, metric_rows, rational
from hqp_rp.core.truth_rows import IntegerRows, finite_bounds, guessed, levels_of

WORK_LIMIT = 5000
"""Cells that one level may visit before the search gives up; a few dozen are usual."""


@dataclasses.dataclass(frozen=True, slots=True)
class ActiveSetAnswer:
    """x (n,), residuals (p,), and the matrices of the rows that bind at x: hard rows first, then each level's."""

    x: FloatArray
    residuals: FloatArray
    binding: list[FloatArray]


def solve_active_set(
    problem: Problem, secondary: FloatArray, start: FloatArray | None = None, limit: int = WORK_LIMIT
) -> ActiveSetAnswer | None:
    """The lexicographic optimum nearest to `secondary` (n,); None when the hard rows contradict each other.

    With `start` (n,) the search begins at the lexicographic optimum of the rows that bind there, taken as equalities, and
    ends at once when that is the answer; a wrong start costs time, never truth.

    Raises:
        WorkLimitError: a level needs more than `limit` cells.
    """
    n = problem.n
    levels = levels_of(problem)
    unit = Unit.fitting([(level.A, finite_bounds(level)) for level in levels], secondary)
    goal = unit.vector(secondary)
    rows = [IntegerRows.of(level, unit) for level in levels]
    u = goal
    if start is not None:
        optima = AffineSet(n)
        for level, level_rows in zip(levels, rows, strict=True):
            optima.minimize(level_rows.at(*guessed(level, start)))
        u = optima.nearest(goal)
    region = Region(n, goal, limit)
    for k, level_rows in enumerate(rows):
        u = region.minimize(level_rows, u)
        if k == 0 and level_rows.square(u):
            return None
    last = metric_rows(problem.metric, n)
    targets: list[int | None] = [sum(a * b for a, b in zip(row, goal.numerators, strict=True)) for row in last]
    u = region.minimize(IntegerRows(last, targets, targets, 0), u)
    return ActiveSetAnswer(
        unit.floats(u),
        np.array([level_rows.residual(u) for level_rows in rows[1:]]),
        [level.A[level_rows.binding(u)] for level, level_rows in zip(levels, rows, strict=True)],
    )


class Region:
    """What earlier levels left: an affine set, and inequality rows that must stay met.

    Where the minimum is not unique, the search takes the point nearest to `anchor`.
    """

    def __init__(self, n: int, anchor: RationalVector, limit: int = WORK_LIMIT) -> None:
        self.n = n
        self.anchor = anchor
        self.limit = limit
        self.equalities = AffineSet(n)
        self.rows: list[list[int]] = []
        self.lower: list[int | None] = []
        self.upper: list[int | None] = []

    def minimize(self, level: IntegerRows, u: RationalVector) -> RationalVector:
        """A minimizer of the level's violation over the region, from u in it; the region shrinks to the minimizers."""
        for _ in range(self.limit):
            direction = self._descent(level, u)
            if direction is None:
                break
            u = self._minimize_cell(level, self._search(level, u, direction))
        else:
            raise WorkLimitError(
                f"The exact active-set search of a level with {len(level.rows)} rows on {self.n} unknowns, under "
                f"{len(self.rows)} inequality rows, visited {self.limit} cells, which is allowed, and was not done; give "
                "truth(..., start=x) a point near the optimum."
            )
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
            if level.lower[i] is not None or level.upper[i] is not None:
                self.rows.append(level.rows[i])
                self.lower.append(level.lower[i])
                self.upper.append(level.upper[i])
        return u

    def _descent(self, level: IntegerRows, u: RationalVector) -> list[int] | None:
        """A direction within the region along which the violation falls, or None when u is proven optimal."""
        if self.equalities.dimension == 0:
            return None
        gradient = _gradient(level, u, self.n)
        normals = [
            row if high is not None and value == high * u.denominator else [-a for a in row]
            for row, value, low, high in self._states(u)
            if value in _ends(low, high, u.denominator)
        ]
        if held(gradient, self.equalities.S, normals):
            return None
        N = self.equalities.solved()[2]
        across = N.transpose()
        slope = across * gradient
        if normals:
            slope = nonnegative_residual(slope, across * matrix_of(normals, self.n).transpose())
        if not any(slope.entries()):
            return None
        return _primitive([-int(e) for e in (N * slope).entries()])

    def _minimize_cell(self, level: IntegerRows, u: RationalVector) -> RationalVector:
        """The minimum of f on the cell of u, or on the smaller cells at the edges that the way there runs into.

        It ends at the minimum, nearest to the anchor, of one quadratic on one affine set: its digits depend on the rows
        alone and not on the way.
        """
        face = self.equalities.copy()
        chosen, targets = level.violated(u)
        pulling = Rows(matrix_of([level.rows[i] for i in chosen], self.n), fmpz_mat(len(targets), 1, targets))
        while True:
            on, q = [], u.denominator
            for row, value, low, high in self._edges(level, u):
                on += [(row, bound) for bound in (low, high) if bound is not None and value == bound * q]
            face.minimize(
                Rows(matrix_of([row for row, _ in on], self.n), fmpz_mat(len(on), 1, [bound for _, bound in on]))
            )
            best = face.copy()
            best.minimize(pulling)
            end = best.nearest(self.anchor)
            direction = [b * q - a * end.denominator for a, b in zip(u.numerators, end.numerators, strict=True)]
            if not any(direction):
                return u
            whole = fmpq(1)  # of the way to `end`
            step, length = whole, q * end.denominator
            for row, value, low, high in self._edges(level, u):
                speed = _dot(row, direction)
                for bound in (low, high):
                    if bound is not None and speed and (bound * q > value) == (speed > 0) and bound * q != value:
                        step = min(step, fmpq((bound * q - value) * end.denominator, speed))
            if step == whole:
                return end
            a, b = int(step.p), int(step.q)
            u = rational(
                [x * end.denominator * b + a * d for x, d in zip(u.numerators, direction, strict=True)], length * b
            )

    def _edges(self, level: IntegerRows, u: RationalVector) -> list[tuple[list[int], int, int | None, int | None]]:
        """(row, its value times u's denominator, lower, upper) of the rows whose bounds are edges of cells."""
        own = zip(level.rows, level.values(u), level.lower, level.upper, strict=True)
        return [*self._states(u), *(state for state in own if state[2] is None or state[2] != state[3])]

    def _states(self, u: RationalVector) -> list[tuple[list[int], int, int | None, int | None]]:
        return [
            (row, _dot(row, u.numerators), low, high)
            for row, low, high in zip(self.rows, self.lower, self.upper, strict=True)
        ]

    def _search(self, level: IntegerRows, u: RationalVector, p: list[int]) -> RationalVector:
        """The exact minimum of f along u + t p, t > 0, within the region."""
        q = u.denominator
        step = _line_minimum(level, u, p)
        for row, value, low, high in self._states(u):
            speed = _dot(row, p)
            bound = high if speed > 0 else low
            if speed and bound is not None:
                reach = fmpq(bound * q - value, speed * q)
                step = reach if step is None or reach < step else step
        assert step is not None  # f is bounded below and falls along p: without a limit it has a minimum
        a, b = int(step.p), int(step.q)
        return rational([x * b + a * q * d for x, d in zip(u.numerators, p, strict=True)], q * b)


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


def _gradient(level: IntegerRows, u: RationalVector, n: int) -> fmpz_mat:
    """Gradient of f at u times the denominator of u, n x 1."""
    chosen, targets = level.violated(u)
    A = matrix_of([level.rows[i] for i in chosen], n)
    return A.transpose() * (A * u.column - fmpz_mat(len(targets), 1, targets) * u.denominator)


def _ends(low: int | None, high: int | None, q: int) -> list[int]:
    return [bound * q for bound in (low, high) if bound is not None]


def _dot(row: list[int], vector: list[int]) -> int:
    return sum(a * b for a, b in zip(row, vector, strict=True))


def _primitive(vector: list[int]) -> list[int]:
    common = math.gcd(*vector)
    return [e // common for e in vector]
