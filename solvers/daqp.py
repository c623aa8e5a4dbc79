"""DAQP's own hierarchical mode: a dual active-set solver that solves each level with softened rows."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np

from hqp_rp.core.closed_form import zeros
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.qp_backend import check_positive
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver
from hqp_rp.core.verify import Stacked, contradiction, fault_of, with_hard_rows

_EQUALITY = 5  # DAQP's flag of a row whose bounds coincide
_SHORTEST = 1e-4  # rows shorter than this part of their level's longest weigh as this
_ANSWERED = (1, 2)  # DAQP's exit flags with an optimum: 2 where rows of a level had to give
_LIMIT = -4  # DAQP's exit flag at its iteration limit
_SAYS = {
    3: "infeasible",
    -1: "infeasible",
    -2: "cycling",
    -3: "unbounded",
    -4: "iteration limit",
    -5: "not convex",
    -6: "over-determined start",
}


class _Models:
    """DAQP workspaces by problem shape; a copy or a pickle of it is empty."""

    def __init__(self) -> None:
        self.kept: dict[tuple[Any, ...], Any] = {}

    def __reduce__(self) -> tuple[object, ...]:
        return (_Models, ())


@dataclasses.dataclass(frozen=True, kw_only=True)
class Daqp(Solver):
    """The lexicographic optimum to a relative `accept`, by DAQP's hierarchical mode.

    ::

        level k:  min_x  1/2 ||x - zeta||^2 + 1 / (2 rho) sum_i (w_i / l)^2    subject to the levels before, as they came out

    with w the violation of the level's rows in its own unit and l the length of its longest row. DAQP itself measures a row's
    violation in the row's own length; each row's softness is set so that the sum is the level's own, and its optimum ours.
    What rho > 0 leaves of a level that could be met is of the order of rho divided by the square of the level's smallest
    singular value (in units of l) and is taken out of the right-hand sides again, so that it does not reach later levels.

    The answer is verified before it is called solved (`hqp_rp.core.verify`). Near singularities, where the softening shows,
    it comes back as `Status.INACCURATE` with the level at fault.

    Args:
        accept: the declared tolerance, relative as in `Solver.tolerance`.
        rho: softness of the longest row of a level. At 1e-9 and below DAQP can silently lose rows on larger problems.
        primal_tol: DAQP's tolerance on rows, in units of a row's length.
        max_iterations: DAQP's limit, summed over levels.
        second_try: solve once more where an answer was not verified: with rho / 100 (near a singularity), or, where DAQP
            gave no answer (hard rows that barely meet), with 10 rho and 10 primal_tol.

    A kept instance reuses DAQP's workspace for problems of one shape, but starts every solve from an empty working set; it
    must not be shared between threads.

    Source: Arnström, Bemporad and Axehill 2022; the hierarchical mode is documented by DAQP itself.
    """

    accept: float = 1e-6
    rho: float = 1e-6
    primal_tol: float = 1e-9
    max_iterations: int = 10_000
    second_try: bool = True
    _models: _Models = dataclasses.field(default_factory=_Models, init=False, repr=False, compare=False)

    name: ClassVar[str] = "daqp"
    summary: ClassVar[str] = "DAQP's hierarchical mode, every answer verified"
    source: ClassVar[str] = "Arnström, Bemporad and Axehill 2022"
    takes_inequalities: ClassVar[bool] = True
    takes_hard: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for name in ("accept", "rho", "primal_tol"):
            check_positive(name, getattr(self, name))
        if not self.accept < 1.0:
            raise SettingError(f"accept is {self.accept!r}; a relative tolerance must be below 1.")
        limit = self.max_iterations
        if isinstance(limit, bool) or not isinstance(limit, int) or limit < 1:
            raise SettingError(f"max_iterations is {limit!r}; it must be an integer of at least 1.")

    @property
    def tolerance(self) -> float:
        """`accept`."""
        return self.accept

    def is_lexicographic(self, problem: Problem) -> bool:
        """True: an answer that is not the optimum to the tolerance is not called solved."""
        return True

    def reset(self) -> None:
        """Drop DAQP's workspaces."""
        self._models.kept.clear()

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """The lexicographic optimum nearest to `secondary` (n,); see `Solver.solve`."""
        solution = self._solve(problem, secondary)
        if solution.status is Status.INACCURATE and self.second_try:
            rho, tol = (self.rho / 100.0, 1.0) if solution.x is not None else (self.rho * 10.0, 10.0)
            again = dataclasses.replace(self, rho=rho, primal_tol=tol * self.primal_tol)._solve(problem, secondary)
            if again.status in (Status.SOLVED, Status.INFEASIBLE):
                again.iterations += solution.iterations
                return again
        return solution

    def _solve(self, problem: Problem, secondary: FloatArray | None) -> Solution:
        stacked = with_hard_rows(problem)
        x, flag, iterations = self._run(stacked, secondary)
        if flag == 0 or (flag in _ANSWERED and not np.isfinite(x).all()):
            return Solution(problem, None, Status.NOT_FINITE, iterations, "The rows or bounds overflow.", secondary)
        if flag in _ANSWERED:
            return self._verified(problem, stacked, x, secondary, iterations)
        return self._without_answer(problem, stacked, secondary, flag, iterations)

    def _verified(
        self, problem: Problem, stacked: Stacked, x: FloatArray, secondary: FloatArray | None, iterations: int
    ) -> Solution:
        fault = fault_of(problem, x, secondary, self.accept, stacked=stacked)
        if fault and problem.hard is not None and (conflict := contradiction(problem.hard, x)):
            return Solution(problem, None, Status.INFEASIBLE, iterations, conflict, secondary)
        solution = Solution(problem, x, Status.INACCURATE if fault else Status.SOLVED, iterations, fault, secondary)
        solution.held = self.accept
        return solution

    def _without_answer(
        self, problem: Problem, stacked: Stacked, secondary: FloatArray | None, flag: int, iterations: int
    ) -> Solution:
        if flag == _LIMIT:
            message = f"DAQP reached max_iterations = {self.max_iterations}; raise it."
            return Solution(problem, None, Status.ITERATION_LIMIT, iterations, message, secondary)
        hard = int(stacked.offsets[1])
        if hard and problem.hard is not None:
            # Once more with the hard rows as the first level: the least violation proves or disproves a contradiction.
            soft = stacked._replace(offsets=np.concatenate(([0], stacked.offsets)))
            x, again, more = self._run(soft, secondary)
            iterations += more
            if again in _ANSWERED and np.isfinite(x).all():
                return self._verified(problem, stacked, x, secondary, iterations)
        message = f"DAQP ended without an answer (exit flag {flag}: {_SAYS.get(flag, 'see its documentation')})."
        return Solution(problem, None, Status.INACCURATE, iterations, message, secondary)

    def _run(self, stacked: Stacked, secondary: FloatArray | None) -> tuple[FloatArray, int, int]:
        """(x, DAQP's exit flag or 0 when the rows overflow, iterations)."""
        from hqp_rp.core.kernels.normalise import unit_rows

        matrix, lower, upper, offsets = stacked
        M, n = matrix.shape
        if M == 0:
            return (np.zeros(n) if secondary is None else secondary.copy()), 1, 0
        rows, low, up, softness = np.empty((M, n)), np.empty(M), np.empty(M), np.empty(M)
        sense = np.empty(M, np.int32)
        zeta = zeros(n) if secondary is None else secondary
        if not unit_rows(matrix, lower, upper, offsets, zeta, self.rho, _SHORTEST, rows, low, up, softness, sense):
            return zeta, 0, 0
        sense *= _EQUALITY
        model, flag = self._model(rows, low, up, sense, offsets)
        if model is None:
            return zeta, flag, 0
        model.soft_weights(softness, softness)
        x, _, flag, info = model.solve()
        return (x if secondary is None else x + secondary), flag, info["iterations"]

    def _model(self, rows: FloatArray, low: FloatArray, up: FloatArray, sense: Any, offsets: Any) -> tuple[Any, int]:
        """(model, 1), or (None, DAQP's exit flag) where it refuses: solving a model that it refused ends the process."""
        key = (rows.shape[1], offsets.tobytes())
        model = self._models.kept.get(key)
        if model is not None and model.update(A=rows, bupper=up, blower=low, sense=sense) >= 0:
            return model, 1
        import daqp

        model = daqp.Model()
        model.settings = {"primal_tol": self.primal_tol, "iter_limit": self.max_iterations}
        flag = model.setup(np.eye(rows.shape[1]), None, rows, up, low, sense, offsets[1:].astype(np.int32))[0]
        if flag < 0:
            return None, flag
        self._models.kept[key] = model
        return model, 1
