"""DAQP's own hierarchical mode: a dual active-set solver that solves each level with softened rows."""

from __future__ import annotations

import dataclasses
import itertools
import threading
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.closed_form import zeros
from hqp_rp.core.errors import SettingError
from hqp_rp.core.extras import require
from hqp_rp.core.level_damping import solve_damped
from hqp_rp.core.metric import solve_in_metric
from hqp_rp.core.problem import FloatArray, Problem, Stacked
from hqp_rp.core.qp_backend import check_positive
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver
from hqp_rp.core.variant import QP, LineUp, Variant
from hqp_rp.core.verify import breaks_hard_rows, contradiction, fault_of

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


class Rows(NamedTuple):
    """What DAQP is given: rows (M, n) of length one, bounds of rows (x - zeta), softness and sense of each row."""

    rows: FloatArray
    low: FloatArray
    up: FloatArray
    softness: FloatArray
    sense: NDArray[np.int32]


def unit_rows(stacked: Stacked, zeta: FloatArray, rho: float) -> Rows | None:
    """Rows of length one with the softness that undoes it; None where a number overflows.

    softness_i = rho * (longest row of the level / length of row i)^2, so that sum_i v_i^2 / softness_i of the normalised
    violations is the level's own sum of squares over (rho * longest^2). A row is never softer than rho / 1e-8. A row of
    zeros stays one, without bounds.
    """
    A, lower, upper, offsets = stacked
    with np.errstate(all="ignore"):
        big = np.abs(A).max(axis=1, initial=0.0)
        lengths = big * np.linalg.norm(A / np.where(big > 0.0, big, 1.0)[:, None], axis=1)
        safe = np.where(lengths > 0.0, lengths, 1.0)
        rows = np.ascontiguousarray(A / safe[:, None])
        shift = rows @ zeta
        low, up = lower / safe - shift, upper / safe - shift
        equality = (lower == upper) & (lengths > 0.0)
        up = np.where(equality, low, up)
        low, up = np.where(lengths > 0.0, low, -np.inf), np.where(lengths > 0.0, up, np.inf)
        softness = np.full(len(A), rho)
        for start, end in itertools.pairwise(offsets.tolist()):
            longest = lengths[start:end].max(initial=0.0)
            if longest > 0.0:
                softness[start:end] = rho / np.maximum(lengths[start:end] / longest, _SHORTEST) ** 2
    sound = np.isfinite(rows).all() and not (np.isnan(low) | np.isnan(up) | (low == np.inf) | (up == -np.inf)).any()
    return Rows(rows, low, up, softness, np.where(equality, _EQUALITY, 0).astype(np.int32)) if sound else None


