"""Saturation in the null space (SNS): task priority that saturates unknowns at hard bounds and, at last, scales the task."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np

from hqp_rp.core import _native
from hqp_rp.core.errors import SettingError
from hqp_rp.core.level_damping import solve_with_damped_targets
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.row_names import hard_rows_in_words
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE, Solver, checked_secondary, require_rank_tolerance
from hqp_rp.core.tolerances import SATURATED
from hqp_rp.core.variant import WITHIN, LineUp, Variant

VARIANTS = ("basic", "optimal")
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

    Level k corrects x_{k-1} in the freedom that earlier levels left. Where the correction would leave the box, unknowns are
    saturated, that is held at their bounds, and the correction is computed anew in the freedom of the others. A level that
    the box does not allow is scaled, `A_k x = s_k b_k` with s_k in [0, 1]: direction kept, size reduced.

    variant "basic": the unknown that limits the level most is saturated next; when holding one more would cost the level
    its rank, it is executed at the largest scale that was found. An unknown once saturated is never released. With
    saturation the answer meets the bounds and keeps priorities, but neither s_k nor x need be the best there is.

    variant "optimal" (Opt-SNS): saturated unknowns whose multiplier has the wrong sign are released, so that with
    A_j x* = s_j b_j of the levels before,

        s_k = max { s in [0, 1] : A_k x = s b_k, A_j x = s_j b_j (j < k), x in the box for some x },
        x   = argmin ||x - zeta|| over the box and A_j x = s_j b_j (j <= p), zeta the secondary vector or 0.

    Where no level is scaled this is the lexicographic optimum of least norm. Where one is, it is not: the exact optimum
    leaves the direction b_k for a smaller residual.

    Published: saturating the most critical unknown, scaling as the last resort, and (optimal) the release by the sign of
    the multipliers. Ours, not the sources', in both: orthonormal null-space bases in the place of projectors; the start,
    `zeta` clipped to the box, which makes a box that excludes 0 (the way back into limits) feasible at every level; a
    level that no scale makes feasible is left as it came and still kept from lower levels; for dependent tasks the rank
    that the level has without saturation, and the attainable part of b_k. Ours in "optimal": the order of the moves. The
    published loop starts from the unbounded answer, releases all wrong signs at once, and may cycle; here the box holds
    throughout while the level is raised step by step, one unknown is exchanged at a time (a parametric active set), and
    each level's x is the nearest to zeta rather than to x_{k-1}. The sources' fast variant, the basic answer by updated
    factorizations, is not implemented.

    Args:
        variant: "basic" or "optimal".
        rank_tolerance: a singular value of A_k restricted to the remaining null space counts as zero when it is
            <= rank_tolerance * ||A_k||_2; in [0, 1).

    A level with damping asks for what null-space priority would reach with that damping and no bounds; saturation and scaling
    begin from there.

    Returns a `ScaledSolution`; `iterations` is the number of saturations tried and releases. Hard rows with more than one
    unknown and two-sided levels are refused. Where "optimal" runs out of iterations (20 for each unknown and level), the
    status is `INACCURATE`: that level and those below it are the basic algorithm's. It is so too where a level is off
    `A_k x = s_k b_k` by more than the tolerance, which near a singularity may happen beside saturated unknowns.

    Source: Flacco, De Luca and Khatib 2012 (N levels); Flacco, De Luca and Khatib 2015 (both variants; the release is
    taken from the authors' public library sns_ik).
    """

    variant: str = "basic"
    rank_tolerance: float = RANK_TOLERANCE

    name: ClassVar[str] = "saturation_null_space"
    summary: ClassVar[str] = "null-space priority that saturates unknowns at hard bounds, then scales the task"
    source: ClassVar[str] = "Flacco, De Luca and Khatib 2012, 2015"
    takes_hard: ClassVar[bool] = True
    takes_damping: ClassVar[bool] = True
    takes_metric: ClassVar[bool] = True
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant(
                "saturation null space",
                {},
                WITHIN,
                "SNS, basic: saturates unknowns at their bounds, then scales the task",
            ),
            Variant(
                "saturation optimal",
                {"variant": "optimal"},
                WITHIN,
                "Opt-SNS: releases too; largest scale, then least norm",
            ),
        ),
        place=200,
        only_with="limits",
    )

    def __post_init__(self) -> None:
        if self.variant not in VARIANTS:
            raise SettingError(f"variant is {self.variant!r}; choose one of {', '.join(VARIANTS)}.")
        require_rank_tolerance(self.rank_tolerance)

    def is_lexicographic(self, problem: Problem) -> bool:
        """True for equality levels without hard rows, where it is the null-space cascade."""
        return problem.is_equality and (problem.hard is None or not problem.hard.m)

    def refuses(self, problem: Problem) -> str | None:
        """Two-sided levels, and hard rows that bound more than one unknown each."""
        if problem.hard is not None:
            wide = np.flatnonzero(np.count_nonzero(problem.hard.A, axis=1) > 1)
            if wide.size:
                named = hard_rows_in_words(problem, wide[:1])
                return (
                    f"saturation_null_space takes hard bounds on single unknowns only; h{named[1:]} has several "
                    "non-zero entries. Use a solver that takes general rows, such as hierarchical_active_set."
                )
            if problem.metric is not None and problem.hard.m and np.count_nonzero(problem.metric) > problem.n:
                return (
                    "saturation_null_space takes a metric beside hard rows where it is diagonal, so that a box stays a "
                    "box; use a solver that takes general rows, such as hierarchical_active_set."
                )
        return super().refuses(problem)

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """The SNS answer; see `Solver.solve`. A box without a point ends in `Status.INFEASIBLE`, its rows named."""
        if not problem.is_equality:
            refusal = self._refusal(problem)
            if refusal is not None:
                return refusal
        if secondary is not None:
            secondary = checked_secondary(secondary, problem.n)
        if problem.metric is not None:
            refusal = self._refusal(problem)
            return solve_in_metric(problem, secondary, self.solve) if refusal is None else refusal
        if problem.damping is not None:
            return solve_with_damped_targets(problem, secondary, self.rank_tolerance, self.solve)
        found: Any = _native.saturation_null_space(problem, secondary, self.rank_tolerance, self.variant == "optimal")
        if len(found) == 2:
            first, second = found
            if first == -1:
                return Solution(problem, None, Status.REFUSED, message=self.refuses(problem) or "")
            message = f"{hard_rows_in_words(problem, (first, second))} contradict each other: no x meets both."
            if second < 0:
                message = f"{hard_rows_in_words(problem, (first,))} is a row of zeros that no x meets."
            return Solution(problem, None, Status.INFEASIBLE, 0, message, secondary)
        x, scales, finite, tried, unfinished, missed = found
        if not finite:
            return Solution(problem, None, Status.NOT_FINITE, tried, _OVERFLOW, secondary)
        status, message = Status.SOLVED, ""
        if unfinished >= 0:
            status = Status.INACCURATE
            message = f"Iterations ran out at level {unfinished + 1}; from there on it is the basic algorithm's answer."
        elif missed >= 0:
            status = Status.INACCURATE
            message = (
                f"Rounding at the bounds left level {missed + 1} off its scaled task by more than {self.tolerance:g}."
            )
        solution = ScaledSolution(problem, x, status, tried, message, secondary)
        solution.scales = scales
        solution.held = SATURATED
        return solution
