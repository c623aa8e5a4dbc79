"""What the solvers that stand on QPs share: kept workspaces, hard rows and levels brought to scale, the final verdict."""

from __future__ import annotations

import numpy as np

from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.qp_backend import Backend, make_backend
from hqp_rp.core.qp_level import Cascade, Memory, power_of_two_scale
from hqp_rp.core.solution import Status
from hqp_rp.core.verify import contradiction, fault_of, hard_excess

HARD = "the hard rows"


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


def minimize_rows(cascade: Cascade, A: FloatArray, lower: FloatArray, upper: FloatArray, name: str) -> None:
    """`cascade.minimize` on the level scaled by a power of two, which changes no digit."""
    e = power_of_two_scale(A)
    if e:
        A, lower, upper = np.ldexp(A, -e), np.ldexp(lower, -e), upper if upper is lower else np.ldexp(upper, -e)
    _refuse_overflow(cascade, lower, upper)
    cascade.minimize(A, lower, upper, name)


def _refuse_overflow(cascade: Cascade, lower: FloatArray, upper: FloatArray) -> None:
    """A bound that overflows in scaled units puts x beyond what floats hold: there is no answer."""
    if (lower == np.inf).any() or (upper == -np.inf).any():
        cascade.x = np.full_like(cascade.x, np.nan)


def minimize_hard_rows(cascade: Cascade, hard: Level | None, tolerance: float) -> str | None:
    """Bring `cascade` to a point that meets the hard rows, each scaled by its own power of two, and keep them.

    Returns a sentence that names the rows in conflict when it is proven that no such point exists, else None.
    """
    if hard is None or hard.m == 0:
        return None
    e = np.frexp(np.abs(hard.A).max(axis=1))[1]
    lower, upper = np.ldexp(hard.lower, -e), np.ldexp(hard.upper, -e)
    _refuse_overflow(cascade, lower, upper)
    cascade.minimize(np.ldexp(hard.A, -e[:, None]), lower, upper, HARD)
    if not np.isfinite(cascade.x).all() or hard_excess(hard, cascade.x) <= tolerance:
        return None
    return contradiction(hard, cascade.x) or None


def judge(
    cascade: Cascade,
    problem: Problem,
    tolerance: float,
    infeasible: str | None,
    secondary: FloatArray | None,
) -> tuple[Status, str]:
    """The status of a finished cascade and the sentence that explains it, from its final x alone (`fault_of`)."""
    if infeasible is not None:
        return Status.INFEASIBLE, infeasible
    if not np.isfinite(cascade.x).all():
        return Status.NOT_FINITE, "x holds infinite or undefined numbers."
    fault = fault_of(problem, cascade.x, secondary, tolerance)
    if not fault:
        return Status.SOLVED, ""
    message = " ".join([fault, *(f"{remark}." for remark in cascade.remarks)])
    return (Status.ITERATION_LIMIT if cascade.hit_limit else Status.INACCURATE), message
