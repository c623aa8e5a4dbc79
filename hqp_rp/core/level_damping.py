"""Damping of single levels of a problem: what is minimized, what later levels keep, and the same for any solver without it.

A level with damping minimizes, in the freedom that the levels before it and the hard rows leave,

    ||v_k(x)||^2 + ||D_k (x - zeta_k)||^2

with v_k its violation, D_k from its policy, and zeta_k = 0 but for `ErrorDamping(toward="below")`:

    ConstantDamping(eta)            D_k = eta I
    ErrorDamping(c, power)          D_k = sqrt(mu) I, mu = c ||v_k(0)||^power; zeta_k is what the levels below ask for
    VariableDamping(delta, maximum) D_k = lambda_0 I by (18)-(19), of the smallest singular value of A_k N_k
    Truncation(threshold)           D_k = 1e3 ||A_k|| V^T, V the right singular vectors of A_k N_k at or below the threshold
    ManipulabilityDamping(w_0, ...) D_k = eta I, eta of the product of the singular values of A_k N_k
    NumericalFiltering(delta, ...)  D_k = beta v^T, v the right singular vector of the smallest singular value of A_k N_k

N_k spans the null space of the equality rows of earlier levels and of the hard rows: a policy looks at what the problem states,
not at which limits happen to be active. The levels after it then keep what its rows reached: an equality row, or a row that was
left violated, keeps the value it has at that minimizer; a row that was met stays within its bounds. So a damped level leaves as
much freedom as an undamped one, and no level below can undo it.

What is kept, exactly: hard rows, the levels before, and a level that x = 0 meets or that its policy does not damp (no error, no
small singular value). What is not: a damped level misses what it could meet, by mu / (sigma^2 + mu) of the error along a
singular direction sigma. On equalities alone, constant and variable damping are those of `null_space`, (14)-(19).

Source: Nakamura and Hanafusa 1986 and Wampler 1986 for the damping; Escande, Mansard and Wieber 2014 for what levels keep.
Damping single levels beside hard rows in this way is ours.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from hqp_rp.core import _native
from hqp_rp.core.damping import (
    ConstantDamping,
    ErrorDamping,
    LevelDamping,
    ManipulabilityDamping,
    NumericalFiltering,
    Truncation,
    VariableDamping,
)
from hqp_rp.core.diagnostics import norm, remaining, row_norms, two_norm
from hqp_rp.core.level import FloatArray, IntArray, Level
from hqp_rp.core.problem import Problem
from hqp_rp.core.row_names import take_row_names
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.stacked import damping_factors
from hqp_rp.core.tolerances import RANK, REACHED, TRUNCATED

Solve = Callable[[Problem, FloatArray | None], Solution]


class DampingRows(NamedTuple):
    """Of all levels: D (R, n), d = D zeta (R,), offsets (p + 1,); no rows for a level that its policy does not damp now."""

    D: FloatArray
    d: FloatArray
    offsets: IntArray


def damping_rows(problem: Problem) -> DampingRows:
    """The rows that the problem's policies put beside its levels."""
    rows, rhs = [], []
    for k, policy in _policies(problem):
        if policy is None:
            rows.append(np.zeros((0, problem.n)))
            rhs.append(np.zeros(0))
            continue
        D = _rows(problem, k, policy)
        rows.append(D)
        below = len(D) and isinstance(policy, ErrorDamping) and policy.toward == "below"
        rhs.append(_asked_below(problem, k, float(D[0, 0])) if below else np.zeros(len(D)))
    offsets = np.zeros(problem.p + 1, dtype=np.int64)
    np.cumsum([len(D) for D in rows], out=offsets[1:])
    return DampingRows(np.ascontiguousarray(np.concatenate(rows)), np.concatenate(rhs), offsets)


def solve_damped(
    problem: Problem, secondary: FloatArray | None, solve: Solve, *, tolerance: float = REACHED
) -> Solution:
    """The answer to a problem with damping by a solver of problems without: one solve more for each damped level.

    Args:
        problem: with damping. secondary: (n,) or None, as `Solver.solve` has it.
        solve: solves a problem without damping; it is also told of the steps between.
        tolerance: relative, of `solve`: a row that it misses by less is met, and not kept where it is as one that had to be
            violated.

    What `solve` could not solve on the way ends it: its status and message come back, with no x.
    """
    iterations, doubt = 0, ""
    reached = _Reached(problem, tolerance=tolerance)
    for k, found in reached.steps(solve):
        iterations += found.iterations
        if found.x is None or found.status not in (Status.SOLVED, Status.INACCURATE):
            x = found.x if found.status is Status.INFEASIBLE else None
            return Solution(problem, x, found.status, iterations, found.message, secondary)
        if found.status is Status.INACCURATE:
            doubt = doubt or f"{problem.names[k]!r}, damped: {found.message}"
    undamped = reached.problem()
    found = solve(undamped, secondary)
    status = Status.INACCURATE if doubt and found.status is Status.SOLVED else found.status
    solution = Solution(problem, found.x, status, iterations + found.iterations, doubt or found.message, secondary)
    solution.held = reached.as_stated(found.held, undamped.hard_rows)
    return solution


