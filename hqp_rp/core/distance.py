"""Distance of an answer to the lexicographic optimum, at the price that the problem's condition asks for."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core.diagnostics import checked_point, norm, normalised, two_norm
from hqp_rp.core.errors import SettingError
from hqp_rp.core.metric import in_metric
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.truth import Truth, truth

RESOLUTION = 1e-12
"""A double-precision reference serves where its own error is estimated below this, relative to 1 + ||x*||."""


@dataclasses.dataclass(frozen=True, slots=True)
class Distance:
    """How far x is from the optimum x*.

    Attributes:
        value: `||x - x*|| / (1 + ||x*||)`; nan when no x meets the hard rows.
        reference: how x* was computed: "double precision" or the `method` of the truth.
        error: estimated error of `value` that comes from the reference.
        ambiguous: the ranks of the problem are a matter of opinion (see `Truth`): x* is the library's rank rule's answer.
    """

    value: float
    reference: str
    error: float
    ambiguous: bool


def distance(
    problem: Problem,
    x: ArrayLike,
    secondary: ArrayLike | None = None,
    *,
    reference: str | Truth = "auto",
    rank_tolerance: float = RANK_TOLERANCE,
) -> Distance:
    """Distance of x to the lexicographic optimum, `||x - x*|| / (1 + ||x*||)`.

    Args:
        problem: the problem that x answers.
        x: (n,) finite.
        secondary: (n,) the free vector; None means 0 (least norm).
        reference: "auto" takes a double-precision recursion on orthonormal bases where its error estimate is below
            `RESOLUTION`, and `truth` elsewhere and for every problem with inequality or hard rows; "truth" always takes
            `truth`; a `Truth` is used as it is (its secondary vector is then the caller's affair).
        rank_tolerance: the rank rule, in (0, 1).

    Raises:
        ProblemError: x or secondary is not n finite numbers.
        SettingError: an unknown reference or rank rule.
    """
    point = checked_point(x, problem.n)
    goal = np.zeros(problem.n) if secondary is None else checked_point(secondary, problem.n, "secondary")
    if isinstance(reference, Truth):
        known = reference
    elif reference in ("auto", "truth"):
        if (
            reference == "auto"
            and problem.is_equality
            and problem.damping is None
            and (problem.hard is None or not problem.hard.m)
        ):
            answer, error = _cascade(problem, goal, rank_tolerance)
            if error <= RESOLUTION:
                return Distance(relative_distance(point, answer), "double precision", error, False)
        known = truth(problem, goal, rank_tolerance, start=point)
    else:
        raise SettingError(f'reference is {reference!r}; give "auto", "truth" or a Truth.')
    if known.x is None:
        return Distance(math.nan, known.method, 0.0, known.ambiguous)
    return Distance(relative_distance(point, known.x), known.method, float(np.finfo(np.float64).eps), known.ambiguous)


def _cascade(problem: Problem, goal: FloatArray, rank_tolerance: float) -> tuple[FloatArray, float]:
    """`orthogonal_cascade`, through the change of variables where there is a metric, whose condition the error grows by."""
    if problem.metric is None:
        return orthogonal_cascade(problem, goal, rank_tolerance)
    turned = in_metric(problem)
    answer, error = orthogonal_cascade(turned.problem, turned.root @ goal, rank_tolerance)
    return turned.inverse @ answer, error * (1.0 + two_norm(turned.root) * two_norm(turned.inverse)) ** 2


def relative_distance(x: FloatArray, y: FloatArray) -> float:
    """`||x - y|| / (1 + ||y||)`, without overflow."""
    with np.errstate(over="ignore"):
        return norm(x - y) / (1.0 + norm(y))


def orthogonal_cascade(problem: Problem, secondary: FloatArray, rank_tolerance: float) -> tuple[FloatArray, float]:
    """The optimum (n,) of an equality problem in double precision, and an estimate of its error over 1 + ||x||.

    x <- x + Z (A_k Z)^# (b_k - A_k x), Z <- Z null(A_k Z), by SVD; in the end x <- x + Z Z^T (secondary - x). The estimate
    is 8 n eps times the product over the levels of (1 + ||A_k|| / sigma_r), once more where a level is left with a
    residual; a singular value between 1e-15 and 1e-6 of ||A_k|| makes it infinite, since there the rank is not clear.
    """
    n = problem.n
    x, Z = np.zeros(n), np.eye(n)
    growth = 8.0 * n * float(np.finfo(np.float64).eps)
    for level in problem.levels:
        if level.m == 0:
            continue
        A, exponent = normalised(level.A)
        size = two_norm(A)
        b = np.ldexp(level.lower, -exponent)
        if Z.shape[1] == 0 or size == 0.0:
            continue
        U, sigma, Vt = np.linalg.svd(A @ Z)
        rank = int((sigma > rank_tolerance * size).sum())
        if rank < len(sigma) and sigma[rank] > 1e-15 * n * size:
            growth = math.inf
        if rank == 0:
            continue
        if sigma[rank - 1] <= 1e-6 * size:
            growth = math.inf
        step = (U[:, :rank].T @ (b - A @ x)) / sigma[:rank]
        x = x + Z @ (Vt[:rank].T @ step)
        Z = Z @ Vt[rank:].T
        condition = 1.0 + size / float(sigma[rank - 1])
        growth *= condition
        left = norm(A @ x - b)
        if left > 1e-12 * (size * norm(x) + norm(b)):
            growth *= condition
    return x + Z @ (Z.T @ (secondary - x)), growth
