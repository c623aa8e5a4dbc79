"""Two-sided rows as exact integers, and the rows that a point in double precision is thought to lie on."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from flint import fmpz_mat

from hqp_rp.core.diagnostics import norm, row_norms
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.truth_exact import RationalVector, Rows, Unit, integers, matrix_of, root

NEAR = 1e-9
"""Relative distance to a bound at which a guess counts as on it; a wrong guess costs time, never truth."""


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
        bounds, offset = integers(finite_bounds(level))
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

    def at(self, chosen: Sequence[int], upper: Sequence[bool]) -> Rows:
        """The chosen rows as equalities, each at its upper or lower bound."""
        sides = [self.upper[i] if above else self.lower[i] for i, above in zip(chosen, upper, strict=True)]
        bounds = [bound for bound in sides if bound is not None]
        n = len(self.rows[0]) if self.rows else 0
        return Rows(matrix_of([self.rows[i] for i in chosen], n), fmpz_mat(len(bounds), 1, bounds))

    def residual(self, u: RationalVector) -> float:
        """Norm of the violation at u, in the level's own unit."""
        return root(self.square(u), u.denominator**2, 2 * self.exponent)

    def square(self, u: RationalVector) -> int:
        """Squared norm of the violation at u, times the square of u's denominator."""
        values, q = self.values(u), u.denominator
        return sum((values[i] - target * q) ** 2 for i, target in zip(*self.violated(u), strict=True))


def levels_of(problem: Problem) -> list[Level]:
    """The hard rows, perhaps none, and the levels."""
    n = problem.n
    hard = problem.hard if problem.hard is not None else Level(np.zeros((0, n)), np.zeros(0), np.zeros(0))
    return [hard, *problem.levels]


def finite_bounds(level: Level) -> FloatArray:
    """The bounds that are finite, lower ones first."""
    bounds: FloatArray = np.concatenate([level.lower, level.upper])
    finite: FloatArray = bounds[np.isfinite(bounds)]
    return finite


def guessed(level: Level, x: FloatArray) -> tuple[list[int], list[bool]]:
    """Indices of the rows that are equalities, violated, or within `NEAR` of a bound at x (n,); whether each meets `upper`."""
    with np.errstate(over="ignore", invalid="ignore"):
        value = level.A @ x
        near = NEAR * (row_norms(level.A) * norm(x) + np.abs(value))
        above, below = value >= level.upper - near, value <= level.lower + near
        above &= ~below | (level.upper - value <= value - level.lower)
    chosen = np.flatnonzero(np.isfinite(value) & (above | below))
    return chosen.tolist(), above[chosen].tolist()
