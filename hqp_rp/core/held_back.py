"""Why a level is not reached: what holds it back at x, by the multipliers."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from hqp_rp.core.active import VIOLATED
from hqp_rp.core.diagnostics import ACTIVE_TOLERANCE, norm, row_norms, violation
from hqp_rp.core.nonnegative import nonnegative_least_squares
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.rounding import rounding_at_zero
from hqp_rp.core.row_names import RowName, level_row_names, row_names
from hqp_rp.core.words import listing

_FELT = 1e-6
"""A level that pulls by less than this part of what its missed rows pull each by itself cannot be improved by any x near."""

_SHOWN = 5


@dataclasses.dataclass(frozen=True, slots=True)
class HeldBack:
    """A level that x misses, and what holds it back.

    ::

        A_k^T v_k + sum_i mu_i g_i + sum_j A_j^T lambda_j = rest,   mu_i >= 0

    at x, where v_k is the violation of level k, g_i are the outward normals, of length one, of the inequality rows of hard rows
    and earlier levels that x is at a bound of, and A_j the rows of earlier levels, and hard equalities, that keep their
    value. mu and lambda make the rest least (non-negative least squares); where several sets of rows explain the same pull they
    are not unique, and one is told.

    Attributes:
        level: its name. residual: ||v_k||.
        by: what holds it back, the strongest first: hard rows and rows of limits by name and side, earlier levels by name.
        shares: the length of each one's pull, mu_i or ||A_j^T lambda_j||, over the sum of all, with the rest.
        rest: the share that none of them explains: what damping, or the method of the solver, leaves.
        alone: whether nothing holds it back: no small change of x reduces v_k. Its own rows contradict each other, or the
            posture is singular for what they ask.
        damped: whether the level is damped.
    """

    level: str
    residual: float
    by: tuple[str, ...]
    shares: tuple[float, ...]
    rest: float
    alone: bool
    damped: bool

    def __str__(self) -> str:
        if self.alone:
            return (
                f"{self.level} is held back by nothing else: no change of x brings it nearer, for its own rows contradict each "
                "other, or the posture is singular for what they ask"
            )
        told = [f"{name} ({share:.0%})" for name, share in zip(self.by, self.shares, strict=True)][:_SHOWN]
        if len(self.by) > _SHOWN:
            told.append(f"{len(self.by) - _SHOWN} more")
        if self.rest >= 0.005:
            told.append(f"{'its damping' if self.damped else 'the method of the solver'} ({self.rest:.0%})")
        return f"{self.level} is held back by {listing(told)}"


def held_back(problem: Problem, x: FloatArray) -> tuple[HeldBack, ...]:
    """For each level of `problem` that x (n,) misses by more than rounding, what holds it back; see `HeldBack`."""
    hard, found = problem.hard, []
    held = _Held(x, rounding_at_zero(problem, x))
    if hard is not None and hard.m:
        held.keep(hard, row_names(problem), "")
    names, at = level_row_names(problem), 0
    for level in problem.levels:
        missed = held.missed(level)
        if missed is not None:
            found.append(held.against(level, missed))
        held.keep(level, names[at : at + level.m], level.name)
        at += level.m
    return tuple(found)


class _Held:
    """What hard rows and the levels so far hold at x: columns of pulls, whose sign is free or not, and whose they are."""

    def __init__(self, x: FloatArray, rounding: FloatArray) -> None:
        self.x, self.rounding = x, rounding
        self.columns: list[FloatArray] = []
        self.owners: list[str] = []
        self.free: list[bool] = []

    def _near(self, level: Level, tolerance: float) -> FloatArray:
        value = level.A @ self.x
        bound = np.clip(value, level.lower, level.upper)
        near: FloatArray = tolerance * (row_norms(level.A) * norm(self.x) + np.abs(bound)) + row_norms(
            level.A @ self.rounding
        )
        return near

    def missed(self, level: Level) -> FloatArray | None:
        """v (m,) of the level, or None where it is met but for rounding."""
        if not level.m:
            return None
        error = violation(level, self.x)
        error = np.where(np.abs(error) > self._near(level, VIOLATED), error, 0.0)
        return error if error.any() else None

    def keep(self, level: Level, names: list[RowName], whole: str) -> None:
        """Equalities and missed rows keep their value, hard ones (whole "") each by itself; rows at a bound do not pass it."""
        value, lengths = level.A @ self.x, row_norms(level.A)
        error = violation(level, self.x)
        missed = np.abs(error) > self._near(level, VIOLATED)
        near = self._near(level, ACTIVE_TOLERANCE)
        above, below = value >= level.upper - near, value <= level.lower + near
        for i in np.flatnonzero(((level.lower == level.upper) | missed | above | below) & (lengths > 0.0)):
            # A band narrower than the tolerance holds its row from both sides.
            fixed = level.lower[i] == level.upper[i] or (missed[i] and bool(whole)) or (above[i] and below[i])
            unit = level.A[i] / lengths[i]
            self.columns.append(unit if fixed or above[i] else -unit)
            self.free.append(bool(fixed))
            if fixed:
                self.owners.append(whole or str(names[i]))
            else:
                self.owners.append(f"{names[i]} at its {names[i].side(bool(above[i]))} bound")

    def against(self, level: Level, v: FloatArray) -> HeldBack:
        pull = level.A.T @ v
        residual = norm(violation(level, self.x))
        damped = level.damping is not None
        if norm(pull) <= _FELT * float(np.abs(v) @ row_norms(level.A)):
            return HeldBack(level.name, residual, (), (), 0.0, True, damped)
        free = np.array(self.free, dtype=bool)
        columns = np.array(self.columns).reshape(-1, len(self.x)).T
        both = np.hstack((columns, -columns[:, free]))
        weights, rest = np.zeros(0), -pull / norm(pull)
        if both.shape[1]:
            weights, rest = nonnegative_least_squares(both, rest)
        signed = weights[: len(free)].copy()
        signed[free] -= weights[len(free) :]
        pulls: dict[str, FloatArray] = {}
        for column, weight, owner in zip(columns.T, signed, self.owners, strict=True):
            pulls[owner] = pulls.get(owner, np.zeros(len(self.x))) + weight * column
        lengths = {owner: norm(part) for owner, part in pulls.items()}
        whole = math.fsum(lengths.values()) + norm(rest)
        order = sorted(
            (owner for owner in lengths if lengths[owner] > _FELT * whole), key=lambda owner: -lengths[owner]
        )
        return HeldBack(
            level.name,
            residual,
            tuple(order),
            tuple(lengths[owner] / whole for owner in order),
            norm(rest) / whole,
            False,
            damped,
        )