def as_reached(problem: Problem, solve: Solve, *, band: float = 0.0) -> Problem:
    """A problem without damping whose optimum is that of `problem`: levels up to the last damped one ask for what they reach.

    Where `solve` gives no x on the way, the levels from there on are as they were stated.

    Args:
        band: how far from it they may be, as a part of ||x||: beside hard rows, the rounding of what was reached is a
            contradiction in exact arithmetic, and would decide over everything below.
    """
    reached = _Reached(problem, band)
    for _ in reached.steps(solve):
        pass
    return reached.problem()


def solve_with_damped_targets(
    problem: Problem, secondary: FloatArray | None, rank_tolerance: float, solve: Solve
) -> Solution:
    """The answer of a method that scales or projects tasks: `solve` of `damped_targets` by null-space priority."""
    cascade = _native.null_space(rank_tolerance, 0, 0.0, 0.0).solve
    found = solve(damped_targets(problem, cascade), secondary)
    found.problem = problem
    return found


def damped_targets(problem: Problem, solve: Solve) -> Problem:
    """`problem` without damping, its damped levels asking for what `solve` reaches on its equality levels without limits.

    For methods that scale or project a task: A_k x = A_k x_k, x_k the damped minimizer that knows no limit. A problem with
    damped two-sided levels is not for them: their damping stays.
    """
    matrix, lower, upper, offsets = problem.stacked
    damping = problem.damping or (None,) * problem.p
    levels = [k for k, level in enumerate(problem.levels) if level.is_equality]
    alone = Problem([problem.levels[k] for k in levels])
    low, high = lower.copy(), upper.copy()
    reached = _Reached(alone)
    for k, found in reached.steps(solve):
        if found.x is not None:
            level = slice(int(offsets[levels[k]]), int(offsets[levels[k] + 1]))
            low[level] = high[level] = matrix[level] @ found.x
    left = tuple(None if k in levels else policy for k, policy in enumerate(damping))
    bounds = low, low if problem.is_equality else high
    made = Problem.from_stacked(
        matrix, *bounds, offsets, names=problem.names, hard=problem.hard, damping=left, check=False
    )
    take_row_names(problem, made)
    return made


class _Rows(NamedTuple):
    """Rows of a level (m, n) with their bounds, and which row of the stated problem each is, -1 for none."""

    A: FloatArray
    lower: FloatArray
    upper: FloatArray
    stated: IntArray


class _Reached:
    """How far the levels of a problem have come, up to a damped one: what they determine keeps its value.

    What a level determines is stated by an orthonormal basis of its directions, so that however small a singular value is that
    was damped, no rounding error is divided by it later. Rows that it met stay as they were.
    """

    def __init__(self, problem: Problem, band: float = 0.0, tolerance: float = REACHED) -> None:
        self.damped = problem
        self.band, self.tolerance = band, tolerance
        self.Z = np.eye(problem.n)
        matrix, lower, upper, offsets = problem.stacked
        self.rows = [
            _Rows(matrix[a:b], lower[a:b], upper[a:b], np.arange(a, b)) for a, b in itertools.pairwise(offsets.tolist())
        ]
        self.done = 0

    def steps(self, solve: Solve) -> Iterator[tuple[int, Solution]]:
        """(k, the answer to the levels up to k, level k damped) for each damped level; these are then reached."""
        D, d, starts = self.damped.damping_rows
        for k in range(self.damped.p):
            own = slice(int(starts[k]), int(starts[k + 1]))
            if own.start == own.stop:
                continue
            found = solve(self.problem(k, D[own], d[own]), None)
            if found.x is not None and found.status in (Status.SOLVED, Status.INACCURATE):
                while self.done <= k:
                    self._reach(self.done, found.x)
                yield k, found
            else:
                yield k, found
                return

    def problem(self, last: int | None = None, D: FloatArray | None = None, d: FloatArray | None = None) -> Problem:
        """Without damping: the levels up to `last`, that one with D x = d as further rows; or all levels."""
        rows = self.rows if last is None else self.rows[: last + 1]
        A = np.concatenate([part.A for part in rows])
        lower, upper = np.concatenate([part.lower for part in rows]), np.concatenate([part.upper for part in rows])
        if D is not None and d is not None:
            A, lower, upper = np.concatenate((A, D)), np.concatenate((lower, d)), np.concatenate((upper, d))
        offsets = np.zeros(len(rows) + 1, dtype=np.int64)
        np.cumsum([len(part.A) for part in rows], out=offsets[1:])
        offsets[-1] = len(A)
        names = self.damped.names[: len(rows)]
        same = bool((lower == upper).all())
        made = Problem.from_stacked(
            np.ascontiguousarray(A),
            lower,
            lower if same else upper,
            offsets,
            names=names,
            hard=self.damped.hard,
            check=False,
        )
        take_row_names(self.damped, made)
        return made

    def as_stated(self, held: Any, hard_rows: int) -> Any:
        """`Solution.held` of the whole problem, by the rows of the stated one."""
        if not isinstance(held, np.ndarray):
            return held
        sides = np.zeros(hard_rows + self.damped.rows, dtype=held.dtype)
        sides[:hard_rows] = held[:hard_rows]
        stated = np.concatenate([part.stated for part in self.rows])
        sides[hard_rows + stated[stated >= 0]] = held[hard_rows:][stated >= 0]
        return sides

    def _reach(self, k: int, x: FloatArray) -> None:
        """Level k has come to x (n,): its equality rows, and those it leaves violated, keep the value that they have there."""
        A, lower, upper, stated = self.rows[k]
        self.done = k + 1
        value = A @ x
        nearest = np.clip(value, lower, upper)
        reach = row_norms(A) * norm(x) + np.abs(nearest)
        fixed = (lower == upper) | (np.abs(value - nearest) > self.tolerance * reach)
        basis = np.zeros((0, len(x)))
        if fixed.any() and self.Z.shape[1]:
            free = self.Z
            rank, self.Z = remaining(A[fixed], free, RANK)
            inside = free.T @ self.Z  # (d, d - rank), orthonormal
            basis = (free @ np.linalg.qr(inside, mode="complete")[0][:, inside.shape[1] :]).T if rank else basis
        at, band = basis @ x, self.band * norm(x)
        self.rows[k] = _Rows(
            np.concatenate((basis, A[~fixed])),
            np.concatenate((at - band, lower[~fixed])),
            np.concatenate((at + band, upper[~fixed])),
            np.concatenate((np.full(len(basis), -1), stated[~fixed])),
        )


