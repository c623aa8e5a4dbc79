"""What the solvers that stand on QPs share: kept workspaces, the descent through hard rows and levels, the final verdict."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.qp_backend import Backend, make_backend
from hqp_rp.core.qp_level import Cascade, Memory
from hqp_rp.core.solution import Status
from hqp_rp.core.verify import contradiction, fault_of, hard_excess, with_hard_rows

HARD = "the hard rows"
NOT_FINITE = "x holds infinite or undefined numbers."


class Workspace:
    """Back ends and warm starts that a solver keeps between calls; a copy or a pickle of it is empty."""

    def __init__(self) -> None:
        self._backends: dict[tuple[str, float, int], Backend] = {}
        self._memories: dict[tuple[object, ...], dict[int, Memory]] = {}

    def backend(self, name: str, eps_abs: float, max_iterations: int) -> Backend:
        """The kept back end of these settings, made when first asked for."""
        key = (name, eps_abs, max_iterations)
        if key not in self._backends:
            self._backends[key] = make_backend(name, eps_abs, max_iterations)
        return self._backends[key]

    def memory(self, problem: Problem) -> dict[int, Memory]:
        """The warm starts of the problems that have the shape of `problem`."""
        hard = 0 if problem.hard is None else problem.hard.m
        return self._memories.setdefault((problem.n, hard, problem.offsets.tobytes()), {})

    def clear(self) -> None:
        """Forget everything."""
        self._backends.clear()
        self._memories.clear()

    def __reduce__(self) -> tuple[object, ...]:
        return (Workspace, ())


def descend(
    cascade: Cascade, problem: Problem, secondary: FloatArray | None, tolerance: float
) -> tuple[FloatArray | None, Status, str]:
    """Hard rows, levels, distance to the secondary vector: (x or None, status, the sentence that explains it)."""
    stacked = with_hard_rows(problem)
    matrix, lower, upper, offsets = stacked
    starts = offsets.tolist()
    try:
        with np.errstate(all="ignore"):
            least_violation = cascade.x
            if starts[1] and problem.hard is not None:
                # Each hard row scaled by its own power of two; they come with slack, so that there always is an answer.
                m = starts[1]
                cascade.minimize(matrix[:m], lower[:m], upper[:m], HARD, row_by_row=True)
                least_violation = cascade.x.copy()
                conflict = _conflict(problem.hard, least_violation, tolerance) if cascade.iterations else ""
                if conflict:
                    return None, Status.INFEASIBLE, conflict
            for k, name in enumerate(problem.names):
                a, b = starts[k + 1], starts[k + 2]
                low = lower[a:b]
                cascade.minimize(matrix[a:b], low, low if upper is lower else upper[a:b], name)
            cascade.nearest(cascade.start, "the distance to the secondary vector")
            if not math.isfinite(float(cascade.x.sum())):
                return None, Status.NOT_FINITE, NOT_FINITE
            fault = fault_of(problem, cascade.x, secondary, tolerance, stacked=stacked)
            conflict = _conflict(problem.hard, least_violation, tolerance) if fault and problem.hard is not None else ""
    except (OverflowError, ValueError, np.linalg.LinAlgError):  # numba's SVD meets an overflow that arose on the way
        return None, Status.NOT_FINITE, NOT_FINITE
    if conflict:
        return None, Status.INFEASIBLE, conflict
    if not fault:
        return cascade.x, Status.SOLVED, ""
    message = " ".join([fault, *(f"{remark}." for remark in cascade.remarks)])
    return cascade.x, Status.ITERATION_LIMIT if cascade.hit_limit else Status.INACCURATE, message


def _conflict(hard: Level, x: FloatArray, tolerance: float) -> str:
    """A sentence that names the rows in conflict when x (n,) violates hard rows and proves that every point does, else ""."""
    return contradiction(hard, x) if hard_excess(hard, x) > tolerance else ""