class _Models(threading.local):
    """DAQP's models by problem shape, those of each thread apart; a copy or a pickle of it is empty."""

    def __init__(self) -> None:
        self.kept: dict[tuple[Any, ...], Any] = {}

    def __copy__(self) -> _Models:
        return _Models()

    def __deepcopy__(self, memo: Any) -> _Models:
        return _Models()

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

    A kept instance reuses DAQP's workspace for problems of one shape, but starts every solve from an empty working set.
    Threads may share it.

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
    takes_damping: ClassVar[bool] = True
    takes_metric: ClassVar[bool] = True
    variants: ClassVar[LineUp] = LineUp(
        (Variant("DAQP hierarchy", {}, QP, "DAQP's own hierarchical mode"),),
        place=150,
    )

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
        if problem.metric is not None:
            return solve_in_metric(problem, secondary, self.solve)
        if problem.damping is not None:
            return solve_damped(problem, secondary, self.solve, tolerance=self.tolerance)
        solution = self._solve(problem, secondary)
        if solution.status is Status.INACCURATE and self.second_try:
            rho, tol = (self.rho / 100.0, 1.0) if solution.x is not None else (self.rho * 10.0, 10.0)
            again = dataclasses.replace(self, rho=rho, primal_tol=tol * self.primal_tol)._solve(problem, secondary)
            if again.status in (Status.SOLVED, Status.INFEASIBLE):
                again.iterations += solution.iterations
                return again
        return solution

    def _solve(self, problem: Problem, secondary: FloatArray | None) -> Solution:
        stacked = problem.with_hard
        x, flag, iterations = self._run(stacked, secondary)
        if flag == 0 or (flag in _ANSWERED and not np.isfinite(x).all()):
            return Solution(problem, None, Status.NOT_FINITE, iterations, "The rows or bounds overflow.", secondary)
        if flag in _ANSWERED:
            return self._verified(problem, x, secondary, iterations)
        return self._without_answer(problem, stacked, secondary, flag, iterations)

    def _verified(self, problem: Problem, x: FloatArray, secondary: FloatArray | None, iterations: int) -> Solution:
        fault = fault_of(problem, x, secondary, self.accept)
        if fault and problem.hard is not None and breaks_hard_rows(problem, x, self.accept):
            conflict = contradiction(problem, x)
            status = Status.INFEASIBLE if conflict else Status.INACCURATE
            return Solution(problem, None, status, iterations, conflict or fault, secondary)
        solution = Solution(problem, x, Status.INACCURATE if fault else Status.SOLVED, iterations, fault, secondary)
        solution.held = self.accept
        return solution

    def _without_answer(
        self, problem: Problem, stacked: Stacked, secondary: FloatArray | None, flag: int, iterations: int
    ) -> Solution:
        if flag == _LIMIT:
            message = f"DAQP reached max_iterations = {self.max_iterations}; raise it."
            return Solution(problem, None, Status.ITERATION_LIMIT, iterations, message, secondary)
        if problem.hard is not None and problem.hard_rows:
            # Once more with the hard rows as the first level: the least violation proves or disproves a contradiction.
            softened = stacked._replace(offsets=np.concatenate(([0], stacked.offsets)))
            x, again, more = self._run(softened, secondary)
            iterations += more
            if again in _ANSWERED and np.isfinite(x).all():
                return self._verified(problem, x, secondary, iterations)
            if conflict := contradiction(problem, zeros(problem.n)):
                return Solution(problem, None, Status.INFEASIBLE, iterations, conflict, secondary)
        message = f"DAQP ended without an answer (exit flag {flag}: {_SAYS.get(flag, 'see its documentation')})."
        return Solution(problem, None, Status.INACCURATE, iterations, message, secondary)

    def _run(self, stacked: Stacked, secondary: FloatArray | None) -> tuple[FloatArray, int, int]:
        """(x, DAQP's exit flag or 0 when the rows overflow, iterations)."""
        M, n = stacked.matrix.shape
        if M == 0:
            return (np.zeros(n) if secondary is None else secondary.copy()), 1, 0
        zeta = zeros(n) if secondary is None else secondary
        rows = unit_rows(stacked, zeta, self.rho)
        if rows is None:
            return zeta, 0, 0
        model, flag = self._load(rows, stacked)
        if flag < 0:
            return zeta, flag, 0
        model.soft_weights(rows.softness, rows.softness)
        x, _, flag, info = model.solve()
        return (x.copy() if secondary is None else x + secondary), flag, info["iterations"]

    def _load(self, rows: Rows, stacked: Stacked) -> tuple[Any, int]:
        """The model that holds these rows, and 1, or DAQP's exit flag: solving a model that it refused ends the process."""
        key = (rows.rows.shape[1], stacked.offsets.tobytes())
        model = self._models.kept.get(key)
        if model is not None:
            if model.update(A=rows.rows, bupper=rows.up, blower=rows.low, sense=rows.sense) >= 0:
                return model, 1
            del self._models.kept[key]
        require("The solver daqp", "daqp")
        import daqp

        model = daqp.Model()
        model.settings = {"primal_tol": self.primal_tol, "iter_limit": self.max_iterations}
        ends = stacked.offsets[1:].astype(np.int32)
        flag = int(model.setup(np.eye(rows.rows.shape[1]), None, rows.rows, rows.up, rows.low, rows.sense, ends)[0])
        if flag >= 0:
            self._models.kept[key] = model
            flag = 1
        return model, flag
