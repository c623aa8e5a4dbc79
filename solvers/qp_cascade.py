"""Lexicographic QP cascade: one small QP for each level, in the directions that the finished levels leave free."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

from hqp_rp.core.errors import SettingError
from hqp_rp.core.level_damping import solve_damped
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.qp_backend import check_backend, check_positive
from hqp_rp.core.qp_workspace import Workspace
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver, checked_secondary
from hqp_rp.core.tolerances import SOLVED
from hqp_rp.core.variant import QP, LineUp, Variant


@dataclasses.dataclass(frozen=True, kw_only=True)
class QpCascade(Solver):
    """The lexicographic optimum by a cascade of QPs, two-sided rows at any level and hard rows included.

    Level k minimizes its violation over the directions that the levels before it leave free, keeping what they reached::

        min_{z, s}  1/2 ||s||^2   subject to   lower_k <= A_k (x + Z z) + s <= upper_k,   rows kept from before

    and a last level `min ||x - secondary||` makes the answer unique. Finished equalities, violated rows and rows held by a
    multiplier leave through an orthonormal basis Z; satisfied rows stay as rows. The back end is given each level's own QP: its
    equality rows are factored (`A_k Z = U M`, M a triangle), the hessian is `M^T M` and the gradient `-M^T c`; only where M is
    ill conditioned (beyond 100) are its singular directions scaled, by at most 1000.
    Levels are scaled by powers of two first. A level that is met already where it starts needs no QP.

    Hard rows are solved first, with slack: where slack remains, `INFEASIBLE` is said once weights on the rows prove
    that they contradict each other (Farkas). `SOLVED` is never the back end's word: every level, every hard row and the
    distance to `secondary` are checked at the final x against `tolerance`, from the problem's own rows: by a quick native proof
    where that succeeds, else by the library's own certificate. An x that breaks a hard row is never returned.

    Settings:
        backend: "proxqp" and "osqp" through their native interfaces with workspaces kept between calls, or any other name
            that qpsolvers has installed.
        eps_abs: absolute (OSQP: also relative) tolerance of each scaled QP. 1e-9 is the best for both: default
            tolerances leave errors of 1e-3 to 1e-1 in x, smaller ones only cost iterations.
        max_iterations: limit on each QP.
        polish: refine an answer on the active rows that the back end found, by the least squares that they stand for (without
            rows, the level's own). What the back end decides is which rows are active; without polish x is as it came, and
            near a singularity, where the hessian squares what separates levels, it is then rarely accurate.

    An instance that is kept warm-starts from its last call of the same shape in the same thread; threads may share it.

    Raises `SettingError` for a back end that is not installed or a setting out of range.

    Source: Kanoun, Lamiraux and Wieber 2011 (the cascade); Escande, Mansard and Wieber 2014 (the null-space
    basis, the optimal slacks kept); Stellato, Banjac, Goulart, Bemporad and Boyd 2020 (polishing).
    """

    name: ClassVar[str] = "qp_cascade"
    summary: ClassVar[str] = (
        "Lexicographic optimum by one QP for each level, in the free directions of the levels before."
    )
    source: ClassVar[str] = "Kanoun, Lamiraux and Wieber 2011; Escande, Mansard and Wieber 2014"
    takes_inequalities: ClassVar[bool] = True
    takes_hard: ClassVar[bool] = True
    takes_damping: ClassVar[bool] = True
    takes_metric: ClassVar[bool] = True
    variants: ClassVar[LineUp] = LineUp(
        (
            Variant("QP ProxQP", {"backend": "proxqp"}, QP, "native interface, workspaces kept"),
            Variant("QP OSQP", {"backend": "osqp"}, QP, "native interface, workspaces kept"),
            Variant("QP DAQP", {"backend": "daqp"}, QP, "through qpsolvers"),
            Variant("QP quadprog", {"backend": "quadprog"}, QP, "through qpsolvers"),
        ),
        place=130,
    )

    backend: str = "proxqp"
    eps_abs: float = 1e-9
    max_iterations: int = 4000
    polish: bool = True
    _workspace: Workspace = dataclasses.field(default_factory=Workspace, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_backend(self.backend)
        check_positive("eps_abs", self.eps_abs)
        if isinstance(self.max_iterations, bool) or not isinstance(self.max_iterations, int) or self.max_iterations < 1:
            raise SettingError(f"max_iterations is {self.max_iterations!r}; it must be an integer >= 1.")

    @property
    def tolerance(self) -> float:
        """`eps_abs`, but no less than 1e-9."""
        return max(SOLVED, self.eps_abs)

    def is_lexicographic(self, problem: Problem) -> bool:
        """True: the cascade computes the lexicographic optimum of every problem."""
        return True

    def reset(self) -> None:
        """Forget warm starts and workspaces."""
        self._workspace.clear()

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """The lexicographic optimum nearest to `secondary` (n,); see `Solver.solve`."""
        if problem.metric is not None:
            return solve_in_metric(problem, checked_secondary(secondary, problem.n), self.solve)
        if problem.damping is not None:
            return solve_damped(problem, checked_secondary(secondary, problem.n), self.solve)
        workspace = self._workspace
        stages = workspace.stages(problem)
        warm = stages.used
        backend = workspace.backend(self.backend, self.eps_abs, self.max_iterations)
        if secondary is not None:
            secondary = checked_secondary(secondary, problem.n)
        solution = stages.solve(problem, secondary, backend, self.tolerance, polish=self.polish)
        if warm and solution.status is not Status.SOLVED and solution.status is not Status.INFEASIBLE:
            # What is kept between calls must never cost an answer: once more, from nothing.
            self.reset()
            return self.solve(problem, secondary)
        return solution
