"""Soft weights instead of priorities: every level at once, each with a cost; what mink and pink do."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar

import numpy as np

from hqp_rp.core.errors import SettingError
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.qp_backend import check_backend, check_positive
from hqp_rp.core.qp_workspace import Workspace
from hqp_rp.core.row_names import take_row_names
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver
from hqp_rp.core.tolerances import SOLVED, TALL_RANK
from hqp_rp.core.variant import SOFT, LineUp, Variant

SUM = "the weighted sum"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Weighted(Solver):
    """One least-squares problem in which a level's priority is only a weight.

    ::

        min_x  sum_k w_k (||v_k(x)||^2 + ||D_k x - d_k||^2) + damping ||x - secondary||^2    subject to the hard rows

    with v_k the violation of level k (`A_k x - b_k` for equalities) and D_k its damping, if it has one. Equalities alone are
    solved by an orthogonal factorization of the stacked rows `sqrt(w_k) A_k`, `sqrt(damping) I`, never by squaring them, so
    that what separates this baseline from the others is the method and not its arithmetic. Two-sided and hard rows go through
    a QP back end, with slack for the rows of the levels. Not lexicographic: at any finite weight lower levels disturb higher
    ones.

    Settings:
        ratio: weight of level k is `ratio**(k - 1)`, k = 1 ... p. mink's and pink's `cost` multiplies the rows, so it is
            the square root of a weight: 1e-4, the default, is a cost ratio of 1e-2, usual between a task and its posture.
        weights: the weights themselves, one for each level; None means by `ratio`.
        damping: Tikhonov weight, default 1e-12 as in `mink.solve_ik` 1.3 and `pink.solve_ik`. 0 is allowed: then the answer
            is the least-squares solution nearest to `secondary`.
        backend: "proxqp", "osqp" or any name that qpsolvers has installed; equality problems need none.
        eps_abs, max_iterations: of the back end.

    Raises `SettingError` for a back end that is not installed or a setting out of range.

    Source: `mink.solve_ik` and `pink.solve_ik` (their documentation states objective and damping); Golub and Van Loan 2013,
    section 6.1, on weighting.
    """

    name: ClassVar[str] = "weighted"
    summary: ClassVar[str] = "All levels in one least-squares problem with soft weights, as mink and pink do."
    source: ClassVar[str] = "mink.solve_ik and pink.solve_ik; Golub and Van Loan 2013, section 6.1"
    takes_inequalities: ClassVar[bool] = True
    takes_hard: ClassVar[bool] = True
    takes_damping: ClassVar[bool] = True
    takes_metric: ClassVar[bool] = True
    variants: ClassVar[LineUp] = LineUp(
        (Variant("weighted", {}, SOFT, "soft weights instead of priorities, as mink and pink do"),),
        place=120,
    )

    ratio: float = 1e-4
    weights: tuple[float, ...] | None = None
    damping: float = 1e-12
    backend: str = "proxqp"
    eps_abs: float = 1e-9
    max_iterations: int = 4000
    _workspace: Workspace = dataclasses.field(default_factory=Workspace, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_positive("ratio", self.ratio)
        if self.damping != 0.0:
            check_positive("damping", self.damping)
        if self.weights is not None:
            object.__setattr__(self, "weights", tuple(self.weights))
            for k, weight in enumerate(self.weights):
                check_positive(f"weights[{k}]", weight)
        check_backend(self.backend)
        check_positive("eps_abs", self.eps_abs)
        if isinstance(self.max_iterations, bool) or not isinstance(self.max_iterations, int) or self.max_iterations < 1:
            raise SettingError(f"max_iterations is {self.max_iterations!r}; it must be an integer >= 1.")

    @property
    def tolerance(self) -> float:
        """`eps_abs`, but no less than 1e-9; it holds for hard rows and for the weighted sum as one level."""
        return max(SOLVED, self.eps_abs)

    def refuses(self, problem: Problem) -> str | None:
        """Weights that are not one for each level; otherwise nothing."""
        if self.weights is not None and len(self.weights) != problem.p:
            return f"weighted was given {len(self.weights)} weights for {problem.p} levels; give one for each level."
        return super().refuses(problem)

    def reset(self) -> None:
        """Forget warm starts and workspaces."""
        self._workspace.clear()

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """The minimizer of the weighted sum; see `Solver.solve`."""
        refusal = self._refusal(problem)
        if refusal is not None:
            return refusal
        if problem.metric is not None:
            return solve_in_metric(problem, secondary, self.solve)
        start = np.zeros(problem.n) if secondary is None else secondary
        A, lower, upper = self._stacked(problem, start)
        if problem.is_equality and (problem.hard is None or problem.hard.m == 0):
            return self._least_squares(problem, A, lower, start, secondary)
        backend = self._workspace.backend(self.backend, self.eps_abs, self.max_iterations)
        # The promise is about the weighted sum: as one level it is solved and judged like any other.
        hard = 0 if problem.hard is None else problem.hard.m
        offsets = np.array([0, len(A)], dtype=np.int64)
        as_one = Problem.from_stacked(A, lower, upper, offsets, names=[SUM], hard=problem.hard, check=False)
        take_row_names(problem, as_one)
        found = self._workspace.stages(as_one).solve(as_one, secondary, backend, self.tolerance, polish=True)
        solution = Solution(problem, found.x, found.status, found.iterations, found.message, secondary)
        if isinstance(found.held, np.ndarray):
            solution.held = found.held[: hard + len(problem.matrix)]
        return solution

    def _stacked(self, problem: Problem, start: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """All rows times the square roots of their weights, and the damping as rows `sqrt(damping) x`."""
        counts = np.diff(problem.offsets)
        if self.weights is None:
            costs = math.sqrt(self.ratio) ** np.arange(problem.p)
        else:
            costs = np.sqrt(self.weights)
        row_costs = np.repeat(costs, counts)
        A, lower, upper = row_costs[:, None] * problem.matrix, row_costs * problem.lower, row_costs * problem.upper
        if problem.damping is not None:
            D, d, offsets = problem.damping_rows
            own_costs = np.repeat(costs, np.diff(offsets))
            A = np.concatenate([A, own_costs[:, None] * D])
            lower, upper = np.concatenate([lower, own_costs * d]), np.concatenate([upper, own_costs * d])
        if self.damping > 0.0:
            root = math.sqrt(self.damping)
            A = np.concatenate([A, root * np.eye(problem.n)])
            lower, upper = np.concatenate([lower, root * start]), np.concatenate([upper, root * start])
        return A, lower, upper

    def _least_squares(
        self, problem: Problem, A: FloatArray, b: FloatArray, start: FloatArray, secondary: FloatArray | None
    ) -> Solution:
        with np.errstate(all="ignore"):
            try:
                # Powers of two bring the matrix to scale without a rounding error.
                scale = math.ldexp(1.0, -math.frexp(float(np.abs(A).max(initial=0.0)))[1])
                x = start + np.linalg.lstsq(A * scale, (b - A @ start) * scale, rcond=TALL_RANK)[0]
            except np.linalg.LinAlgError:
                x = np.full(problem.n, np.nan)
        if not np.isfinite(x).all():
            return Solution(problem, None, Status.NOT_FINITE, 0, "x holds infinite or undefined numbers.", secondary)
        solution = Solution(problem, x, Status.SOLVED, 0, "", secondary)
        solution.held = np.zeros(len(problem.matrix), np.int8)
        return solution
