"""What the layers for PyTorch and JAX share, in numpy: the data of many problems in, their answers and gradients out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.derivative import ProblemGradient, SolutionDerivative
from hqp_rp.core.errors import ProblemError
from hqp_rp.core.level import FloatArray, IntArray, Level
from hqp_rp.core.problem import Problem
from hqp_rp.core.solution import Solution
from hqp_rp.core.solver import Solver


class Data(NamedTuple):
    """Problems of one shape, or their gradients; what a problem does not have has no rows.

    Attributes:
        matrix, lower, upper: (..., M, n), (..., M), (..., M), the levels stacked.
        hard_matrix, hard_lower, hard_upper: (..., h, n), (..., h), (..., h); h = 0 for none.
        secondary: (..., n), or (..., 0) for none.
        metric: (..., n, n), or (..., 0, 0) for none.
    """

    matrix: Any
    lower: Any
    upper: Any
    hard_matrix: Any
    hard_lower: Any
    hard_upper: Any
    secondary: Any
    metric: Any


def offsets_of(rows: Sequence[int]) -> IntArray:
    """(p + 1,) where levels of so many rows begin and end."""
    offsets = np.zeros(len(rows) + 1, dtype=np.int64)
    np.cumsum(rows, out=offsets[1:])
    return offsets


def bounds_of(level: Sequence[Any], what: str) -> tuple[Any, Any, Any]:
    """A, lower, upper of (A, b) or (A, lower, upper). Raises `ProblemError` for anything else."""
    if not isinstance(level, tuple | list) or len(level) not in (2, 3):
        got = f"{len(level)} arrays" if isinstance(level, tuple | list) else type(level).__name__
        raise ProblemError(f"{what} is {got}; it must be (A, b) for an equality, or (A, lower, upper).")
    shape = np.shape(level[0])
    if len(shape) < 2:
        raise ProblemError(f"{what}: A has shape {tuple(shape)}; it must be a matrix (..., m, n).")
    return level[0], level[1], level[-1]


def problems_of(data: Data, offsets: IntArray) -> list[Problem]:
    """Each problem of the leading dimensions, in order; checked as every problem is."""
    flat = _flat(data)
    found = []
    for i in range(len(flat.matrix)):
        hard = None
        if flat.hard_matrix.shape[1]:
            hard = Level(flat.hard_matrix[i], flat.hard_lower[i], flat.hard_upper[i])
        metric = flat.metric[i] if flat.metric.shape[1] else None
        rows = flat.matrix[i], flat.lower[i], flat.upper[i]
        found.append(Problem.from_stacked(*rows, offsets, hard=hard, metric=metric))
    return found


def solutions_of(data: Data, offsets: IntArray, solver: Solver) -> list[Solution]:
    """The solution of each problem. Raises `NoSolutionError` where one has none."""
    problems = problems_of(data, offsets)
    secondary = np.asarray(data.secondary, dtype=np.float64)
    free = list(secondary.reshape(len(problems), -1)) if secondary.shape[-1] else [None] * len(problems)
    found = [solver.solve(problem, zeta) for problem, zeta in zip(problems, free, strict=True)]
    for solution in found:
        solution.require()
    return found


def answers_of(solutions: Sequence[Solution], batch: tuple[int, ...], n: int) -> FloatArray:
    """x (*batch, n)."""
    return np.array([solution.require() for solution in solutions]).reshape(*batch, n)


def gradients_of(
    solutions: Sequence[Solution], x_bar: NDArray[Any], data: Data, constant_rank: bool, tolerance: float
) -> Data:
    """The gradient of each problem's data, in the shapes of `data`; x_bar (..., n)."""
    x_bar = np.asarray(x_bar, dtype=np.float64).reshape(len(solutions), -1)
    found = [
        SolutionDerivative(solution.problem, solution, constant_rank=constant_rank, tolerance=tolerance).vjp(own)
        for solution, own in zip(solutions, x_bar, strict=True)
    ]
    return Data(*(_stacked(name, found, np.shape(array)) for name, array in zip(Data._fields, data, strict=True)))


def _stacked(name: str, found: list[ProblemGradient], shape: tuple[int, ...]) -> FloatArray:
    """One field of all gradients in the shape of the data; without numbers where the problems do not have it."""
    if 0 in shape:
        return np.zeros(shape)
    return np.array([getattr(gradient, name) for gradient in found]).reshape(shape)


def _flat(data: Data) -> Data:
    """With one leading dimension."""
    arrays = [np.asarray(array, dtype=np.float64) for array in data]
    count = int(np.prod(arrays[0].shape[:-2], dtype=np.int64))
    ranks = (2, 1, 1, 2, 1, 1, 1, 2)
    return Data(*(a.reshape(count, *a.shape[a.ndim - rank :]) for a, rank in zip(arrays, ranks, strict=True)))
