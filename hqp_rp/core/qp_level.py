"""Levels solved one after another as small QPs: the state between levels, and one level's QP in its free directions."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from hqp_rp.core import qp_polish
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.core.qp_backend import Backend, Outcome, QPAnswer, SlackQP
from hqp_rp.core.solver import RANK_TOLERANCE

_EPS = float(np.finfo(np.float64).eps)
_FLAT = (
    1e-3  # Singular values are preconditioned away down to this fraction of the largest one: see `Cascade.minimize`.
)
_STRONG = 1e-6  # A row whose scaled multiplier or violation exceeds this stays where it is at later levels.


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
        self.Z: FloatArray = np.eye(n)
        self.finished = 0
        self.iterations = 0
        self.hit_limit = False
        self.remarks: list[str] = []
        self._rows = rows
        self._backend = backend
        self._memory = memory
        self._polish = polish
        self._taken = 0  # Rows numbered so far.
        self._kept = np.zeros((0, n))
        self._kept_lower = np.zeros(0)
        self._kept_upper = np.zeros(0)
        self._kept_ids: IntArray = np.zeros(0, dtype=np.int64)

    def minimize(self, A: FloatArray, lower: FloatArray, upper: FloatArray, name: str) -> None:
        """Minimize `||v||`, the violation of `lower <= A x <= upper`, in the free directions; keep what it reached.

        Equality rows are factored, `A_E Z = U S V^T`, so that no matrix is squared: in the coordinates
        `z = V_r D w + V_0 u` the level is

            min 1/2 ||S D w - U^T d||^2 + 1/2 ||s||^2,   d = b - A_E x

        subject to the two-sided rows of this level with slack s and the rows kept from earlier levels. D inverts S (but
        by no more than 1e9, so that near a singularity the kept rows do not blow up); without kept and two-sided rows
        D = S^-1 and the Hessian is the identity. Rows that must stay where they are (equalities, rows violated at
        the optimum, rows with a multiplier) are then eliminated by an orthonormal basis; the others are kept as rows.

        Args:
            A: (m, n), lower, upper: (m,), scaled to the order of one. name: for messages.
        """
        index = self.finished
        self.finished += 1
        if self.Z.shape[1] == 0:
            return  # Nothing can move any more: what the level finds is what it gets.
        ids = np.arange(self._taken, self._taken + len(A))
        self._taken += len(A)
        bounded = np.isfinite(lower) | np.isfinite(upper)
        if not bounded.all():
            A, lower, upper, ids = A[bounded], lower[bounded], upper[bounded], ids[bounded]
        equal = lower == upper
        E, b = A[equal], lower[equal]
        two_sided = ~equal
        S_rows, S_lower, S_upper, S_ids = A[two_sided], lower[two_sided], upper[two_sided], ids[two_sided]
        U, sigma, Vr, V0 = _factor(E @ self.Z, A)
        d = b - E @ self.x
        c = U.T @ d
        if len(S_rows) == 0 and len(self._kept) == 0:
            noise = 8.0 * _EPS * (norm(b) + norm(E.ravel()) * norm(self.x))
            size = _power_of_two(c)
            if size > 0.0 and norm(c) > noise:
                none = np.zeros(0)
                qp = SlackQP(np.ones(len(c)), c / -size, np.zeros((0, len(c))), none, none, 0)
                answer = self._solve(qp, None, name)
                if answer.t is not None:
                    self.x += self.Z @ (Vr @ (answer.t * size / sigma))
            self.Z = self.Z @ V0
            return
        D = 1.0 / np.maximum(sigma, _FLAT * sigma.max(initial=0.0))
        felt = self._felt(V0, S_rows)
        level = _LevelQP(self, S_rows, S_lower, S_upper, c, sigma * D, np.hstack([Vr * D, felt]))
        size = _power_of_two(np.concatenate([c, level.violation(np.zeros(level.n))]))
        t, y = np.zeros(level.n), np.zeros(level.m)
        if size > 0.0:
            qp = level.scaled(size)
            row_ids = np.concatenate([S_ids, self._kept_ids])
            answer = self._solve(qp, self._guess(index, level, size, row_ids), name)
            if answer.t is not None:
                t, y = answer.t, answer.y
                if self._polish:
                    t, y = qp_polish.polish(qp, t, y)
            self._remember(index, self.x + self.Z @ (level.T @ (t * size)), row_ids, level.unscaled(y) * size)
        self.x += self.Z @ (level.T @ (t * size))
        self._freeze(V0, S_rows, S_lower, S_upper, S_ids, y, size, A)

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

    def _felt(self, V0: FloatArray, rows: FloatArray) -> FloatArray:
        """Basis of the part of V_0 that some row feels: along the rest the QP would be free to run away."""
        ZV = self.Z @ V0
        if ZV.shape[1] == 0:
            return V0
        lengths = np.linalg.norm(rows, axis=1)
        directions = rows[lengths > 0.0] / lengths[lengths > 0.0, None]
        _, sigma, Vt = np.linalg.svd(np.concatenate([directions, self._kept]) @ ZV, full_matrices=False)
        return np.asarray(V0 @ Vt[sigma > 1e-10].T)

    def _freeze(
        self,
        V0: FloatArray,
        rows: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        ids: IntArray,
        y: FloatArray,
        size: float,
        A: FloatArray,
    ) -> None:
        """Eliminate what must stay where it is; keep the satisfied rows, never tighter than the point reached."""
        soft = len(rows)
        self.Z = self.Z @ V0
        value = rows @ self.x
        violation = np.abs(value - np.clip(value, lower, upper))
        fixed = violation > _STRONG * size if size > 0.0 else np.zeros(soft, dtype=bool)
        if fixed.any() and self.Z.shape[1]:
            self.Z = self.Z @ _factor(rows[fixed] @ self.Z, A)[3]
        held = np.abs(y[soft:]) > _STRONG
        if held.any() and self.Z.shape[1]:
            _, sigma, Vt = np.linalg.svd(self._kept[held] @ self.Z)
            # A held row without component left in the free directions is rounding noise, far above RANK_TOLERANCE.
            self.Z = self.Z @ Vt[int((sigma > 1e-10).sum()) :].T
        scale = np.array([norm(row) for row in rows])
        keep = ~fixed & (scale > 0.0)
        scale = scale[keep]
        self._kept = np.concatenate([self._kept[~held], rows[keep] / scale[:, None]])
        self._kept_lower = np.concatenate([self._kept_lower[~held], lower[keep] / scale])
        self._kept_upper = np.concatenate([self._kept_upper[~held], upper[keep] / scale])
        self._kept_ids = np.concatenate([self._kept_ids[~held], ids[keep]])
        free = np.linalg.norm(self._kept @ self.Z, axis=1) > 1e-12
        self._kept, self._kept_ids = self._kept[free], self._kept_ids[free]
        value = self._kept @ self.x
        self._kept_lower = np.minimum(self._kept_lower[free], value)
        self._kept_upper = np.maximum(self._kept_upper[free], value)

    def _guess(self, index: int, level: _LevelQP, size: float, ids: IntArray) -> tuple[FloatArray, FloatArray] | None:
        memory = None if self._memory is None else self._memory.get(index)
        if memory is None or len(memory.x) != len(self.x) or len(memory.y) != self._rows:
            return None
        t: FloatArray = np.linalg.pinv(level.T) @ (self.Z.T @ (memory.x - self.x)) / size
        y = level.scaled_multipliers(memory.y[ids]) / size
        return (t, y) if np.isfinite(t).all() and np.isfinite(y).all() else None

    def _remember(self, index: int, x: FloatArray, ids: IntArray, y: FloatArray) -> None:
        if self._memory is not None:
            multipliers = np.zeros(self._rows)
            multipliers[ids] = y
            self._memory[index] = Memory(x, multipliers)


class _LevelQP:
    """One level with rows, in coordinates t: z = T t; rows kept from earlier levels normalised to length one in t."""

    def __init__(
        self,
        cascade: Cascade,
        rows: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        c: FloatArray,
        curvature: FloatArray,
        T: FloatArray,
    ) -> None:
        x, ZT = cascade.x, cascade.Z @ T
        kept = cascade._kept @ ZT
        self._lengths = np.linalg.norm(kept, axis=1)
        value = rows @ x
        kept_value = cascade._kept @ x
        self.T = T
        self.n = T.shape[1]
        self.soft = len(rows)
        self.m = self.soft + len(kept)
        self._hessian = np.zeros(self.n)
        self._hessian[: len(c)] = curvature**2
        self._gradient = np.zeros(self.n)
        self._gradient[: len(c)] = -curvature * c
        reach = rows @ ZT
        # Rows that earlier levels have used up are rounding noise: nothing here may follow them.
        reach[np.linalg.norm(rows @ cascade.Z, axis=1) <= RANK_TOLERANCE * np.linalg.norm(rows, axis=1)] = 0.0
        self._rows = np.concatenate([reach, kept / self._lengths[:, None]])
        # The start is feasible by construction: a bound passed by rounding moves to where the point is.
        gap_lower = np.minimum(cascade._kept_lower - kept_value, 0.0) / self._lengths
        gap_upper = np.maximum(cascade._kept_upper - kept_value, 0.0) / self._lengths
        self._lower = np.concatenate([lower - value, gap_lower])
        self._upper = np.concatenate([upper - value, gap_upper])

    def violation(self, t: FloatArray) -> FloatArray:
        """(soft,) signed violation of this level's two-sided rows at t."""
        value = self._rows[: self.soft] @ t
        return np.asarray(value - np.clip(value, self._lower[: self.soft], self._upper[: self.soft]))

    def scaled(self, size: float) -> SlackQP:
        """The QP in t / size."""
        return SlackQP(
            self._hessian, self._gradient / size, self._rows, self._lower / size, self._upper / size, self.soft
        )

    def unscaled(self, y: FloatArray) -> FloatArray:
        """Multipliers of the rows as they are kept, from those of the normalised ones."""
        y = y.copy()
        y[self.soft :] /= self._lengths
        return y

    def scaled_multipliers(self, y: FloatArray) -> FloatArray:
        """The reverse of `unscaled`."""
        y = y.copy()
        y[self.soft :] *= self._lengths
        return y


