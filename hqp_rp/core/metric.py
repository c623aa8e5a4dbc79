"""A metric on the unknown: weighted norms, weighted pseudo-inverses, and what is dynamically consistent, as one
change of variables.

With W = R^T R, R upper triangular, the problem with metric W is the plain problem of y = R x:

    lex min_y ( ||v_1||, ..., ||v_p||, ||y|| )    levels A_k R^-1, hard rows A R^-1, ||y||^2 = x^T W x = ||x||_W^2

So everything that a solver says of a norm is said of ||x||_W: the answer of least norm, the nearest to the secondary vector,
damping (eta ||x||_W in the place of eta ||x||), and the rank rule, on the singular values of A_k R^-1. Every
pseudo-inverse of a closed form becomes the weighted one,

    A^#W = R^-1 (A R^-1)^# = W^-1 A^T (A W^-1 A^T)^-1    (the last for a regular A)

which for the joint-space inertia W = M(q) is the dynamically consistent one. Multiplying W by a number changes no
undamped answer.

Source: Whitney 1969 for the weighted least norm; the paper, (6)-(7), for its weight matrix; Khatib 1987 for W = M.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core import _native
from hqp_rp.core.errors import ProblemError
from hqp_rp.core.level import FloatArray, Level, frozen
from hqp_rp.core.problem import Problem
from hqp_rp.core.row_names import take_row_names
from hqp_rp.core.solution import Solution

_SYMMETRIC = 1e-12


class Turned(NamedTuple):
    """A problem in y = root x, without metric; root (n, n) is upper triangular, inverse (n, n) its inverse."""

    problem: Problem
    root: FloatArray
    inverse: FloatArray

    def forth(self, x: FloatArray | None) -> FloatArray | None:
        """y for x; None for None."""
        return None if x is None else self.root @ x

    def back(self, y: FloatArray | None) -> FloatArray | None:
        """x for y; None for None."""
        return None if y is None else self.inverse @ y


def checked_metric(metric: ArrayLike, n: int) -> FloatArray:
    """W (n, n), read-only, from a symmetric positive definite matrix or from (n,) positive numbers, its diagonal.

    Raises `ProblemError` for one of another shape, not finite, not symmetric or not positive definite.
    """
    try:
        W = np.array(metric, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise ProblemError(f"metric is {metric!r}; give a symmetric positive definite matrix ({n}, {n}).") from None
    if W.ndim == 1:
        W = np.diag(W)
    if W.shape != (n, n):
        raise ProblemError(f"metric has shape {np.shape(metric)}; it must be ({n}, {n}), or ({n},) for a diagonal.")
    if not np.isfinite(W).all():
        i, j = np.argwhere(~np.isfinite(W))[0]
        raise ProblemError(f"metric[{i}, {j}] is {W[i, j]}; every entry must be finite.")
    if np.abs(W - W.T).max() > _SYMMETRIC * np.abs(W).max():
        raise ProblemError("metric is not symmetric; give (W + W.T) / 2 if that is what is meant.")
    W = 0.5 * (W + W.T)
    try:
        np.linalg.cholesky(W)
    except np.linalg.LinAlgError:
        least = float(np.linalg.eigvalsh(W)[0])
        raise ProblemError(
            f"metric is not positive definite (smallest eigenvalue {least:g}); every direction needs a positive weight."
        ) from None
    return frozen(W)


def in_metric(problem: Problem) -> Turned:
    """A problem with a metric as the plain problem that it is; made once.

    Raises `ProblemError` for a metric, given unchecked, that is not positive definite.
    """
    return problem._once("in metric", lambda: _turned(problem))


def solve_in_metric(
    problem: Problem, secondary: FloatArray | None, solve: Callable[[Problem, FloatArray | None], Solution]
) -> Solution:
    """The answer to a problem with a metric by a solver of problems without."""
    turned = in_metric(problem)
    found = solve(turned.problem, turned.forth(secondary))
    found.x = turned.back(found.x)
    found.problem, found.secondary = problem, secondary
    return found


def symmetric_root(W: FloatArray) -> tuple[FloatArray, FloatArray]:
    """W^(1/2) and W^(-1/2) (n, n), by eigenvalues: the certificate's own, beside the Cholesky factor of the solvers."""
    values, vectors = np.linalg.eigh(W)
    roots = np.sqrt(np.maximum(values, np.finfo(np.float64).tiny))
    return (vectors * roots) @ vectors.T, (vectors / roots) @ vectors.T


def with_inverse(problem: Problem, inverse: FloatArray) -> Problem:
    """The problem of y, x = inverse y, without metric: every row times `inverse` (n, n)."""
    matrix, lower, upper, offsets = problem.stacked
    hard = problem.hard
    if hard is not None:
        hard = Level(hard.A @ inverse, hard.lower, hard.upper, name=hard.name)
    return Problem.from_stacked(
        matrix @ inverse,
        lower,
        upper,
        offsets,
        names=problem.names,
        hard=hard,
        damping=problem.damping,
        check=False,
    )


def _turned(problem: Problem) -> Turned:
    assert problem.metric is not None
    found = _native.metric_root(problem.metric)
    if found is None:
        raise ProblemError("metric is not positive definite; give a symmetric positive definite matrix.")
    root, inverse = found
    if problem.on_top:
        made = Problem.from_rows(
            problem.given @ inverse,
            problem.given_lower,
            problem.given_upper,
            problem.given_offsets,
            problem.names,
            problem.hard_rows,
            problem.is_equality,
            problem.damping,
        )
    else:
        made = with_inverse(problem, inverse)
    take_row_names(problem, made)
    return Turned(made, root, inverse)
