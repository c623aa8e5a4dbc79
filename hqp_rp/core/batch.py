"""Many problems of one shape in one call: no Python per problem, all cores."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hqp_rp.core.errors import ProblemError
from hqp_rp.core.metric import checked_metric
from hqp_rp.core.problem import FloatArray, IntArray, Problem
from hqp_rp.core.solution import Status
from hqp_rp.core.solver import Solver, get_solver
from hqp_rp.core.threads import in_shares

_STATUSES = tuple(Status)


@dataclasses.dataclass(frozen=True, slots=True)
class BatchSolution:
    """The answers to N problems.

    Attributes:
        x: (N, n) answers; a row without an answer is nan.
        codes: (N,) uint8, position of each status in `list(Status)`; 0 is `SOLVED`.
    """

    x: FloatArray
    codes: NDArray[np.uint8]

    def status(self, i: int) -> Status:
        """How problem i ended."""
        return _STATUSES[int(self.codes[i])]

    @property
    def solved(self) -> NDArray[np.bool_]:
        """(N,) where the status is `SOLVED`."""
        return np.equal(self.codes, 0)

    def __len__(self) -> int:
        return len(self.x)


def solve_batch(
    A: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike | None,
    offsets: ArrayLike,
    *,
    solver: str | Solver,
    secondary: ArrayLike | None = None,
    metric: ArrayLike | None = None,
    threads: int | None = None,
    **settings: object,
) -> BatchSolution:
    """Solve N problems of one shape: level k of problem i is rows `offsets[k]:offsets[k + 1]` of A[i].

    The closed forms run compiled over all cores, each core on its own share, with memory linear in N; undamped null-space
    priority takes eight problems side by side. Answers obey the same rank rule as `solve`. Any other solver is called once
    for each problem.

    Args:
        A: (N, M, n), finite. lower, upper: (N, M); upper None means equalities. offsets: (p + 1,) from 0 to M.
        solver: a name or a `Solver`; `settings` are its fields.
        secondary: free vectors, (N, n) or (n,) for all; None means 0.
        metric: W (n, n) for all or (N, n, n), symmetric positive definite; None means the identity. See `hqp_rp.core.metric`.
        threads: how many; None means one for each core.

    Raises:
        ProblemError: shapes that do not fit, or a number that is not finite in A or in an equality's right-hand side.
        HqpError: an unknown solver or setting.
    """
    matrix = np.ascontiguousarray(A, dtype=np.float64)
    low = np.ascontiguousarray(lower, dtype=np.float64)
    up = low if upper is None else np.ascontiguousarray(upper, dtype=np.float64)
    starts = np.ascontiguousarray(offsets, dtype=np.int64)
    _check(matrix, low, up, starts)
    count, _, n = matrix.shape
    free = _free_vectors(secondary, count, n)
    method = get_solver(solver, **settings)
    inverse = None
    if metric is not None:
        root, inverse = _roots(metric, count, n)
        matrix = matrix @ inverse
        most = max(len(root), len(free))
        turned = np.einsum("nij,nj->ni", np.broadcast_to(root, (most, n, n)), np.broadcast_to(free, (most, n)))
        free = np.ascontiguousarray(turned)
    x = np.empty((count, n))
    codes = np.zeros(count, dtype=np.uint8)
    equality = low is up or np.array_equal(low, up)

    def work(span: slice) -> None:
        own = free if len(free) == 1 else free[span]
        method.solve_many(matrix[span], low[span], None if equality else up[span], starts, own, x[span], codes[span])

    in_shares(work, count, threads)
    if inverse is not None:
        x = np.einsum("nij,nj->ni", np.broadcast_to(inverse, (count, n, n)), x)
    return BatchSolution(x, codes)


def _roots(metric: ArrayLike, count: int, n: int) -> tuple[FloatArray, FloatArray]:
    """R and R^-1 of W = R^T R, (1, n, n) or (N, n, n)."""
    W = np.asarray(metric, dtype=np.float64)
    W = W[None] if W.ndim == 2 else W
    if W.shape not in ((1, n, n), (count, n, n)):
        raise ProblemError(f"metric has shape {np.shape(metric)}; it must be ({n}, {n}) or ({count}, {n}, {n}).")
    W = np.stack([checked_metric(one, n) for one in W])
    root: FloatArray = np.ascontiguousarray(np.swapaxes(np.linalg.cholesky(W), 1, 2), dtype=np.float64)
    return root, np.asarray(np.triu(np.linalg.inv(root)), dtype=np.float64)


def _check(matrix: FloatArray, lower: FloatArray, upper: FloatArray, offsets: IntArray) -> None:
    if matrix.ndim != 3 or matrix.shape[2] == 0:
        raise ProblemError(f"A has shape {matrix.shape}; it must be (N, M, n) with n at least 1.")
    for name, bound in (("lower", lower), ("upper", upper)):
        if bound.shape != matrix.shape[:2]:
            raise ProblemError(
                f"{name} has shape {bound.shape}; A has {matrix.shape[:2]} rows in all, so it must be that."
            )
    if not len(matrix):
        return
    Problem.from_stacked(matrix[0], lower[0], upper[0], offsets)  # offsets, and one problem's numbers
    if not np.isfinite(matrix).all():
        i, row, j = np.argwhere(~np.isfinite(matrix))[0]
        raise ProblemError(f"A[{i}, {row}, {j}] is {matrix[i, row, j]}; every entry must be finite.")
    bad = np.isnan(lower) | np.isnan(upper) | (lower > upper) | (lower == np.inf) | (upper == -np.inf)
    if bad.any():
        i, row = np.argwhere(bad)[0]
        raise ProblemError(
            f"Row {row} of problem {i} has lower = {lower[i, row]} and upper = {upper[i, row]}; "
            "lower must not exceed upper, and an equality must be finite."
        )


def _free_vectors(secondary: ArrayLike | None, count: int, n: int) -> FloatArray:
    if secondary is None:
        return np.zeros((1, n))
    free = np.ascontiguousarray(np.atleast_2d(np.asarray(secondary, dtype=np.float64)))
    if free.shape not in ((1, n), (count, n)) or not np.isfinite(free).all():
        raise ProblemError(f"secondary has shape {free.shape}; it must be ({n},) or ({count}, {n}), and finite.")
    return free
