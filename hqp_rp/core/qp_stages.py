"""A cascade of QPs driven through a back end: hard rows, levels, distance to the secondary vector, then the verdict.

The stages themselves, the QP of each and the elimination of what is finished, are native (`hqp_rp.core._native.QPCascade`).
Level k minimizes `||v||`, the violation of `lower <= A x <= upper`, in the directions Z that finished levels leave free: with
`M^T M = Z^T A_E^T A_E Z` a triangle of its equalities and `c` what they miss,

    min 1/2 ||M z - c||^2 + 1/2 ||s||^2

subject to the two-sided rows of this level with slack s and the rows kept from earlier levels. The back end is given that QP,
hessian `M^T M` and gradient `-M^T c`, as it is; only where M's condition is beyond 100 are its singular directions scaled, up
to a hundredth of the largest and by at most 1000. With `polish`, its answer is refined on the active rows that it found, by
the least squares that they stand for, from M and c themselves.
"""

from __future__ import annotations

from typing import Any

from hqp_rp.core import _native
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.qp_backend import NOTHING, Backend, Outcome, QPAnswer, SlackQP
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.verify import breaks_hard_rows, contradiction, fault_of

HARD = "the hard rows"
NEAREST = "the distance to the secondary vector"
NOT_FINITE = "x holds infinite or undefined numbers."
_DONE, _OVERFLOW, _PLAIN, _ROWS, _VIOLATED = range(5)


class Stages:
    """The stages of problems of one shape, with the warm starts of the last one.

    Args:
        n, hard, offsets: unknowns, hard rows and the levels' offsets of the problems.
    """

    def __init__(self, n: int, hard: int, offsets: Any) -> None:
        self._cascade = _native.QPCascade(n, hard, offsets)
        self._qps: dict[tuple[int, int, int], SlackQP] = {}
        self.used = False

    def solve(
        self, problem: Problem, secondary: FloatArray | None, backend: Backend, tolerance: float, *, polish: bool
    ) -> Solution:
        """Hard rows, levels, distance to the secondary vector; every answer verified before it is called solved.

        Args:
            problem: of this shape. secondary: (n,) or None. backend: solves the QPs.
            tolerance: relative, of the verdict. polish: refine each answer on the active rows that the back end found.
        """
        self.used = True
        run, cascade = _Run(backend), self._cascade
        asked, n, m, soft, guessed = cascade.begin(problem, secondary, tolerance, RANK_TOLERANCE, polish)
        while asked > _OVERFLOW:
            if asked == _VIOLATED:
                if conflict := contradiction(problem, cascade.x):
                    return Solution(problem, None, Status.INFEASIBLE, run.iterations, conflict, secondary)
                asked, n, m, soft, guessed = cascade.go_on()
                continue
            qp = self._qps.get((n, m, soft))
            if qp is None:
                qp = self._qps[n, m, soft] = SlackQP(*cascade.views, soft)
            t, y = run.answer(qp, guessed)
            if t is None and run.remarks:
                run.remarks[-1] = f"{self._stage(problem)}: {run.remarks[-1]}"
            asked, n, m, soft, guessed = cascade.answer(t, y)
        if asked == _OVERFLOW:
            return Solution(problem, None, Status.NOT_FINITE, run.iterations, NOT_FINITE, secondary)
        return verified(problem, cascade, secondary, tolerance, run)

    def _stage(self, problem: Problem) -> str:
        """The name of the level whose QP is being solved."""
        k = self._cascade.stage
        return HARD if k == 0 else problem.names[k - 1] if k <= problem.p else NEAREST


def verified(
    problem: Problem, cascade: _native.QPCascade, secondary: FloatArray | None, tolerance: float, run: _Run
) -> Solution:
    """The answer with its verdict; no x that breaks a hard row is returned."""
    x = cascade.x
    fault = fault_of(problem, x, secondary, tolerance)
    if fault and problem.hard is not None:
        broken = breaks_hard_rows(problem, x, tolerance)
        conflict = contradiction(problem, cascade.least) if broken else ""
        if conflict:
            return Solution(problem, None, Status.INFEASIBLE, run.iterations, conflict, secondary)
        if broken:
            unsure = Status.ITERATION_LIMIT if run.hit_limit else Status.INACCURATE
            return Solution(problem, None, unsure, run.iterations, " ".join([fault, *run.remarks]), secondary)
    status = Status.SOLVED
    if fault:
        status = Status.ITERATION_LIMIT if run.hit_limit else Status.INACCURATE
        fault = " ".join([fault, *(f"{remark}." for remark in run.remarks)])
    solution = Solution(problem, x, status, run.iterations, fault, secondary)
    solution.held = cascade.side
    return solution


class _Run:
    """What a back end did in one solve: iterations, whether it ended at its limit, what it said of failed runs."""

    def __init__(self, backend: Backend) -> None:
        self.backend = backend
        self.iterations = 0
        self.hit_limit = False
        self.remarks: list[str] = []

    def answer(self, qp: SlackQP, guessed: bool) -> tuple[FloatArray | None, FloatArray]:
        answer = self.backend.solve(qp, guessed)
        self.iterations += answer.iterations
        if answer.outcome is not Outcome.CONVERGED:
            answer = self._again(qp, guessed, answer)
            if answer.outcome is not Outcome.CONVERGED:
                self.hit_limit |= answer.outcome is Outcome.LIMIT
                self.remarks.append(answer.message)
            if answer.t is None:
                return None, NOTHING
        return answer.t, answer.y

    def _again(self, qp: SlackQP, guessed: bool, answer: QPAnswer) -> QPAnswer:
        """What is kept between calls must never cost an answer: once more, from nothing."""
        if not guessed and not self.backend.reused:
            return answer
        self.backend.reset()
        answer = self.backend.solve(qp)
        self.iterations += answer.iterations
        return answer
