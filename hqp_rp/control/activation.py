"""Smooth activation of tasks and rows: an answer without a jump while levels or single rows come and go."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core.errors import ProblemError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.row_names import take_row_names
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver, checked_secondary, get_solver


class BlendedSolution(Solution):
    """A `Solution` made of the answers of several stacks.

    Attributes:
        parts: ((weight, solution), ...), the weights > 0 and adding up to 1: `x = sum weight * solution.x`.
    """

    __slots__ = ("parts",)

    parts: tuple[tuple[float, Solution], ...]


def blend(
    problem: Problem,
    solver: str | Solver,
    *,
    levels: ArrayLike | None = None,
    rows: ArrayLike | None = None,
    secondary: ArrayLike | None = None,
) -> BlendedSolution:
    """Solve `problem` with levels and rows that are active to a degree between 0 (absent) and 1 (present).

    ::

        x(alpha) = integral over t from 0 to 1 of  x[rows with alpha_i > t]

    the mean, over all thresholds t, of the answer to the stack of the rows that are more active than t. That is one solve
    for each distinct degree in (0, 1) and one more. x is continuous and piecewise linear in alpha, whatever the solver
    and the ranks; at degrees 0 and 1 it is the solver's own answer to the stack without and with those rows. It stays within
    the hard rows, and where the solver is lexicographic every level keeps its best residual as long as no row of it and
    none before it is in transition, since all parts share it and their optima are a convex set.

    Weighting rows by alpha instead has no such effect: in a strict hierarchy a row of any weight > 0 is as strict as one
    of weight 1, and x jumps at 0. On equality levels with one level in transition, x is the intermediate-desired-value
    answer of Lee, Mansard and Park 2012, `b_k -> alpha b_k + (1 - alpha) A_k x_without`.

    Args:
        problem: the whole stack, every row present.
        solver: a name of `all_solvers()` or a `Solver`.
        levels: (p,) degree of each level in [0, 1]; None means 1 for all.
        rows: (M,) degree of each stacked row in [0, 1]; None means 1. A row's degree is its own times its level's.
        secondary: (n,) free vector, as for `solve`.

    Returns the blend, judged as an answer to the whole `problem`; its status is the first one of its parts that is not
    `SOLVED`. Hard rows are always present.

    Raises:
        ProblemError: degrees that do not fit or are outside [0, 1].

    Source: the aim is that of Simetti and Casalino 2016 (activation of inequality objectives, transitions of tasks); the
    mean over thresholds is ours (the interpolation is that of Lovász 1983).
    """
    degrees = _degrees("rows", rows, len(problem.matrix))
    degrees *= np.repeat(_degrees("levels", levels, problem.p), np.diff(problem.offsets))
    chosen = get_solver(solver)
    free = checked_secondary(secondary, problem.n)
    steps = np.unique(np.concatenate(([0.0, 1.0], degrees)))
    parts = []
    for least, most in itertools.pairwise(steps):
        part = _without(problem, degrees > least)
        parts.append((float(most - least), chosen.solve(part, free)))
    failed = next((solution for _, solution in parts if not solution.status.ok), None)
    status = Status.SOLVED if failed is None else failed.status
    message = "" if failed is None else failed.message
    iterations = sum(solution.iterations for _, solution in parts)
    x: FloatArray | None = np.zeros(problem.n)
    for weight, solution in parts:
        x = None if x is None or solution.x is None else x + weight * solution.x
    blended = BlendedSolution(problem, x, status, iterations, message, free)
    blended.parts = tuple(parts)
    return blended


def ramp(value: ArrayLike, start: float, end: float) -> FloatArray:
    """A degree of activation: 0 up to `start`, 1 from `end` on, `3 s^2 - 2 s^3` between with s the way from start to end.

    `end < start` ramps downwards: `ramp(distance, 0.10, 0.02)` activates a row while the distance falls from 0.10 to
    0.02. Once continuously differentiable.

    Args:
        value: any shape, in the unit of start and end; the answer has its shape.

    Raises:
        ProblemError: start and end coincide or are not finite.
    """
    if not np.isfinite([start, end]).all() or start == end:
        raise ProblemError(f"start = {start!r}, end = {end!r}; they must be two different finite numbers.")
    s = np.clip((np.asarray(value, dtype=np.float64) - start) / (end - start), 0.0, 1.0)
    return np.asarray(s * s * (3.0 - 2.0 * s))


def _degrees(what: str, given: ArrayLike | None, count: int) -> FloatArray:
    if given is None:
        return np.ones(count)
    try:
        degrees = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise ProblemError(f"{what} is {given!r}; it must be {count} numbers in [0, 1].") from None
    if degrees.shape != (count,) or not ((degrees >= 0.0) & (degrees <= 1.0)).all():
        raise ProblemError(f"{what} must be {count} numbers in [0, 1]; got {degrees.tolist()}.")
    return degrees


def _without(problem: Problem, present: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Problem:
    """`problem` with the present rows only; an emptied level stays as a level without rows."""
    if present.all():
        return problem
    offsets = np.concatenate(([0], np.cumsum(present)))[problem.offsets]
    lower = np.ascontiguousarray(problem.lower[present])
    upper = lower if problem.is_equality else np.ascontiguousarray(problem.upper[present])
    matrix = np.ascontiguousarray(problem.matrix[present])
    part = Problem.from_stacked(
        matrix,
        lower,
        upper,
        offsets.astype(np.int64),
        names=problem.names,
        hard=problem.hard,
        damping=problem.damping,
        metric=problem.metric,
        check=False,
    )
    take_row_names(problem, part)
    return part
