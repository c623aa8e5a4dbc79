"""Levels solved one after another as small QPs: one level's QP in its free directions, and the descent through all of them.

Level k minimizes `||v||`, the violation of `lower <= A x <= upper`, in the directions Z that finished levels leave free.
Its equality rows are factored, so that no matrix is squared: `A_E Z = L Q^T`, L = U R where it has more rows than columns, or
`U S V^T` where its rank or condition needs it. In the coordinates `z = Q L^-1 w + V_0 u` (`V_r D w + V_0 u`) the level is

    min 1/2 ||S D w - U^T d||^2 + 1/2 ||s||^2,   d = b - A_E x

(S D = I for L and R) subject to the two-sided rows of this level with slack s and the rows kept from earlier levels. D inverts
S, but by no more than 1e3 / ||S||, so that near a singularity the kept rows do not blow up; without kept and two-sided rows
D = S^-1 and the Hessian is the identity. Rows that must stay where they are (equalities, rows violated at the optimum, rows
with a multiplier) are then eliminated by an orthonormal basis; the others are kept. Rows are scaled by powers of two first,
hard rows each by its own, a level as a whole. Levels of equalities alone go a quicker way (`qp_equalities`), whose answers
are proven; where it says nothing, they come here.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.qp_backend import INFINITE, NOTHING, Backend, DenseQP, Outcome, QPAnswer, SlackQP, ones
from hqp_rp.core.qp_equalities import QuickDesk
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.verify import contradiction, fault_of, hard_excess

HARD = "the hard rows"
NEAREST = "the distance to the secondary vector"
NOT_FINITE = "x holds infinite or undefined numbers."


class _Views(NamedTuple):
    """A QP of one shape as views of the desk, and the guess it may be started from."""

    qp: SlackQP
    guess: tuple[FloatArray, FloatArray]
    dense: DenseQP | None


class Desk:
    """The arrays on which problems of one shape are solved, with the warm starts of the last one.

    Args:
        n, hard, offsets: unknowns, hard rows and the levels' offsets of the problems.
    """

    def __init__(self, n: int, hard: int, offsets: Any) -> None:
        from hqp_rp.core.kernels import qp_descent, qp_desk, verify, verify_room

        self._kernels, self._layout, self._prove = qp_descent, qp_desk, verify.prove
        p = len(offsets) - 1
        rows = hard + int(offsets[-1])
        layout: Any = qp_desk
        *_, numbers, _, counts = layout.desk_parts(n, rows, p)
        self._numbers, self._counts = np.zeros(numbers), np.zeros(counts, np.int64)
        self._counts[layout.N], self._counts[layout.M], self._counts[layout.P] = n, rows, p
        self._numbers[layout.RANK_TOLERANCE] = RANK_TOLERANCE
        self._numbers[layout.INFINITE] = INFINITE
        desk = layout.desk_of.py_func(self._numbers, self._counts)  # as it stands: compiled code has it inlined
        self._x, self._start, self._least = desk.x[:n], desk.start[:n], desk.least[:n]
        self._side, self._qp = desk.side, desk.qp
        *_, numbers, counts = verify_room.proof_parts(rows, n, p + 1)
        room = np.empty(numbers), np.empty(counts, np.int64)
        self._to_prove = *room, desk.raw, desk.lower, desk.upper, desk.offsets, self._x, self._start
        self._no_hard = _read_only(np.zeros((0, n))), _read_only(np.zeros(0)), _read_only(np.zeros(0))
        self._views: dict[tuple[int, int, int], _Views] = {}
        self._quick: QuickDesk | None = None
        self.used = False

    def solve(
        self, problem: Problem, secondary: FloatArray | None, backend: Backend, tolerance: float, *, polish: bool
    ) -> Solution:
        """Hard rows, levels, distance to the secondary vector; every answer verified before it is called solved.

        Args:
            problem: of the shape of this desk. secondary: (n,) or None. backend: solves the QPs.
            tolerance: relative, of the verdict. polish: refine each answer on the active rows that the back end found.
        """
        self.used = True
        hard = problem.hard
        iterations = 0
        if hard is None and problem.is_equality:
            if self._quick is None:
                self._quick = QuickDesk(problem.n, problem.stacked[3])
            x, iterations = self._quick.solve(problem, secondary, backend, tolerance)
            if x is not None:
                solution = Solution(problem, x, Status.SOLVED, iterations, "", secondary)
                solution.held = self._quick.held
                return solution
        run = _Run(backend, iterations)
        kernels, layout, numbers, counts = self._kernels, self._layout, self._numbers, self._counts
        counts[layout.DENSE] = backend.wants_dense
        counts[layout.POLISH] = polish
        numbers[layout.TOLERANCE] = tolerance
        self._start[:] = 0.0 if secondary is None else secondary
        top = self._no_hard if hard is None else (hard.A, hard.lower, hard.upper)
        try:
            kernels.begin(*top, *problem.stacked, numbers, counts)
            code, t, m, soft, guessed = kernels.advance(numbers, counts)
            while code >= kernels.PLAIN:
                if code == kernels.PLAIN:
                    kernels.answer(numbers, counts, *run.answer(self._plain(t), None, None, self._stage, problem))
                elif code == kernels.ROWS:
                    views = self._views.get((t, m, soft)) or self._cut(t, m, soft)
                    guess = views.guess if guessed else None
                    kernels.answer(numbers, counts, *run.answer(views.qp, guess, views.dense, self._stage, problem))
                elif hard is not None and (conflict := _conflict(hard, self._x, tolerance)):
                    return Solution(problem, None, Status.INFEASIBLE, run.iterations, conflict, secondary)
                code, t, m, soft, guessed = kernels.advance(numbers, counts)
            if code == kernels.DONE:
                if not self._prove(*self._to_prove, tolerance, RANK_TOLERANCE):
                    return self._judged(problem, secondary, tolerance, run)
                solution = Solution(problem, self._x.copy(), Status.SOLVED, run.iterations, "", secondary)
                solution.held = self._side.astype(np.int8)
                return solution
        except (ValueError, np.linalg.LinAlgError):  # numba's SVD meets an overflow that arose on the way
            pass
        return Solution(problem, None, Status.NOT_FINITE, run.iterations, NOT_FINITE, secondary)

    def _judged(self, problem: Problem, secondary: FloatArray | None, tolerance: float, run: _Run) -> Solution:
        """What the compiled proof did not accept: judged by the full certificate."""
        x = self._x.copy()
        fault = fault_of(problem, x, secondary, tolerance, tried=True)
        if fault and problem.hard is not None and (conflict := _conflict(problem.hard, self._least, tolerance)):
            return Solution(problem, None, Status.INFEASIBLE, run.iterations, conflict, secondary)
        status = Status.SOLVED
        if fault:
            status = Status.ITERATION_LIMIT if run.hit_limit else Status.INACCURATE
            fault = " ".join([fault, *(f"{remark}." for remark in run.remarks)])
        solution = Solution(problem, x, status, run.iterations, fault, secondary)
        solution.held = self._side.astype(np.int8)
        return solution

    def _stage(self, problem: Problem) -> str:
        """The name of the level whose QP is being solved."""
        k = int(self._counts[self._layout.STAGE])
        return HARD if k == 0 else problem.names[k - 1] if k <= problem.p else NEAREST

    def _plain(self, t: int) -> SlackQP:
        """min 1/2 ||w||^2 + gradient . w, w (t,)."""
        views = self._views.get((t, 0, 0))
        if views is None:
            qp = SlackQP(ones(t), self._qp[t : 2 * t], np.zeros((0, t)), NOTHING, NOTHING, 0)
            views = self._views[t, 0, 0] = _Views(qp, (NOTHING, NOTHING), None)
        return views.qp

    def _cut(self, t: int, m: int, soft: int) -> _Views:
        q, full = self._qp, t + soft
        a, b, c, d, e, f, g, h, i, j, k, o, end = self._layout.qp_parts(t, m, soft)
        qp = SlackQP(q[:a], q[a:b], q[b:c].reshape(m, t), q[c:d], q[d:e], soft)
        dense = DenseQP(q[g:h].reshape(full, full), q[h:i], q[i:j].reshape(m, full), q[j:k], q[k:o], q[o:end])
        views = self._views[t, m, soft] = _Views(qp, (q[e:f], q[f:g]), dense)
        return views


class _Run:
    """What a back end did in one descent: iterations, whether it ended at its limit, what it said of failed runs."""

    def __init__(self, backend: Backend, iterations: int) -> None:
        self.backend = backend
        self.iterations = iterations
        self.hit_limit = False
        self.remarks: list[str] = []

    def answer(
        self,
        qp: SlackQP,
        guess: tuple[FloatArray, FloatArray] | None,
        dense: DenseQP | None,
        name_of: Any,
        problem: Problem,
    ) -> tuple[FloatArray, FloatArray]:
        backend = self.backend
        answer = backend.solve(qp, guess, dense)
        self.iterations += answer.iterations
        if answer.outcome is not Outcome.CONVERGED:
            answer = self._again(qp, guess, dense, answer)
            if answer.outcome is not Outcome.CONVERGED:
                self.hit_limit |= answer.outcome is Outcome.LIMIT
                self.remarks.append(f"{name_of(problem)}: {answer.message}")
            if answer.t is None:
                return NOTHING, NOTHING
        assert answer.t is not None
        return answer.t, answer.y

    def _again(self, qp: SlackQP, guess: Any, dense: DenseQP | None, answer: QPAnswer) -> QPAnswer:
        """What is kept between calls must never cost an answer: once more, from nothing."""
        if guess is None and not self.backend.reused:
            return answer
        self.backend.reset()
        answer = self.backend.solve(qp, None, dense)
        self.iterations += answer.iterations
        return answer


def _conflict(hard: Level, x: FloatArray, tolerance: float) -> str:
    """A sentence that names the rows in conflict when x (n,) violates hard rows and proves that every point does, else ""."""
    with np.errstate(all="ignore"):
        return contradiction(hard, x) if hard_excess(hard, x) > tolerance else ""


def _read_only(array: FloatArray) -> FloatArray:
    array.flags.writeable = False
    return array
