"""The right answer of a problem, without trusting any solver: exact rational arithmetic or multi-precision."""

from __future__ import annotations

import dataclasses

import numpy as np
from flint import fmpz_mat
from numpy.typing import ArrayLike

from hqp_rp.core.diagnostics import checked_point, norm, normalised, two_norm, violation
from hqp_rp.core.errors import ProblemError, SettingError
from hqp_rp.core.level_damping import as_reached
from hqp_rp.core.metric import in_metric
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.tolerances import ROUNDED
from hqp_rp.core.truth_exact import AffineSet, Rows, Unit, exact_norm, matrix_of, metric_rows, stacked_ranks
from hqp_rp.core.truth_rule import BORDERLINE, solve_by_rule

SAME = 1e-8
"""Relative distance of two answers to a problem with inequality rows that are one: the rows that bind are guessed within
`truth_rows.NEAR` of their bounds."""


@dataclasses.dataclass(frozen=True, slots=True)
class Truth:
    """The lexicographic least-norm optimum of a problem.

    Attributes:
        x: (n,) the optimum, each entry rounded once to float64; None when the hard rows contradict each other.
        residuals: (p,) ||violation of level k||_2 at the unrounded optimum.
        ranks: (p,) rank that each level adds to the ones before it, by the rank rule that was asked for. With inequality
            rows: of the rows that are active or violated at the optimum.
        ambiguous: the exact answer or its ranks and those of the library's rank rule differ, or a singular value is so near
            the rule's threshold that double precision may decide it either way: solvers of both opinions are right.
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


def truth(
    problem: Problem,
    secondary: ArrayLike | None = None,
    rank_rule: str | float = "exact",
    *,
    start: ArrayLike | None = None,
) -> Truth:
    """The lexicographic least-norm optimum, known without trusting any solver.

    With `rank_rule="exact"` every step is done in rational arithmetic on the problem's own floats: ranks are those of the
    numbers as they stand. With a number, singular values of A_k Z up to rank_rule * ||A_k||_2 are cut (Z an orthonormal
    basis of the null space of the rows before), decided in multi-precision; where the two are the same answer, the rational
    one is returned.

    Inequality and hard rows are solved by an active-set method in rational arithmetic, whose last step proves optimality
    exactly: some milliseconds up to about 10 unknowns; with a `start` near the optimum, a fraction of a second at 40. Where
    rounding of the coefficients alone decides, the rank rule's answer is that of the rows that bind, solved as equalities
    by the rule and accepted by `certify`.

    The working precision is set for the whole process while it runs: parallelize over processes, not threads.

    Args:
        problem: the problem.
        secondary: (n,) among all lexicographic optima the one nearest to this is returned; None means 0, the least norm.
        rank_rule: "exact", or a rank tolerance in (0, 1), for instance `RANK_TOLERANCE`.
        start: (n,) a guess of the optimum, such as a solver's answer, from which the search with inequality or hard rows
            starts; unused without them. It decides how long that takes, not what the exact answer is.

    With a metric W the nearest is meant in ||.||_W, W to the last bit, and the rank rule looks at A_k R^-1, W = R^T R.

    A level with damping is solved exactly as what it is; what it reached is rounded to double precision before the next level.

    Raises:
        ProblemError: `secondary` or `start` does not fit.
        SettingError: an unknown rank rule.
        WorkLimitError: the exact search with inequality rows would take too long.

    Source: equation (9) of the paper as an optimization problem; Escande, Mansard and Wieber 2014 for inequality rows.
    """
    tolerance = _checked_rule(rank_rule)
    exact, rule = truths(problem, secondary, RANK_TOLERANCE if tolerance is None else tolerance, start=start)
    return exact if tolerance is None or rule is None else rule


def truths(
    problem: Problem, secondary: ArrayLike | None, tolerance: float, *, start: ArrayLike | None = None
) -> tuple[Truth, Truth | None]:
    """`truth` by the exact rank rule, and by the rank tolerance where that may be another answer (else None).

    Arguments and errors as those of `truth`; `tolerance` in (0, 1).
    """
    if not isinstance(problem, Problem):
        raise ProblemError(f"problem is a {type(problem).__name__}; build it with hqp_rp.Problem([...]).")
    goal = np.zeros(problem.n) if secondary is None else checked_point(secondary, problem.n, "secondary")
    guess = None if start is None else checked_point(start, problem.n, "start")
    if problem.damping is not None:
        damped = _damped if problem.metric is None else _damped_in_metric
        return damped(problem, goal, tolerance, guess)
    if not problem.is_equality or (problem.hard is not None and problem.hard.m):
        return _with_inequalities(problem, goal, tolerance, guess)
    levels = [(level.A, level.lower) for level in problem.levels]
    exact_ranks = stacked_ranks([A for A, _ in levels], problem.n)
    if clear_cut(_in_metric(problem, [A for A, _ in levels]), exact_ranks, tolerance):
        return _rational(levels, goal, exact_ranks, "", problem.metric), None
    by_rule = solve_by_rule(levels, goal, tolerance, problem.metric)
    reason = _reason(exact_ranks, by_rule.ranks, by_rule.borderline, tolerance)
    method = f"{by_rule.bits}-bit arithmetic, rank tolerance {tolerance:g}"
    rule = Truth(by_rule.x, np.array(by_rule.residuals), by_rule.ranks, bool(reason), reason, method)
    return _rational(levels, goal, exact_ranks, reason, problem.metric), rule


def _in_metric(problem: Problem, matrices: list[FloatArray]) -> list[FloatArray]:
    """The same rows on y, where the problem has a metric."""
    if problem.metric is None:
        return matrices
    inverse = in_metric(problem).inverse
    return [A @ inverse for A in matrices]


def _damped_in_metric(
    problem: Problem, goal: FloatArray, tolerance: float, guess: FloatArray | None
) -> tuple[Truth, Truth | None]:
    """By the change of variables in double precision: damping rows are rounded, whichever variables they are in."""
    turned = in_metric(problem)
    start = turned.forth(guess)
    found = _damped(turned.problem, turned.root @ goal, tolerance, start)
    stated = [
        None if answer is None else _as_stated(problem, dataclasses.replace(answer, x=turned.back(answer.x)))
        for answer in found
    ]
    assert stated[0] is not None
    return stated[0], stated[1]


def _damped(
    problem: Problem, goal: FloatArray, tolerance: float, guess: FloatArray | None
) -> tuple[Truth, Truth | None]:
    def exact(step: Problem, secondary: FloatArray | None) -> Solution:
        found = truth(step, secondary, tolerance)  # what rounding makes of damping rows is no rank
        return Solution(step, found.x, Status.INFEASIBLE if found.x is None else Status.SOLVED)

    beside = not problem.is_equality or (problem.hard is not None and problem.hard.m > 0)
    reached = as_reached(problem, exact, band=ROUNDED if beside else 0.0)
    found = truths(reached, goal, tolerance, start=guess)
    return _as_stated(problem, found[0]), None if found[1] is None else _as_stated(problem, found[1])


def _as_stated(problem: Problem, answer: Truth) -> Truth:
    if answer.x is None:
        return answer
    residuals = np.array([norm(violation(level, answer.x)) for level in problem.levels])
    return dataclasses.replace(answer, residuals=residuals)


def _rational(
    levels: list[tuple[FloatArray, FloatArray]],
    secondary: FloatArray,
    ranks: tuple[int, ...],
    reason: str,
    metric: FloatArray | None = None,
) -> Truth:
    unit = Unit.fitting(levels, secondary)
    optima = AffineSet(len(secondary))
    for A, b in levels:
        optima.minimize(unit.rows(A, b))
    goal = unit.vector(secondary)
    if metric is not None and optima.dimension:
        last = metric_rows(metric, len(secondary))
        targets = [sum(a * b for a, b in zip(row, goal.numerators, strict=True)) for row in last]
        optima.minimize(Rows(matrix_of(last, len(secondary)), fmpz_mat(len(targets), 1, targets)))
    u = optima.nearest(goal)
    residuals = np.array([exact_norm(A, b, u, unit) for A, b in levels])
    return Truth(unit.floats(u), residuals, ranks, bool(reason), reason, "exact rational arithmetic")


def _with_inequalities(
    problem: Problem, secondary: FloatArray, tolerance: float, start: FloatArray | None
) -> tuple[Truth, Truth | None]:
    from hqp_rp.core.certificate import certify
    from hqp_rp.core.truth_active_set import solve_active_set
    from hqp_rp.core.truth_inequality import rule_answer

    method = "exact rational active set"
    answer = solve_active_set(problem, secondary, start)
    if answer is None:
        return Truth(None, np.full(problem.p, np.nan), (0,) * problem.p, False, "", method), None
    x, matrices = answer.x, answer.binding
    ranks = stacked_ranks(matrices, problem.n)
    reason = ""
    clear = clear_cut(_in_metric(problem, matrices), ranks, tolerance)
    if not clear:
        binding = solve_by_rule([(A, np.zeros(len(A))) for A in matrices], secondary, tolerance, problem.metric)
        reason = _reason(ranks, binding.ranks, binding.borderline, tolerance)
    rule = None
    # Ranks of the rows that bind do not show a row that rounding alone made bind: the certificate does.
    finite = bool(np.isfinite(x).all())
    if finite and not (clear and certify(problem, x, secondary, rank_tolerance=tolerance).ok):
        found = rule_answer(problem, secondary, tolerance, x, start)
        if found is None or found.x is None:
            reason = reason or f"At rank tolerance {tolerance:g} the certificate refuses the exact answer."
        elif norm(found.x - x) > SAME * (1.0 + norm(x)):
            reason = (
                f"Some rows are all but zero in the freedom that is left to them (below {tolerance:g} ||A_k||: rounding of "
                "the coefficients). In exact arithmetic they still decide; the rank rule leaves the decision to the levels "
                "after them."
            )
        if found is not None and reason:
            rule = dataclasses.replace(found, ambiguous=True, reason=reason)
    return Truth(x, answer.residuals, ranks[1:], bool(reason), reason, method), rule


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
