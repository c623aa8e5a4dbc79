"""Saturation in the null space (SNS): task priority that saturates unknowns at hard bounds and, at last, scales the task."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from hqp_rp.core.closed_form import zeros
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE, Solver

_SATURATED = 1e-12  # relative: an unknown this near to its bound is held there
_OVERFLOW = "An intermediate result overflowed; scale the rows or the right-hand sides."


class ScaledSolution(Solution):
    """A `Solution` that also says how far each level was scaled.

    Attributes:
        scales: (p,) the scale s_k in [0, 1] at which level k was executed, `A_k x = s_k b_k`; 1 where nothing had to be
            scaled, 0 where the level was stopped or left as the levels before it had made it.
    """

    __slots__ = ("scales",)

    scales: FloatArray


@dataclasses.dataclass(frozen=True, kw_only=True)
class SaturationNullSpace(Solver):
    """The SNS algorithm on N levels of equalities with hard bounds on the unknowns.

    Level k corrects x_{k-1} in the freedom that earlier levels left. Where the correction would leave the box, the unknown
    that limits the level most is held at its bound, the correction is computed anew in the freedom of the others, and
    so on; when holding one more would cost the level its rank, it is executed at the largest scale s_k that was
    found, `A_k x = s_k b_k`: direction kept, size reduced.

    It is the basic algorithm of the sources. Neither its optimal variant, which releases unknowns whose multiplier has
    the wrong sign, nor its faster factorization updates are implemented: without saturation the answer is that of
    `null_space`, with saturation it meets the bounds and keeps priorities, but need not be the lexicographic optimum.

    Ours, not the sources': orthonormal null-space bases in the place of projectors; the start, `zeta` clipped to the
    box, which makes a box that excludes 0 (the way back into limits) feasible at every level; a level that no scale makes
    feasible is left as it came and still kept from lower levels; for dependent tasks, "full rank" is the rank
    that the level has without saturation.

    Args:
        rank_tolerance: a singular value of A_k restricted to the remaining null space counts as zero when it is
            <= rank_tolerance * ||A_k||_2; in [0, 1).

    Returns a `ScaledSolution`; `iterations` is the number of saturations tried. Hard rows with more than one unknown and
    two-sided levels are refused.

    Source: Flacco, De Luca and Khatib 2012 (N levels); Flacco, De Luca and Khatib 2015.
    """

    rank_tolerance: float = RANK_TOLERANCE

    name: ClassVar[str] = "saturation_null_space"
    summary: ClassVar[str] = "null-space priority that saturates unknowns at hard bounds, then scales the task"
    source: ClassVar[str] = "Flacco, De Luca and Khatib 2012, 2015"
    takes_hard: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not isinstance(self.rank_tolerance, int | float) or not 0.0 <= self.rank_tolerance < 1.0:
            raise SettingError(f"rank_tolerance is {self.rank_tolerance!r}; it must be a number in [0, 1).")

    def is_lexicographic(self, problem: Problem) -> bool:
        """True for equality levels without hard rows, where it is the null-space cascade."""
        return problem.is_equality and (problem.hard is None or not problem.hard.m)

    def refuses(self, problem: Problem) -> str | None:
        """Two-sided levels, and hard rows that bound more than one unknown each."""
        if problem.hard is not None:
            wide = np.flatnonzero(np.count_nonzero(problem.hard.A, axis=1) > 1)
            if wide.size:
                return (
                    f"saturation_null_space takes hard bounds on single unknowns only; hard row {wide[0]} has several "
                    "non-zero entries. Use a solver that takes general rows, such as qp_cascade."
                )
        return super().refuses(problem)

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """The SNS answer; see `Solver.solve`. A box without a point ends in `Status.INFEASIBLE`, its rows named."""
        from hqp_rp.core.kernels import saturation

        if not problem.is_equality:
            refusal = self._refusal(problem)
            if refusal is not None:
                return refusal
        n = problem.n
        low, high = np.empty(n), np.empty(n)
        hard = problem.hard
        if hard is None or not hard.m:
            low.fill(-np.inf)
            high.fill(np.inf)
        else:
            first, second = saturation.box_of(
                hard.A.copy(), hard.lower.copy(), hard.upper.copy(), low, high, np.empty((n, 2), np.int64)
            )
            if first == -1:
                return Solution(problem, None, Status.REFUSED, message=self.refuses(problem) or "")
            if first >= 0:
                message = f"Hard rows {first}, {second} contradict each other: no x meets both."
                if second < 0:
                    message = f"Hard row {first} is a row of zeros that no x meets."
                return Solution(problem, None, Status.INFEASIBLE, 0, message, secondary)
        matrix, rhs, _, offsets = problem.stacked
        x, scales = np.empty(n), np.empty(problem.p)
        free = zeros(n) if secondary is None else secondary
        try:
            finite, tried = saturation.saturation_null_space(
                matrix, rhs, offsets, low, high, free, self.rank_tolerance, x, scales
            )
        except (ValueError, np.linalg.LinAlgError):  # numba's SVD meets an overflow that arose on the way
            finite, tried = False, 0
        if not finite:
            return Solution(problem, None, Status.NOT_FINITE, tried, _OVERFLOW, secondary)
        solution = ScaledSolution(problem, x, Status.SOLVED, tried, "", secondary)
        solution.scales = scales
        solution.held = _SATURATED
        return solution
