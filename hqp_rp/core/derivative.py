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
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hqp_rp.core.active import VIOLATED
from hqp_rp.core.diagnostics import checked_point, require_tolerance, rounding_at_zero, two_norm
from hqp_rp.core.errors import HqpError, ProblemError, SettingError
from hqp_rp.core.level import FloatArray, IntArray
from hqp_rp.core.metric import in_metric
from hqp_rp.core.problem import Problem
from hqp_rp.core.solution import Solution
from hqp_rp.core.tolerances import NEAR_ZERO, RANK

TOLERANCE = 1e-9
"""Default of `SolutionDerivative`: what is this near to a change of rank or of active rows has no derivative."""

AGREES = 1e-6
"""The given x must be that near, relative, to the optimum that its active rows give."""

KEEPS = 1e-8
"""A direction keeps a rank where no more than this part of it leaves the range of the rows."""


class NotDifferentiableError(HqpError, ArithmeticError):
    """An answer that has no derivative where it is, or not one that can be told; the message names the row or the level."""


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


class _Block(NamedTuple):
    """Rows B x = b that a step meets as well as it can, in the scale that they are computed in.

    Attributes:
        rows: (m,) which of all rows, hard ones first. B: (m, n). P: (m, n), U S^-1 Q^T.
        U: (m, r), orthonormal. Z: (n, d), basis of the freedom after it, or None while the rank is full.
        residual: (m,) B x - b, or None where all rows are met whatever the data.
    """

    rows: IntArray
    B: FloatArray
    P: FloatArray
    U: FloatArray
    Z: FloatArray | None
    residual: FloatArray | None