def damped_level(problem: Problem, k: int) -> Level | None:
    """The rows of level k with D_k x = d_k below them; None where the level is not damped."""
    if problem.damping is None:
        return None
    D, d, offsets = problem.damping_rows
    own = slice(int(offsets[k]), int(offsets[k + 1]))
    if own.start == own.stop:
        return None
    level = problem.levels[k]
    bounds = np.concatenate((level.lower, d[own])), np.concatenate((level.upper, d[own]))
    return Level(np.concatenate((level.A, D[own])), *bounds, name=level.name)


def _policies(problem: Problem) -> Iterator[tuple[int, LevelDamping | None]]:
    yield from enumerate(problem.damping or (None,) * problem.p)


def _rows(problem: Problem, k: int, policy: LevelDamping) -> FloatArray:
    """D_k (r, n)."""
    if isinstance(policy, ConstantDamping):
        return _times_identity(policy.factor, problem.n)
    if isinstance(policy, ErrorDamping):
        _, lower, upper, offsets = problem.stacked
        own = slice(int(offsets[k]), int(offsets[k + 1]))
        error = norm(np.clip(0.0, lower[own], upper[own]))
        return _times_identity(np.sqrt(policy.factor * error**policy.power), problem.n)
    level = problem.levels[k]
    if not level.m:
        return np.zeros((0, problem.n))
    N = _freedom(problem, k)
    if not N.shape[1]:
        return np.zeros((0, problem.n))
    size = two_norm(level.A)
    _, sigma, Vt = np.linalg.svd(level.A @ N, full_matrices=False)
    if isinstance(policy, VariableDamping | ManipulabilityDamping | NumericalFiltering):
        factor = float(damping_factors(sigma[None], policy, np.ones(1), True)[0, 0])
        if not isinstance(policy, NumericalFiltering):
            return _times_identity(factor, problem.n)
        return factor * (Vt[-1:] @ N.T) if factor > 0.0 else np.zeros((0, problem.n))
    if isinstance(policy, Truncation):
        small = (sigma <= policy.threshold) & (sigma > RANK * size)
        return TRUNCATED * size * (Vt[small] @ N.T)
    return np.zeros((0, problem.n))


def _asked_below(problem: Problem, k: int, eta: float) -> FloatArray:
    """eta zeta_k (n,), zeta_k what the equality rows of the levels below k ask for together: the minimizer of their
    ||A_j x - b_j||^2, summed, and ||eta x||^2."""
    matrix, lower, upper, offsets = problem.stacked
    below = slice(int(offsets[k + 1]), len(matrix))
    equality = lower[below] == upper[below]
    A, b = matrix[below], lower[below]
    if not equality.all():
        A, b = A[equality], b[equality]
    if not len(A):
        return np.zeros(problem.n)
    return eta * _native.damped_least_squares(np.ascontiguousarray(A), np.ascontiguousarray(b), eta)


def _freedom(problem: Problem, k: int) -> FloatArray:
    """An orthonormal basis (n, d) of the null space of the hard equality rows and those of the levels before k."""
    N = np.eye(problem.n)
    before = problem.levels[:k] if problem.hard is None else (problem.hard, *problem.levels[:k])
    for level in before:
        rows = level.A[level.lower == level.upper]
        if len(rows) and N.shape[1]:
            N = remaining(rows, N, RANK)[1]
    return N


def _times_identity(eta: float, n: int) -> FloatArray:
    return eta * np.eye(n) if eta > 0.0 else np.zeros((0, n))
