"""The derivative of an answer with respect to everything that states its problem: matrix, bounds, secondary vector, metric.

Near its data an answer is that of a hierarchy of equalities, blocks B_1 x = b_1, ..., B_q x = b_q, each of least squares in the
freedom that the blocks before it leave. Without inequalities a block is a level. With them, a block is the rows of a level that
count, its equalities and those that x violates, at the bound they miss; or satisfied rows that a later level presses against
their bounds: a block of its own, right before the first level that does. With Z_i an orthonormal basis of the null space of
blocks 1 ... i, and B_i Z_{i-1} = U_i S_i V_i^T of the rank r_i that counts,

    x = sum_i Q_i y_i + Z_q Z_q^T zeta,    Q_i = Z_{i-1} V_i,    P_i = U_i S_i^-1 Q_i^T    (m_i, n)

zeta the secondary vector. What the answer satisfies at every level, and what the last term adds,

    Z_{i-1}^T B_i^T r_i = 0,   r_i = B_i x - b_i        Z_q^T (x - zeta) = 0

is differentiated. As long as ranks stay as they are, dZ_i = -C_i^+ dC_i Z_i with C_i = [B_1; ...; B_i], so that the change of
the basis enters only through the multipliers of a level's residual, B_i^T r_i + sum_{j<i} B_j^T lambda_j = 0, and mu of the
norm, x - zeta + sum_j B_j^T mu_j = 0:

    dx_i = P_i^T (db_i - dB_i x - B_i (dx_1 + ... + dx_{i-1})) - P_i^T P_i (dB_i^T r_i + sum_{j<i} dB_j^T lambda_j)
    dx   = dx_1 + ... + dx_q + Z_q Z_q^T (dzeta - sum_j dB_j^T mu_j)

The transpose of that runs backwards. From h = xbar and c = Z_q Z_q^T h, for i = q ... 1,

    t_i = P_i h,    h <- h - B_i^T t_i,    c_i = P_i^T t_i

    b_i: t_i        B_i: -t_i x^T - mu_i c^T - r_i c_i^T - sum_{l>i} lambda_i(l) c_l^T        zeta: c

and the multipliers are the same sweep from -B_i^T r_i, or from zeta - x. With a metric W = R^T R all of this is said of R x and
A R^-1, and W gets -R^-1 c (x - zeta)^T, made symmetric.

Where it exists: every B_i Z_{i-1} has full rank min(m_i, d_{i-1}), hard rows have all their rank; no satisfied row touches its
bound without being held there by a multiplier, and no multiplier has the wrong sign; rows held together are independent. Else
the answer has a kink or a jump there, and `NotDifferentiableError` says in which row or level. Rank alone may be
waived: see `constant_rank` of `SolutionDerivative`.

Source: Golub and Pereyra 1973 for a pseudo-inverse of constant rank; Fiacco 1983 and Amos and Kolter 2017 for active rows
under strict complementarity. The hierarchy of them is ours.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core.diagnostics import checked_point, require_tolerance
from hqp_rp.core.equality_blocks import EqualityBlocks, NotDifferentiableError
from hqp_rp.core.errors import ProblemError, SettingError
from hqp_rp.core.level import FloatArray
from hqp_rp.core.problem import Problem
from hqp_rp.core.solution import Solution

__all__ = ["NotDifferentiableError", "ProblemGradient", "SolutionDerivative", "jvp", "vjp"]

TOLERANCE = 1e-9
"""Default of `SolutionDerivative`: what is this near to a change of rank or of active rows has no derivative."""

KEEPS = 1e-8
"""A direction keeps a rank where no more than this part of it leaves the range of the rows."""


@dataclasses.dataclass(frozen=True, slots=True)
class ProblemGradient:
    """The gradient of a number with respect to the data of a problem, in the shapes of the data.

    Attributes:
        matrix: (M, n), of `Problem.matrix`.
        lower, upper: (M,), of the bounds; zero for a bound that does not determine the answer. An equality's two bounds move
            together, so each has half of the gradient of b: what depends on b alone takes `rhs`.
        hard_matrix, hard_lower, hard_upper: (h, n), (h,), (h,), the same of the hard rows.
        secondary: (n,), of the secondary vector (of 0 where none was given).
        metric: (n, n), symmetric, of the metric; None where the problem has none.
    """

    matrix: FloatArray
    lower: FloatArray
    upper: FloatArray
    hard_matrix: FloatArray
    hard_lower: FloatArray
    hard_upper: FloatArray
    secondary: FloatArray
    metric: FloatArray | None

    @property
    def rhs(self) -> FloatArray:
        """(M,) lower + upper: the gradient of b of equalities A x = b."""
        return self.lower + self.upper


class SolutionDerivative:
    """The derivative of one answer with respect to its data: factored once, then applied to as many directions as you like.

    Args:
        problem: without damped levels.
        solution: an answer to it in which `Solution.require` finds an x, the lexicographic optimum, from a solver that says
            which rows are active (`Solution.active`) or of a problem of equalities alone.
        constant_rank: False refuses a level whose rank is less than its rows and its freedom allow, since almost every change
            of the matrix raises that rank, and x jumps. True gives the derivative among the changes that keep every rank: rows
            that stay parallel to those of a level before, columns of locked joints, and all changes of bounds alone. `jvp`
            refuses a direction in which a rank changes; a gradient of `vjp` holds for chains through data that keep the ranks.
        tolerance: relative; a singular value of A_k Z_{k-1} below this times ||A_k||_2, a satisfied row nearer than this
            to a bound that does not hold it, and a multiplier below this are too near to a change: no derivative. >= 0.

    Attributes:
        x: (n,) the answer, computed once more from its active rows.

    The formula and where it exists: see this module, `hqp_rp.core.derivative`.

    Raises:
        NotDifferentiableError: the conditions do not hold, levels are damped, x is not the lexicographic optimum, or the solver
            does not say which rows are active.
        NoSolutionError: the solution has no x that may be used.
        ProblemError: the solution answers another problem. SettingError: a tolerance that is none.
    """

    def __init__(
        self, problem: Problem, solution: Solution, *, constant_rank: bool = False, tolerance: float = TOLERANCE
    ) -> None:
        require_tolerance("tolerance", tolerance)
        if not isinstance(constant_rank, bool | np.bool_):
            raise SettingError(f"constant_rank is {constant_rank!r}; it must be True or False.")
        x = solution.require(inaccurate=True)
        if solution.problem is not problem and not _same(solution.problem, problem):
            raise ProblemError(
                f"The solution answers another problem, {solution.problem!r}, than the one given, {problem!r}: "
                "give the problem that was solved, solution.problem."
            )
        if problem.damping is not None:
            raise NotDifferentiableError(
                "The problem has levels with damping, whose policies look at the data by themselves; this derivative is that "
                "of undamped levels: leave the damping out, or let a lower level say what small motions are worth."
            )
        self.problem = problem
        self._blocks = EqualityBlocks(problem, solution, x, bool(constant_rank), tolerance)
        blocks = self._blocks
        self.x: FloatArray = blocks.at if blocks.inverse is None else blocks.inverse @ blocks.at
        self._from_zeta = self.x - (0.0 if solution.secondary is None else np.asarray(solution.secondary))

    def vjp(self, x_bar: ArrayLike) -> ProblemGradient:
        """The gradient of a number with respect to the data, from its gradient with respect to x.

        Args:
            x_bar: (n,) d(number)/dx.

        Raises:
            ProblemError: x_bar is not n finite numbers.
        """
        blocks = self._blocks
        root, inverse = blocks.root, blocks.inverse
        xbar = checked_point(x_bar, self.problem.n, "x_bar")
        if inverse is not None:
            xbar = inverse.T @ xbar
        c = blocks.Z @ (blocks.Z.T @ xbar)
        t = blocks.sweep(xbar - c, len(blocks.blocks))
        matrix = np.outer(-t, blocks.at)
        for number, weights in blocks.pulls:
            pulled = c
            if number < len(blocks.blocks):
                block = blocks.blocks[number]
                pulled = block.P.T @ t[block.rows]
            matrix -= np.outer(weights, pulled)
        matrix *= blocks.unit[:, None]
        t *= blocks.unit
        lower = np.where(blocks.equality, 0.5 * t, np.where(blocks.side < 0, t, 0.0))
        upper = t - lower
        secondary, metric = c, None
        if root is not None and inverse is not None:
            matrix, secondary = matrix @ inverse.T, root.T @ c
            one = np.outer(inverse @ c, self._from_zeta)
            metric = -0.5 * (one + one.T)
        h = self.problem.hard_rows
        return ProblemGradient(matrix[h:], lower[h:], upper[h:], matrix[:h], lower[:h], upper[:h], secondary, metric)

    def jvp(
        self,
        matrix_dot: ArrayLike | None = None,
        lower_dot: ArrayLike | None = None,
        upper_dot: ArrayLike | None = None,
        *,
        hard_matrix_dot: ArrayLike | None = None,
        hard_lower_dot: ArrayLike | None = None,
        hard_upper_dot: ArrayLike | None = None,
        secondary_dot: ArrayLike | None = None,
        metric_dot: ArrayLike | None = None,
    ) -> FloatArray:
        """x-dot (n,) from the rates of the data, each in its shape (see `ProblemGradient`); None: it does not move.

        The two bounds of an equality must move alike: both rates given, or `lower_dot=b_dot, upper_dot=b_dot`.

        Raises:
            ProblemError: a rate of another shape, not finite, of a metric that the problem has not or not symmetric.
            NotDifferentiableError: an equality's bounds part, or (with constant_rank) a rank changes.
        """
        blocks = self._blocks
        root, inverse = blocks.root, blocks.inverse
        n, h, M = self.problem.n, self.problem.hard_rows, self.problem.rows
        B_dot = np.concatenate(
            (_rate("hard_matrix_dot", hard_matrix_dot, (h, n)), _rate("matrix_dot", matrix_dot, (M, n)))
        )
        low = np.concatenate((_rate("hard_lower_dot", hard_lower_dot, (h,)), _rate("lower_dot", lower_dot, (M,))))
        high = np.concatenate((_rate("hard_upper_dot", hard_upper_dot, (h,)), _rate("upper_dot", upper_dot, (M,))))
        parted = np.flatnonzero(blocks.equality & (low != high))
        if len(parted):
            raise NotDifferentiableError(
                f"{blocks.named(parted[0])} is an equality whose bounds would part, at rates {low[parted[0]]:g} and "
                f"{high[parted[0]]:g}: give both bounds the same rate."
            )
        zeta_dot = _rate("secondary_dot", secondary_dot, (n,))
        if root is not None and inverse is not None:
            B_dot, zeta_dot = B_dot @ inverse, root @ zeta_dot
            W_dot = _rate("metric_dot", metric_dot, (n, n))
            if not np.allclose(W_dot, W_dot.T, rtol=1e-12, atol=0.0):
                raise ProblemError("metric_dot is not symmetric; give (W_dot + W_dot.T) / 2 if that is what is meant.")
            zeta_dot = zeta_dot - inverse.T @ (W_dot @ self._from_zeta)
        elif metric_dot is not None:
            raise ProblemError(
                "metric_dot is given and the problem has no metric; leave it out, or state the problem with one."
            )
        B_dot = B_dot * blocks.unit[:, None]
        b_dot = np.where(blocks.side < 0, low, high) * blocks.unit
        pulls = dict(blocks.pulls)
        dx = np.zeros(n)
        for i, block in enumerate(blocks.blocks):
            if block.Z is not None:
                self._require_rank(i, block.Z, B_dot)
            step = b_dot[block.rows] - B_dot[block.rows] @ blocks.at - block.B @ dx
            if i in pulls:
                step = step - block.P @ (B_dot.T @ pulls[i])
            dx = dx + block.P.T @ step
        dx = dx + blocks.Z @ (blocks.Z.T @ (zeta_dot - B_dot.T @ pulls[len(blocks.blocks)]))
        return dx if inverse is None else inverse @ dx

    def _require_rank(self, last: int, Z: FloatArray, B_dot: FloatArray) -> None:
        """Raises unless the rank of block `last` stays: dC Z within the range of C, C all blocks up to it."""
        dZ = np.zeros_like(Z)
        for block in self._blocks.blocks[:last]:
            dZ = dZ - block.P.T @ (B_dot[block.rows] @ Z + block.B @ dZ)
        own = self._blocks.blocks[last]
        missing = B_dot[own.rows] @ Z + own.B @ dZ
        outside = missing - own.U @ (own.U.T @ missing)
        if np.linalg.norm(outside) > KEEPS * np.linalg.norm(B_dot):
            level = self._blocks.level_named(int(own.rows[0]))
            raise NotDifferentiableError(
                f"The rank of {level} changes in this direction, and the answer jumps: give one that keeps the rank."
            )


def vjp(
    problem: Problem,
    solution: Solution,
    x_bar: ArrayLike,
    *,
    constant_rank: bool = False,
    tolerance: float = TOLERANCE,
) -> ProblemGradient:
    """Vector-Jacobian product: d(number)/d(data) from x_bar (n,) = d(number)/dx, for an answer to a prioritized problem.

    Arguments, conditions and errors are those of `SolutionDerivative` and its `vjp`, which is worth having by itself where
    one answer is differentiated in more than one direction.
    """
    return SolutionDerivative(problem, solution, constant_rank=constant_rank, tolerance=tolerance).vjp(x_bar)


def jvp(
    problem: Problem,
    solution: Solution,
    matrix_dot: ArrayLike | None = None,
    lower_dot: ArrayLike | None = None,
    upper_dot: ArrayLike | None = None,
    *,
    constant_rank: bool = False,
    tolerance: float = TOLERANCE,
    **others: Any,
) -> FloatArray:
    """Jacobian-vector product: x-dot (n,) from the rates of the data, matrix_dot (M, n), lower_dot and upper_dot (M,).

    Arguments, conditions and errors are those of `SolutionDerivative` and its `jvp`; None means that it does not move.
    others: the keyword arguments of that `jvp`, the rates of hard rows, secondary vector and metric.
    """
    found = SolutionDerivative(problem, solution, constant_rank=constant_rank, tolerance=tolerance)
    return found.jvp(matrix_dot, lower_dot, upper_dot, **others)


def _rate(name: str, given: ArrayLike | None, shape: tuple[int, ...]) -> FloatArray:
    if given is None:
        return np.zeros(shape)
    try:
        rate = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise ProblemError(f"{name} is {given!r}; it must be finite numbers of shape {shape}.") from None
    if rate.shape != shape:
        raise ProblemError(f"{name} has shape {rate.shape}; it must have that of the data, {shape}.")
    if not np.isfinite(rate).all():
        raise ProblemError(f"{name} has entries that are not finite; every rate must be a finite number.")
    return rate


def _same(one: Problem | None, other: Problem) -> bool:
    """Whether two problems state the same numbers."""
    if one is None:
        return False
    pairs = zip(one.with_hard, other.with_hard, strict=True)
    if not all(np.array_equal(a, b) for a, b in pairs) or one.hard_rows != other.hard_rows:
        return False
    if one.metric is None or other.metric is None:
        return one.metric is other.metric
    return np.array_equal(one.metric, other.metric)
