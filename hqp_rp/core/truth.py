"""The right answer of a problem, without trusting any solver: exact rational arithmetic or multi-precision."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core.diagnostics import checked_point, normalised, two_norm
from hqp_rp.core.errors import ProblemError, SettingError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.truth_exact import AffineSet, Unit, exact_norm, stacked_ranks
from hqp_rp.core.truth_rule import BORDERLINE, solve_by_rule


@dataclasses.dataclass(frozen=True, slots=True)
class Truth:
    """The lexicographic least-norm optimum of a problem.

    Attributes:
        x: (n,) the optimum, each entry rounded once to float64; None when the hard rows contradict each other.
        residuals: (p,) ||violation of level k||_2 at the unrounded optimum.
        ranks: (p,) rank that each level adds to the ones before it, by the rank rule that was asked for. With inequality
            rows: of the rows that are active or violated at the optimum.
        ambiguous: the exact ranks and those of the library's rank rule differ, or a singular value is so near the rule's
            threshold that double precision may decide it either way: solvers of both opinions are right.
        reason: a sentence on why it is ambiguous; empty when it is not.
        method: how it was computed.
    """

    x: FloatArray | None
    residuals: FloatArray
    ranks: tuple[int, ...]
    ambiguous: bool
    reason: str
    method: str

    @property
    def feasible(self) -> bool:
        """False when no x meets the hard rows."""
        return self.x is not None


def truth(problem: Problem, secondary: ArrayLike | None = None, rank_rule: str | float = "exact") -> Truth:
    """The lexicographic least-norm optimum, known without trusting any solver.

    With `rank_rule="exact"` every step is done in rational arithmetic on the problem's own floats: ranks are those of the
    numbers as they stand. With a number, singular values of A_k Z up to rank_rule * ||A_k||_2 are cut (Z an orthonormal
    basis of the null space of the rows before), decided in multi-precision; where no singular value lies between zero and
    far above the threshold the two are the same answer, and the rational one is returned.

    Inequality and hard rows are solved by an active-set method in rational arithmetic, whose last step proves optimality
    exactly; it is meant for small problems (up to about 10 unknowns). Its ranks are exact; a `rank_rule` given as a
    number then only decides whether the answer is marked `ambiguous`.

    The working precision is set for the whole process while it runs: parallelize over processes, not threads.

    Args:
        problem: the problem.
        secondary: (n,) among all lexicographic optima the one nearest to this is returned; None means 0, the least norm.
        rank_rule: "exact", or a rank tolerance in (0, 1), for instance `RANK_TOLERANCE`.

    Raises:
        ProblemError: `secondary` does not fit.
        SettingError: an unknown rank rule.

    Source: equation (9) of the paper as an optimization problem; Escande, Mansard and Wieber 2014 for inequality rows.
    """
    if not isinstance(problem, Problem):
        raise ProblemError(f"problem is a {type(problem).__name__}; build it with hqp_rp.Problem([...]).")
    tolerance = _checked_rule(rank_rule)
    goal = np.zeros(problem.n) if secondary is None else checked_point(secondary, problem.n, "secondary")
    if not problem.is_equality or (problem.hard is not None and problem.hard.m):
        return _with_inequalities(problem, goal, RANK_TOLERANCE if tolerance is None else tolerance)
    levels = [(level.A, level.lower) for level in problem.levels]
    exact_ranks = stacked_ranks([A for A, _ in levels], problem.n)
    rule = RANK_TOLERANCE if tolerance is None else tolerance
    if clear_cut([A for A, _ in levels], exact_ranks, rule):
        return _rational(levels, goal, exact_ranks, "")
    by_rule = solve_by_rule(levels, goal, rule)
    reason = _reason(exact_ranks, by_rule.ranks, by_rule.borderline, rule)
    if tolerance is None:
        return _rational(levels, goal, exact_ranks, reason)
    method = f"{by_rule.bits}-bit arithmetic, rank tolerance {rule:g}"
    return Truth(by_rule.x, np.array(by_rule.residuals), by_rule.ranks, bool(reason), reason, method)


def _rational(
    levels: list[tuple[FloatArray, FloatArray]], secondary: FloatArray, ranks: tuple[int, ...], reason: str
) -> Truth:
    unit = Unit.fitting(levels, secondary)
    optima = AffineSet(len(secondary))
    for A, b in levels:
        optima.minimize(unit.rows(A, b))
    u = optima.nearest(unit.vector(secondary))
    residuals = np.array([exact_norm(A, b, u, unit) for A, b in levels])
    return Truth(unit.floats(u), residuals, ranks, bool(reason), reason, "exact rational arithmetic")


def _with_inequalities(problem: Problem, secondary: FloatArray, rule: float) -> Truth:
    from hqp_rp.core.truth_active_set import solve_active_set

    method = "exact rational active set"
    answer = solve_active_set(problem, secondary)
    if answer is None:
        return Truth(None, np.full(problem.p, np.nan), (0,) * problem.p, False, "", method)
    matrices = answer.binding
    ranks = stacked_ranks(matrices, problem.n)
    reason = ""
    if not clear_cut(matrices, ranks, rule):
        by_rule = solve_by_rule([(A, np.zeros(len(A))) for A in matrices], secondary, rule)
        reason = _reason(ranks, by_rule.ranks, by_rule.borderline, rule)
    return Truth(answer.x, answer.residuals, ranks[1:], bool(reason), reason, method)


def clear_cut(matrices: list[FloatArray], exact_ranks: tuple[int, ...], tolerance: float) -> bool:
    """Whether double precision proves that the rank rule gives the exact ranks.

    It does when, at each level, as many singular values as the exact rank says are above 1e-6 ||A_k||_2: the null-space
    bases are then accurate to about 1e-10, and the singular values that remain are zero by the exact rank.
    """
    floor = 1e-6
    if tolerance > floor / 100:
        return False
    Z = np.eye(matrices[0].shape[1])
    for A, rank in zip(matrices, exact_ranks, strict=True):
        if rank == 0 or Z.shape[1] == 0:
            continue
        scaled, _ = normalised(A)
        _, sigma, Vt = np.linalg.svd(scaled @ Z)
        if not sigma[rank - 1] > floor * two_norm(scaled):
            return False
        Z = Z @ Vt[rank:].T
    return True


def _reason(exact: tuple[int, ...], rule: tuple[int, ...], borderline: bool, tolerance: float) -> str:
    if exact != rule:
        return f"The ranks are {list(exact)} in exact arithmetic and {list(rule)} at rank tolerance {tolerance:g}."
    if borderline:
        return f"A singular value is within a factor {BORDERLINE:g} of the rank tolerance {tolerance:g}."
    return ""


def _checked_rule(rank_rule: str | float) -> float | None:
    if isinstance(rank_rule, str) and rank_rule == "exact":
        return None
    if isinstance(rank_rule, int | float) and not isinstance(rank_rule, bool) and 0.0 < rank_rule < 1.0:
        return float(rank_rule)
    raise SettingError(f'rank_rule is {rank_rule!r}; give "exact" or a rank tolerance between 0 and 1, such as 1e-12.')
