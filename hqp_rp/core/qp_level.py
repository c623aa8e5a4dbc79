"""Levels solved one after another as small QPs: the state between levels, and one level's QP in its free directions."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np

from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.core.qp_backend import Backend, Outcome, QPAnswer, SlackQP
from hqp_rp.core.qp_native import qp_kernels
from hqp_rp.core.solver import RANK_TOLERANCE

_NO_ROWS = np.zeros(0)
_NO_IDS = np.zeros(0, dtype=np.int64)
_EPS = float(np.finfo(np.float64).eps)


@functools.cache
def identity(n: int) -> FloatArray:
    """The identity (n, n), which nobody writes to."""
    return np.eye(n)


@dataclasses.dataclass(slots=True, eq=False)
class Memory:
    """What one level's QP is warm-started from: its point x (n,) and the multipliers of all rows, by row number."""

    x: FloatArray
    y: FloatArray


class Cascade:
    """The state of a lexicographic descent: a point, the directions still free, the rows to be kept.

    Args:
        x: (n,) where to start; among equally good answers the last level draws the answer back to it.
        rows: total number of rows that will be given, for the memory of multipliers.
        backend: solves the QPs. memory: one `Memory` for each level number, read and written; None starts cold.
        polish: refine each answer on the active rows that the back end found.

    Attributes:
        x: the point. Z: (n, r) orthonormal basis of the directions that no finished level cares about.
        finished: number of finished levels. iterations: of the back end, summed.
        hit_limit: whether a back end ended at its iteration limit. remarks: what back ends said of failed runs.
    """

    def __init__(
        self, x: FloatArray, rows: int, backend: Backend, memory: dict[int, Memory] | None, *, polish: bool
    ) -> None:
        n = len(x)
        self.start = x
        self.x = x.copy()
        self.Z: FloatArray = identity(n)
        self.finished = 0
        self.iterations = 0
        self.hit_limit = False
        self.remarks: list[str] = []
        self._rows = rows
        self._backend = backend
        self._memory = memory
        self._polish = polish
        self._taken = 0  # Rows numbered so far.
        self._kernels = qp_kernels()
        self._kept = _no_rows(n)
        self._kept_lower = self._kept_upper = _NO_ROWS
        self._kept_ids: IntArray = _NO_IDS

    def minimize(
        self, A: FloatArray, lower: FloatArray, upper: FloatArray, name: str, *, row_by_row: bool = False
    ) -> None:
        """Minimize `||v||`, the violation of `lower <= A x <= upper`, in the free directions; keep what it reached.

        Equality rows are factored, so that no matrix is squared: A_E Z = L Q^T, or U S V^T where L is not square or its
        rank or condition needs it. In the coordinates `z = Q L^-1 w + V_0 u` (`V_r D w + V_0 u`) the level is

            min 1/2 ||S D w - U^T d||^2 + 1/2 ||s||^2,   d = b - A_E x

        (U = S D = I for L) subject to the two-sided rows of this level with slack s and the rows kept from earlier levels.
        D inverts S, but by no more than 1e3 / ||S||, so that near a singularity the kept rows do not blow up; without kept
        and two-sided rows D = S^-1 and the Hessian is the identity. Rows that must stay where they are (equalities, rows
        violated at the optimum, rows with a multiplier) are then eliminated by an orthonormal basis; the others are kept.

        Args:
            A: (m, n), lower, upper: (m,), C-contiguous and writable; the same array twice for equalities.
            name: for messages. row_by_row: scale each row by its own power of two, not the level as a whole.
        """
        kernels, index, first = self._kernels, self.finished, self._taken
        self.finished += 1
        self._taken += len(A)
        if self.Z.shape[1] == 0 or not len(A):
            return  # Nothing can move any more: what the level finds is what it gets.
        if not len(self._kept) and (lower is upper or bool((lower == upper).all())):
            gradient, size, L, ZQ = kernels.plain_level(A, lower, row_by_row, self.Z, self.x, RANK_TOLERANCE)
            w = _NO_ROWS
            if size > 0.0:
                answer = self._solve(unconstrained(gradient), None, name)
                if answer.t is None:
                    size = 0.0
                else:
                    w = answer.t
            elif size < 0.0:
                raise OverflowError
            self.Z = kernels.finish_plain(w, size, L, ZQ, self.x)
            return
        A, low, up, fits = kernels.scaled_rows(A, lower, upper, row_by_row)
        if not fits:
            # A bound that overflows in scaled units puts x beyond what floats hold: there is no answer.
            raise OverflowError
        ids = np.arange(first, first + len(A))
        self._minimize_with_rows(index, A, low, up, ids, name, False)

    def nearest(self, point: FloatArray, name: str) -> None:
        """Minimize `||x - point||` in the free directions: the last level, which leaves nothing free."""
        n = len(point)
        index = self.finished
        self.finished += 1
        if self.Z.shape[1] == 0:
            return
        if len(self._kept):
            ids = np.arange(self._taken, self._taken + n)
            self._minimize_with_rows(index, identity(n), point, point, ids, name, True)
            return
        c = (self.x - point) @ self.Z
        length = float(c @ c)
        noise = 8.0 * _EPS
        if length > noise * noise * (float(point @ point) + float(self.x @ self.x)):
            size = float(np.abs(c).max())
            answer = self._solve(unconstrained(c / size), None, name)
            if answer.t is not None:
                self.x += self.Z @ (answer.t * size)
        self.Z = _no_columns(n)

    def _minimize_with_rows(
        self, index: int, A: FloatArray, low: FloatArray, up: FloatArray, ids: IntArray, name: str, last: bool
    ) -> None:
        kernels = self._kernels
        memory = None if self._memory is None else self._memory.get(index)
        if memory is not None and (len(memory.x) != len(self.x) or len(memory.y) != self._rows):
            memory = None
        guess_x, guess_y = (_NO_ROWS, _NO_ROWS) if memory is None else (memory.x, memory.y)
        kept_ids = self._kept_ids
        kept = (self._kept, self._kept_lower, self._kept_upper)
        size, T, Z0, hessian, gradient, rows, lower, upper, lengths, S, guess_t, guess = kernels.level_with_rows(
            A, low, up, self.Z, self.x, *kept, last, RANK_TOLERANCE, guess_x, guess_y, ids, kept_ids
        )
        t, y = _NO_ROWS, _NO_ROWS
        if size > 0.0:
            t, y = np.zeros(T.shape[1]), np.zeros(len(lower))
            if T.shape[1]:
                qp = SlackQP(hessian, gradient, rows, lower, upper, len(S))
                answer = self._solve(qp, (guess_t, guess) if len(guess_t) else None, name)
                if answer.t is not None:
                    t, y = answer.t, answer.y
                    if self._polish:
                        t, y = _polish(hessian, gradient, rows, lower, upper, len(S), t, y)
        self.Z, self._kept, self._kept_lower, self._kept_upper, self._kept_ids = kernels.finish_with_rows(
            A, low, up, ids, S, T, Z0, t, y, size, self.x, *kept, kept_ids, RANK_TOLERANCE
        )
        if size > 0.0 and self._memory is not None:
            multipliers = np.zeros(self._rows)
            soft = len(S)
            multipliers[ids[S]] = y[:soft] * size
            multipliers[kept_ids] = y[soft:] * size / np.where(lengths[soft:] > 0.0, lengths[soft:], 1.0)
            self._memory[index] = Memory(self.x.copy(), multipliers)

    def _solve(self, qp: SlackQP, guess: tuple[FloatArray, FloatArray] | None, name: str) -> QPAnswer:
        answer = self._backend.solve(qp, guess)
        self.iterations += answer.iterations
        if answer.outcome is not Outcome.CONVERGED and (guess is not None or self._backend.reused):
            # What is kept between calls must never cost an answer: once more, from nothing.
            self._backend.reset()
            answer = self._backend.solve(qp)
            self.iterations += answer.iterations
        if answer.outcome is not Outcome.CONVERGED:
            self.hit_limit |= answer.outcome is Outcome.LIMIT
            self.remarks.append(f"{name}: {answer.message}")
        return answer


def unconstrained(gradient: FloatArray) -> SlackQP:
    """min 1/2 ||w||^2 + gradient . w."""
    n = len(gradient)
    return SlackQP(_ones(n), gradient, _no_rows(n), _NO_ROWS, _NO_ROWS, 0)


@functools.cache
def _no_columns(n: int) -> FloatArray:
    return np.zeros((n, 0))


@functools.cache
def _no_rows(n: int) -> FloatArray:
    return np.zeros((0, n))


def _polish(*arguments: Any) -> tuple[FloatArray, FloatArray]:
    from hqp_rp.core.kernels.qp_polish import polish

    answer: tuple[FloatArray, FloatArray] = polish(*arguments)
    return answer


@functools.cache
def _ones(n: int) -> FloatArray:
    return np.ones(n)