class _Pulled(NamedTuple):
    """A residual and its multipliers: of block `block`, or of the norm, which counts as a block after the last one.

    weights: (rows,) multipliers of all rows; r in the block's own.
    """

    block: int
    weights: FloatArray


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
        self.constant_rank = bool(constant_rank)
        self.tolerance = tolerance
        self._given = x
        self._zeta = np.zeros(problem.n) if solution.secondary is None else np.asarray(solution.secondary)
        matrix, lower, upper, offsets = problem.with_hard
        self._root: FloatArray | None = None
        self._inverse: FloatArray | None = None
        y = x
        if problem.metric is not None:
            turned = in_metric(problem)
            self._root, self._inverse = turned.root, turned.inverse
            matrix, y = matrix @ turned.inverse, turned.root @ x
        self._rows = matrix
        self._equality = lower == upper
        self._side, counts = self._active(solution)
        self._bound = np.where(self._side < 0, lower, upper)
        self._unit = np.zeros(len(matrix))
        self._largest = np.abs(matrix).max(axis=1, initial=0.0)
        self._blocks: list[_Block] = []
        self._Z = np.eye(problem.n)
        self._at = np.zeros(problem.n)
        self._size = _norm(y)
        self._build(counts, offsets)
        self._agree(y)
        self._pulls = self._multipliers()
        self.x: FloatArray = self._at if self._inverse is None else self._inverse @ self._at

    # --- which rows determine x ---------------------------------------------------------------------------------------

    def _active(self, solution: Solution) -> tuple[NDArray[np.int8], NDArray[np.bool_]]:
        """Sides (rows,), 0 for a row that does not determine x; which of the others count by their least squares."""
        if self._equality.all():
            return np.ones(len(self._equality), np.int8), np.ones(len(self._equality), np.bool_)
        problem, x = self.problem, self._given
        side = solution.active
        if side is None:
            raise NotDifferentiableError(
                "The solver does not say which rows are active (Solution.active is None); solve with one that does, "
                "hierarchical_active_set for instance."
            )
        matrix, lower, upper, _ = problem.with_hard
        value = matrix @ x
        lengths = _lengths(matrix)
        size = lengths * np.linalg.norm(x)
        noise = lengths * _rounding(problem, x, lengths)
        bound = np.clip(value, lower, upper)
        violated = np.abs(value - bound) > VIOLATED * (size + np.abs(bound)) + noise
        violated[: problem.hard_rows] = False
        with np.errstate(invalid="ignore"):
            above = value >= upper - self.tolerance * (size + np.abs(upper)) - noise
            below = value <= lower + self.tolerance * (size + np.abs(lower)) + noise
        touched = np.flatnonzero((side == 0) & (above & np.isfinite(upper) | below & np.isfinite(lower)))
        if len(touched):
            raise NotDifferentiableError(
                f"{self._named(touched[0])} touches its {'upper' if above[touched[0]] else 'lower'} bound without being held "
                "there: the answer has a kink, and one-sided derivatives only."
            )
        return side, self._equality | violated

    def _named(self, row: int) -> str:
        offsets = self.problem.with_hard.offsets
        level = int(np.searchsorted(offsets, row, side="right")) - 1
        return f"Row {row - offsets[level]} of {self._level(level)}"

    def _level(self, level: int) -> str:
        if level:
            return f"level {self.problem.names[level - 1]!r}"
        hard = self.problem.hard
        return f"the hard rows {hard.name!r}" if hard is not None and hard.name else "the hard rows"

    # --- the blocks ---------------------------------------------------------------------------------------------------

    def _build(self, counts: NDArray[np.bool_], offsets: IntArray) -> None:
        active = self._side != 0
        waiting = np.zeros(0, np.int64)  # held rows that no level has pressed upon yet
        for level, (start, end) in enumerate(zip(offsets[:-1].tolist(), offsets[1:].tolist(), strict=True)):
            if start == end:
                continue
            own = active[start:end]
            least = start + np.flatnonzero(own & counts[start:end])
            held = start + np.flatnonzero(own & ~counts[start:end])
            if len(least):
                unit = math.ldexp(1.0, -math.frexp(float(self._largest[start:end].max()))[1])
                self._unit[least] = unit
                B, b = self._rows[least] * unit, self._bound[least] * unit
                if len(waiting):
                    waiting = self._pressed(waiting, B, b, level)
                whole = B if len(least) == end - start else self._rows[start:end] * unit
                self._least_squares(level, least, B, b, whole)
            if len(held):
                waiting = np.concatenate((waiting, held))
        zeta = self._zeta if self._root is None else self._root @ self._zeta
        if len(waiting):
            waiting = self._pressed(waiting, np.eye(len(zeta)), zeta, None)
            if len(waiting):
                raise NotDifferentiableError(
                    f"{self._named(waiting[0])} is at its {self._words(waiting[0])} bound, where the answer would be without "
                    "it (its multiplier is zero): the answer has a kink, and one-sided derivatives only."
                )
        self._at = self._at + self._Z @ (self._Z.T @ zeta)

    def _least_squares(self, level: int, rows: IntArray, B: FloatArray, b: FloatArray, whole: FloatArray) -> None:
        """The rows of a level that count, with the rank rule on the whole level's norm."""
        m, d = len(rows), self._Z.shape[1]
        self._note(B, b)
        if not d:
            return
        U, sigma, Vt = np.linalg.svd(B @ self._Z, full_matrices=m < d)
        bar = _norm(whole)  # not below ||A_k||_2
        if sigma[-1] <= max(self.tolerance, RANK) * bar:
            bar = two_norm(whole)
            unsure = sigma[(sigma > RANK * bar) & (sigma <= self.tolerance * bar)]
            if len(unsure):
                raise NotDifferentiableError(
                    f"The rank of {self._level(level)} is nearly one less: a singular value beside the levels before it is "
                    f"{unsure[0] / bar:.1e} of its norm, within the tolerance {self.tolerance:g}: no derivative means anything."
                )
        rank = int((sigma > RANK * bar).sum())
        full = m if level == 0 else min(m, d)
        if rank < full and not self.constant_rank:
            raise NotDifferentiableError(self._deficient(level, rank, full))
        self._add(rows, B, b, U[:, :rank], sigma[:rank], Vt, rank < full)

    def _deficient(self, level: int, rank: int, full: int) -> str:
        beside = " beside the levels before it" if level else ""
        return (
            f"The rank of {self._level(level)} is {rank}{beside} and could be {full}: almost every change of the matrix raises "
            "it, and the answer jumps. constant_rank=True gives the derivative among changes that keep the rank, those of "
            "bounds alone included."
        )

    def _add(
        self,
        rows: IntArray,
        B: FloatArray,
        b: FloatArray,
        U: FloatArray,
        sigma: FloatArray,
        Vt: FloatArray,
        deficient: bool,
    ) -> None:
        rank = len(sigma)
        Q = self._Z @ Vt[:rank].T
        P = (U / sigma) @ Q.T
        self._Z = self._Z @ Vt[rank:].T
        self._at = self._at + P.T @ (b - B @ self._at)
        residual = None
        if rank < len(rows):
            residual = B @ self._at - b
            residual = residual - U @ (U.T @ residual)
        self._blocks.append(_Block(rows, B, P, U, self._Z if deficient else None, residual))

    def _pressed(self, waiting: IntArray, B: FloatArray, b: FloatArray, level: int | None) -> IntArray:
        """Which of the held rows that wait are still not pressed upon after a level B x = b; the others become a block.

        level: its number, or None for the norm.
        """
        normals = self._rows[waiting]
        unit = 1.0 / _lengths(normals)
        normals, bounds = normals * unit[:, None], self._bound[waiting] * unit
        self._unit[waiting] = unit
        factors = self._independent(waiting, normals)
        U, sigma, Vt = factors
        r = len(sigma)
        free = self._Z @ Vt[r:].T
        if level is not None and free.shape[1]:
            left, sizes, right = np.linalg.svd(B @ free, full_matrices=False)
            keep = sizes > RANK * _norm(B)
            if np.count_nonzero(keep) == len(B):
                return waiting  # the level is met beside them
        G = (U / sigma) @ Vt[:r]  # (w, d), the transposed pseudo-inverse of normals @ Z
        at = self._at + self._Z @ (G.T @ (bounds - normals @ self._at))
        if level is None:
            at = at + free @ (free.T @ (b - at))
        elif free.shape[1]:
            at = at + free @ (right[keep].T @ ((left[:, keep].T @ (b - B @ at)) / sizes[keep]))
        gradient = B.T @ (B @ at - b)
        force = -(G @ (self._Z.T @ gradient)) * self._side[waiting]
        scale = 1.0 if level is None else _norm(B)
        least = self.tolerance * scale * (scale * self._size + _norm(b))
        wrong = waiting[force < -least]
        if len(wrong):
            by = "the norm" if level is None else self._level(level)
            raise NotDifferentiableError(
                f"{self._named(wrong[0])} is held at its {self._words(wrong[0])} bound, and {by} would be better without it: "
                "x is not the lexicographic optimum."
            )
        firm = force > least
        if not firm.any():
            return waiting
        if not firm.all():
            normals, bounds = normals[firm], bounds[firm]
            factors = np.linalg.svd(normals @ self._Z, full_matrices=True)
        self._note(normals, bounds)
        self._add(waiting[firm], normals, bounds, *factors, False)
        return waiting[~firm]

    def _independent(self, waiting: IntArray, normals: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        projected = normals @ self._Z
        U, sigma, Vt = np.linalg.svd(projected, full_matrices=True)
        if len(sigma) < len(waiting) or sigma[-1] <= self.tolerance:
            alone = np.linalg.norm(projected, axis=1)
            what = int(np.argmin(alone)) if alone.min() <= self.tolerance else int(np.argmax(np.abs(U[:, -1])))
            raise NotDifferentiableError(
                f"{self._named(waiting[what])} is held at its {self._words(waiting[what])} bound beside rows that determine it "
                "already: which of them hold the answer is not unique, and it has one-sided derivatives only."
            )
        return U, sigma, Vt

    def _words(self, row: int) -> str:
        return "upper" if self._side[row] > 0 else "lower"

    def _note(self, B: FloatArray, b: FloatArray) -> None:
        """How long an x the bounds of rows ask for."""
        length = _norm(B)
        if length > 0.0:
            self._size = max(self._size, _norm(b) / length)

    def _agree(self, y: FloatArray) -> None:
        apart = _norm(self._at - y)
        if not apart <= AGREES * self._size:
            raise NotDifferentiableError(
                f"x is not the lexicographic optimum: with its active rows that is {apart:.1e} away, of size {self._size:.1e}. "
                "Take a solver that is exact for this problem."
            )

    def _multipliers(self) -> list[_Pulled]:
        found = []
        for i, block in enumerate(self._blocks):
            if block.residual is not None:
                weights = self._sweep(-(block.B.T @ block.residual), i)[0]
                weights[block.rows] = block.residual
                found.append(_Pulled(i, weights))
        zeta = self._zeta if self._root is None else self._root @ self._zeta
        found.append(_Pulled(len(self._blocks), self._sweep(zeta - self._at, len(self._blocks))[0]))
        return found

    def _sweep(self, h: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
        """t (rows,) with sum_i B_i^T t_i = h, from the last of the first `count` blocks to the first, and what is left of h."""
        t = np.zeros(len(self._rows))
        for block in reversed(self._blocks[:count]):
            own = block.P @ h
            t[block.rows] = own
            h = h - block.B.T @ own
        return t, h

    # --- applied ------------------------------------------------------------------------------------------------------

    def vjp(self, x_bar: ArrayLike) -> ProblemGradient:
        """The gradient of a number with respect to the data, from its gradient with respect to x.

        Args:
            x_bar: (n,) d(number)/dx.

        Raises:
            ProblemError: x_bar is not n finite numbers.
        """
        xbar = checked_point(x_bar, self.problem.n, "x_bar")
        if self._inverse is not None:
            xbar = self._inverse.T @ xbar
        c = self._Z @ (self._Z.T @ xbar)
        t, _ = self._sweep(xbar - c, len(self._blocks))
        matrix = np.outer(-t, self._at)
        for block, weights in self._pulls:
            if block == len(self._blocks):
                pulled = c
            else:
                pulled = self._blocks[block].P.T @ t[self._blocks[block].rows]
            matrix -= np.outer(weights, pulled)
        matrix *= self._unit[:, None]
        t *= self._unit
        lower = np.where(self._equality, 0.5 * t, np.where(self._side < 0, t, 0.0))
        upper = t - lower
        secondary, metric = c, None
        if self._inverse is not None and self._root is not None:
            matrix = matrix @ self._inverse.T
            secondary = self._root.T @ c
            one = np.outer(self._inverse @ c, self.x - self._zeta)
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
        n, h, M = self.problem.n, self.problem.hard_rows, self.problem.rows
        B_dot = np.concatenate(
            (_rate("hard_matrix_dot", hard_matrix_dot, (h, n)), _rate("matrix_dot", matrix_dot, (M, n)))
        )
        low = np.concatenate((_rate("hard_lower_dot", hard_lower_dot, (h,)), _rate("lower_dot", lower_dot, (M,))))
        high = np.concatenate((_rate("hard_upper_dot", hard_upper_dot, (h,)), _rate("upper_dot", upper_dot, (M,))))
        parted = np.flatnonzero(self._equality & (low != high))
        if len(parted):
            raise NotDifferentiableError(
                f"{self._named(parted[0])} is an equality whose bounds would part, at rates {low[parted[0]]:g} and "
                f"{high[parted[0]]:g}: give both bounds the same rate."
            )
        zeta_dot = _rate("secondary_dot", secondary_dot, (n,))
        if self._inverse is not None and self._root is not None:
            B_dot, zeta_dot = B_dot @ self._inverse, self._root @ zeta_dot
            W_dot = _rate("metric_dot", metric_dot, (n, n))
            if not np.allclose(W_dot, W_dot.T, rtol=1e-12, atol=0.0):
                raise ProblemError("metric_dot is not symmetric; give (W_dot + W_dot.T) / 2 if that is what is meant.")
            zeta_dot = zeta_dot - self._inverse.T @ (W_dot @ (self.x - self._zeta))
        elif metric_dot is not None:
            raise ProblemError(
                "metric_dot is given and the problem has no metric; leave it out, or state the problem with one."
            )
        B_dot = B_dot * self._unit[:, None]
        b_dot = np.where(self._side < 0, low, high) * self._unit
        pulls = {pulled.block: pulled.weights for pulled in self._pulls}
        dx = np.zeros(n)
        for i, block in enumerate(self._blocks):
            if block.Z is not None:
                self._require_rank(i, block.Z, B_dot)
            step = b_dot[block.rows] - B_dot[block.rows] @ self._at - block.B @ dx
            if i in pulls:
                step = step - block.P @ (B_dot.T @ pulls[i])
            dx = dx + block.P.T @ step
        dx = dx + self._Z @ (self._Z.T @ (zeta_dot - B_dot.T @ pulls[len(self._blocks)]))
        return dx if self._inverse is None else self._inverse @ dx

    def _require_rank(self, last: int, Z: FloatArray, B_dot: FloatArray) -> None:
        """Raises unless the rank of block `last` stays: dC Z within the range of C, C all blocks up to it."""
        dZ = np.zeros_like(Z)
        for block in self._blocks[: last + 1]:
            missing = -B_dot[block.rows] @ Z - block.B @ dZ
            dZ = dZ + block.P.T @ missing
        own = self._blocks[last]
        outside = missing - own.U @ (own.U.T @ missing)
        if _norm(outside) > KEEPS * _norm(B_dot):
            level = int(np.searchsorted(self.problem.with_hard.offsets, own.rows[0], side="right")) - 1
            raise NotDifferentiableError(
                f"The rank of {self._level(level)} changes in this direction, and the answer jumps: give one that keeps the "
                "rank."
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


def _norm(v: FloatArray) -> float:
    return math.sqrt(float(np.vdot(v, v)))


def _lengths(A: FloatArray) -> FloatArray:
    """(m,) ||a_i||_2; each row is scaled by its own largest entry, so that squares do not overflow."""
    largest = np.abs(A).max(axis=1, initial=0.0)
    unit = A / np.where(largest > 0.0, largest, 1.0)[:, None]
    lengths: FloatArray = largest * np.sqrt(np.einsum("ij,ij->i", unit, unit))
    return lengths


def _rounding(problem: Problem, x: FloatArray, lengths: FloatArray) -> float:
    """`rounding_at_zero`, which is 0 but for an x much shorter than the bounds."""
    _, lower, upper, _ = problem.with_hard
    asked = np.concatenate((np.abs(lower), np.abs(upper)))
    some = np.isfinite(asked) & (np.concatenate((lengths, lengths)) > 0.0)
    reach = float((asked[some] / np.concatenate((lengths, lengths))[some]).max(initial=0.0))
    return rounding_at_zero(problem, x) if _norm(x) <= NEAR_ZERO * reach else 0.0


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