def power_of_two_scale(A: FloatArray) -> int:
    """Exponent e such that A / 2^e has its largest entry in [0.5, 1); 0 for an empty or zero matrix."""
    return math.frexp(float(np.abs(A).max(initial=0.0)))[1]


def norm(v: FloatArray) -> float:
    """||v||_2 of a vector without overflow or underflow on the way."""
    square = float(v @ v)
    if 1e-280 < square < 1e280:
        return math.sqrt(square)
    largest = float(np.abs(v).max(initial=0.0))
    if largest == 0.0 or not math.isfinite(largest):
        return largest
    v = v / largest
    return largest * math.sqrt(float(v @ v))


def _power_of_two(v: FloatArray) -> float:
    largest = float(np.abs(v).max(initial=0.0))
    return math.ldexp(1.0, math.frexp(largest)[1]) if 0.0 < largest < math.inf else 0.0


def _factor(AZ: FloatArray, A: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """(U, sigma, V_r, V_0) of `AZ = U diag(sigma) V_r^T`, V_0 its null space, by the rank rule with ||A||_2."""
    m, r = AZ.shape
    if m == 0 or r == 0:
        return np.zeros((m, 0)), np.zeros(0), np.zeros((r, 0)), np.eye(r)
    U, sigma, Vt = np.linalg.svd(AZ, full_matrices=True)
    rank = len(sigma)
    if sigma[-1] <= RANK_TOLERANCE * norm(A.ravel()):
        rank = int((sigma > RANK_TOLERANCE * float(np.linalg.norm(A, 2))).sum())
    return U[:, :rank], sigma[:rank], Vt[:rank].T, Vt[rank:].T
