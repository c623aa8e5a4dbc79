"""What the solvers that stand on QPs share: kept workspaces, hard rows and levels brought to scale, the final verdict."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.qp_backend import Backend, make_backend
from hqp_rp.core.qp_level import Cascade, Check, Memory, norm, power_of_two_scale
from hqp_rp.core.solution import Status

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

    Returns a sentence that names the rows in conflict when no such point exists, else None.
    """
    if hard is None or hard.m == 0:
        return None
    e = np.frexp(np.abs(hard.A).max(axis=1))[1]
    lower, upper = np.ldexp(hard.lower, -e), np.ldexp(hard.upper, -e)
    _refuse_overflow(cascade, lower, upper)
    cascade.minimize(np.ldexp(hard.A, -e[:, None]), lower, upper, HARD)
    check = cascade.checks[-1]
    violation, allowed = _hard_violation(check, cascade.x, tolerance)
    if (violation <= allowed).all():
        return None
    # What remains however x moves: the part of the violation that duality proves.
    avoidable = check.avoidable(cascade.x)[0]
    least = math.sqrt(max(0.0, norm(violation) ** 2 - avoidable**2)) if check.basis is not None else check.least
    if least <= norm(allowed):
        return None
    rows = np.flatnonzero(violation > 1e-6 * violation.max())
    original = np.ldexp(violation, e)
    named = ", ".join(str(int(i)) for i in rows[:8]) + (", ..." if len(rows) > 8 else "")
    subject = f"Hard rows {named} contradict each other" if len(rows) > 1 else f"Hard row {named} cannot be met"
    return (
        f"{subject}: the x of least violation still misses by {original.max():.3g}. "
        "Loosen these rows, or move them to a level."
    )


def judge(cascade: Cascade, hard: Level | None, tolerance: float, infeasible: str | None) -> tuple[Status, str]:
    """The status of a finished cascade, from the residuals at its final x alone, and the sentence that explains it."""
    if infeasible is not None:
        return Status.INFEASIBLE, infeasible
    if not np.isfinite(cascade.x).all():
        return Status.NOT_FINITE, "x holds infinite or undefined numbers."
    faults = []
    for check in cascade.checks:
        if check.name == HARD and hard is not None:
            violation, allowed = _hard_violation(check, cascade.x, tolerance)
            if not (violation <= allowed).all():
                row = int(np.argmax(violation - allowed))
                faults.append(
                    f"hard row {row} is violated by {violation[row] / max(allowed[row], 1e-300) * tolerance:.3g} "
                    f"of its scale, allowed {tolerance:.3g}"
                )
            continue
        avoidable, scale = check.avoidable(cascade.x)
        if not math.isfinite(avoidable):
            return Status.NOT_FINITE, f"The residual of {check.name} overflows."
        if avoidable > tolerance * scale:
            faults.append(
                f"{check.name}: avoidable residual up to {avoidable / scale:.3g} of its scale, allowed {tolerance:.3g}"
            )
    if not faults:
        return Status.SOLVED, ""
    message = "; ".join(faults + cascade.remarks) + "."
    return (Status.ITERATION_LIMIT if cascade.hit_limit else Status.INACCURATE), message


def _hard_violation(check: Check, x: FloatArray, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """(violation, allowed violation) of each hard row, in scaled units."""
    value = check.A @ x
    target = np.clip(value, check.lower, check.upper)
    return np.abs(value - target), tolerance * (np.linalg.norm(check.A, axis=1) * norm(x) + np.abs(target))
