"""DAQP's own hierarchical mode: a dual active-set solver that solves each level with softened rows."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np

from hqp_rp.core.closed_form import zeros
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray, Problem, Stacked
from hqp_rp.core.qp_backend import check_positive
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver
from hqp_rp.core.verify import contradiction, fault_of

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


class _Room:
    """Arrays for problems of one shape: the problem with its hard rows on top, what DAQP is given, and DAQP's workspace."""

    def __init__(self, rows: int, n: int, offsets: Any) -> None:
        from hqp_rp.core.kernels import normalise

        self.kernels = normalise
        self.stacked = Stacked(np.empty((rows, n)), np.empty(rows), np.empty(rows), offsets)
        self.rows = np.empty((rows, n))
        self.low, self.up, self.softness = np.empty(rows), np.empty(rows), np.empty(rows)
        self.sense = np.empty(rows, np.int32)
        self.model: Any = None
        self.no_hard = np.zeros((0, n)), np.zeros(0), np.zeros(0)
        for array in self.no_hard:  # kernels are compiled for hard rows, which are read-only
            array.flags.writeable = False

    def fill(self, problem: Problem) -> None:
        """Take up a problem of this shape."""
        hard = problem.hard
        top = self.no_hard if hard is None else (hard.A, hard.lower, hard.upper)
        self.kernels.stack_rows(*top, *problem.stacked[:3], *self.stacked[:3])


class _Rooms:
    """Rooms by problem shape; a copy or a pickle of it is empty."""

    def __init__(self) -> None:
        self.kept: dict[tuple[Any, ...], _Room] = {}

    def room(self, problem: Problem) -> _Room:
        """The room of the problems that have the shape of `problem`."""
        hard = 0 if problem.hard is None else problem.hard.m
        key = (problem.n, hard, problem.offsets.tobytes())
        found = self.kept.get(key)
        if found is None:
            offsets = np.concatenate(([0], problem.offsets + hard))
            found = self.kept[key] = _Room(hard + len(problem.matrix), problem.n, offsets)
        return found

    def __reduce__(self) -> tuple[object, ...]:
        return (_Rooms, ())


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
    _rooms: _Rooms = dataclasses.field(default_factory=_Rooms, init=False, repr=False, compare=False)

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
        self._rooms.kept.clear()

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
        room = self._rooms.room(problem)
        room.fill(problem)
        stacked = room.stacked
        x, flag, iterations = self._run(room, secondary)
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
            softened = _Room(len(stacked.matrix), problem.n, np.concatenate(([0], stacked.offsets)))
            softened.stacked = stacked._replace(offsets=softened.stacked.offsets)
            x, again, more = self._run(softened, secondary)
            iterations += more
            if again in _ANSWERED and np.isfinite(x).all():
                return self._verified(problem, stacked, x, secondary, iterations)
        message = f"DAQP ended without an answer (exit flag {flag}: {_SAYS.get(flag, 'see its documentation')})."
        return Solution(problem, None, Status.INACCURATE, iterations, message, secondary)

    def _run(self, room: _Room, secondary: FloatArray | None) -> tuple[FloatArray, int, int]:
        """(x, DAQP's exit flag or 0 when the rows overflow, iterations)."""
        M, n = room.rows.shape
        if M == 0:
            return (np.zeros(n) if secondary is None else secondary.copy()), 1, 0
        zeta = zeros(n) if secondary is None else secondary
        given = (room.rows, room.low, room.up, room.softness, room.sense)
        if not room.kernels.unit_rows(*room.stacked, zeta, self.rho, _SHORTEST, *given):
            return zeta, 0, 0
        room.sense *= _EQUALITY
        flag = self._load(room)
        if flag < 0:
            return zeta, flag, 0
        room.model.soft_weights(room.softness, room.softness)
        x, _, flag, info = room.model.solve()
        return (x if secondary is None else x + secondary), flag, info["iterations"]

    def _load(self, room: _Room) -> int:
        """Give the rows to DAQP: 1, or its exit flag where it refuses: solving a model that it refused ends the process."""
        if room.model is not None:
            if room.model.update(A=room.rows, bupper=room.up, blower=room.low, sense=room.sense) >= 0:
                return 1
            room.model = None
        import daqp

        model = daqp.Model()
        model.settings = {"primal_tol": self.primal_tol, "iter_limit": self.max_iterations}
        ends = room.stacked.offsets[1:].astype(np.int32)
        flag = int(model.setup(np.eye(room.rows.shape[1]), None, room.rows, room.up, room.low, room.sense, ends)[0])
        if flag < 0:
            return flag
        room.model = model
        return 1
