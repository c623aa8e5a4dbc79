"""The hierarchy of equalities that an answer is near its data: which rows determine it, in which order, and how firmly.

Without inequalities every level is a block of rows. With them, a block is the rows of a level that count, its equalities and
those that x violates, at the bound they miss; or satisfied rows held at a bound, which come right before the first level that
presses against them. The formula that this serves: `hqp_rp.core.derivative`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.active import VIOLATED
from hqp_rp.core.diagnostics import two_norm
from hqp_rp.core.errors import HqpError
from hqp_rp.core.level import FloatArray, IntArray
from hqp_rp.core.metric import in_metric
from hqp_rp.core.problem import Problem
from hqp_rp.core.rounding import rounding_at_zero
from hqp_rp.core.solution import Solution
from hqp_rp.core.tolerances import NEAR_ZERO, RANK

AGREES = 1e-6
"""The given x must be that near, relative, to the optimum that its active rows give."""


class NotDifferentiableError(HqpError, ArithmeticError):
    """An answer that has no derivative where it is, or not one that can be told; the message names the row or the level."""


class Block(NamedTuple):
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


class Pulled(NamedTuple):
    """A residual and its multipliers: of block `block`, or of the norm, which counts as a block after the last one.

    weights: (rows,) multipliers of all rows; r in the block's own.
    """

    block: int
    weights: FloatArray


class EqualityBlocks:
    """Blocks B_i x = b_i, i = 1 ... q, whose hierarchy has the answer that a solution has while ranks and active rows stay.

    With a metric, all of it is said of y = R x, whose problem has none (`hqp_rp.core.metric`).

    Args:
        problem: without damped levels. solution: its answer.
        constant_rank: whether a level may have less rank than its rows and its freedom allow.
        tolerance: relative, >= 0; what is nearer than this to another rank or other active rows is refused.

    Attributes:
        blocks: in their order. Z: (n, d), the freedom that they leave. zeta: (n,) secondary vector. at: (n,) the answer.
        side: (rows,) of all rows, hard ones first: +1 or -1 for the bound that determines x, 0 for a row that does not.
        equality: (rows,) bool. unit: (rows,) what a row was multiplied by in its block, 0 where it is in none.
        pulls: the residuals that are not zero whatever the data, and that of the norm, with their multipliers.
        root, inverse: R and R^-1 (n, n), or None without a metric.

    Raises `NotDifferentiableError` where this is not so, or not firm.
    """

    def __init__(
        self, problem: Problem, solution: Solution, x: FloatArray, constant_rank: bool, tolerance: float
    ) -> None:
        self.problem = problem
        self.constant_rank = constant_rank
        self.tolerance = tolerance
        matrix, lower, upper, offsets = problem.with_hard
        self.root: FloatArray | None = None
        self.inverse: FloatArray | None = None
        self.zeta = np.zeros(problem.n) if solution.secondary is None else np.asarray(solution.secondary)
        y = x
        if problem.metric is not None:
            turned = in_metric(problem)
            self.root, self.inverse = turned.root, turned.inverse
            matrix, y, self.zeta = matrix @ turned.inverse, turned.root @ x, turned.root @ self.zeta
        self._rows = matrix
        self.equality = lower == upper
        self.side, counts = self._active(solution, x)
        self._bound = np.where(self.side < 0, lower, upper)
        self.unit = np.zeros(len(matrix))
        self.blocks: list[Block] = []
        self.Z = np.eye(problem.n)
        self.at = np.zeros(problem.n)
        self._size = _norm(y)
        self._build(counts, offsets)
        self._agree(y)
        self.pulls = self._multipliers()

    def sweep(self, h: FloatArray, count: int) -> FloatArray:
        """t (rows,) with sum_i B_i^T t_i = h - what h has in the freedom, over the first `count` blocks, the last one first."""
        t = np.zeros(len(self._rows))
        for block in reversed(self.blocks[:count]):
            own = block.P @ h
            t[block.rows] = own
            h = h - block.B.T @ own
        return t

    def named(self, row: int) -> str:
        """A row by its number in its level, as an error begins."""
        return f"Row {row - self.problem.with_hard.offsets[self._level_of(row)]} of {self.level_named(row)}"

    def level_named(self, row: int) -> str:
        """The level of a row in words."""
        return self._level(self._level_of(row))

    def _level_of(self, row: int) -> int:
        return int(np.searchsorted(self.problem.with_hard.offsets, row, side="right")) - 1

    def _active(self, solution: Solution, x: FloatArray) -> tuple[NDArray[np.int8], NDArray[np.bool_]]:
        """Sides (rows,), 0 for a row that does not determine x; which of the others count by their least squares."""
        if self.equality.all():
            return np.ones(len(self.equality), np.int8), np.ones(len(self.equality), np.bool_)
        problem = self.problem
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
        noise = _rounding(problem, x, matrix, lengths)
        bound = np.clip(value, lower, upper)
        violated = np.abs(value - bound) > VIOLATED * (size + np.abs(bound)) + noise
        violated[: problem.hard_rows] = False
        with np.errstate(invalid="ignore"):
            above = value >= upper - self.tolerance * (size + np.abs(upper)) - noise
            below = value <= lower + self.tolerance * (size + np.abs(lower)) + noise
        touched = np.flatnonzero((side == 0) & (above & np.isfinite(upper) | below & np.isfinite(lower)))
        if len(touched):
            raise NotDifferentiableError(
                f"{self.named(touched[0])} touches its {'upper' if above[touched[0]] else 'lower'} bound without being held "
                "there: the answer has a kink, and one-sided derivatives only."
            )
        return side, self.equality | violated

    def _level(self, level: int) -> str:
        if level:
            return f"level {self.problem.names[level - 1]!r}"
        hard = self.problem.hard
        return f"the hard rows {hard.name!r}" if hard is not None and hard.name else "the hard rows"

    def _build(self, counts: NDArray[np.bool_], offsets: IntArray) -> None:
        active = self.side != 0
        waiting = np.zeros(0, np.int64)  # held rows that no level has pressed upon yet
        for level, (start, end) in enumerate(zip(offsets[:-1].tolist(), offsets[1:].tolist(), strict=True)):
            if start == end:
                continue
            own = active[start:end]
            least = start + np.flatnonzero(own & counts[start:end])
            held = start + np.flatnonzero(own & ~counts[start:end])
            if len(least):
                unit = math.ldexp(1.0, -math.frexp(float(np.abs(self._rows[start:end]).max()))[1])
                self.unit[least] = unit
                B, b = self._rows[least] * unit, self._bound[least] * unit
                if len(waiting):
                    waiting = self._pressed(waiting, B, b, level)
                whole = B if len(least) == end - start else self._rows[start:end] * unit
                self._least_squares(level, least, B, b, whole)
            if len(held):
                waiting = np.concatenate((waiting, held))
        if len(waiting):
            waiting = self._pressed(waiting, np.eye(len(self.zeta)), self.zeta, None)
            if len(waiting):
                raise NotDifferentiableError(
                    f"{self.named(waiting[0])} is at its {self._words(waiting[0])} bound, where the answer would be without "
                    "it (its multiplier is zero): the answer has a kink, and one-sided derivatives only."
                )
        self.at = self.at + self.Z @ (self.Z.T @ self.zeta)

    def _least_squares(self, level: int, rows: IntArray, B: FloatArray, b: FloatArray, whole: FloatArray) -> None:
        """The rows of a level that count, with the rank rule on the whole level's norm."""
        m, d = len(rows), self.Z.shape[1]
        self._note(B, b)
        if not d:
            return
        U, sigma, Vt = np.linalg.svd(B @ self.Z, full_matrices=m < d)
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
        Q = self.Z @ Vt[:rank].T
        P = (U / sigma) @ Q.T
        self.Z = self.Z @ Vt[rank:].T
        self.at = self.at + P.T @ (b - B @ self.at)
        residual = None
        if rank < len(rows):
            residual = B @ self.at - b
            residual = residual - U @ (U.T @ residual)
        self.blocks.append(Block(rows, B, P, U, self.Z if deficient else None, residual))

    def _pressed(self, waiting: IntArray, B: FloatArray, b: FloatArray, level: int | None) -> IntArray:
        """Which of the held rows that wait are still not pressed upon after a level B x = b; the others become a block.

        level: its number, or None for the norm.
        """
        normals = self._rows[waiting]
        unit = 1.0 / _lengths(normals)
        normals, bounds = normals * unit[:, None], self._bound[waiting] * unit
        self.unit[waiting] = unit
        factors = self._independent(waiting, normals)
        U, sigma, Vt = factors
        r = len(sigma)
        free = self.Z @ Vt[r:].T
        scale = _norm(B)
        left, sizes, right = np.linalg.svd(B @ free, full_matrices=False)
        keep = sizes > RANK * scale
        if np.count_nonzero(keep) == len(B):
            return waiting  # the level is met beside them
        G = (U / sigma) @ Vt[:r]  # (w, d), the transposed pseudo-inverse of normals @ Z
        at = self.at + self.Z @ (G.T @ (bounds - normals @ self.at))
        at = at + free @ (right[keep].T @ ((left[:, keep].T @ (b - B @ at)) / sizes[keep]))
        gradient = B.T @ (B @ at - b)
        force = -(G @ (self.Z.T @ gradient)) * self.side[waiting]
        # Each force against what it is a sum of, and rounding of the whole: a large row says nothing of one it does not reach.
        reach = np.abs(G @ (B @ self.Z).T)
        least = self.tolerance * (reach @ (_lengths(B) * self._size + np.abs(b)))
        least = np.maximum(least, 8.0 * np.finfo(float).eps * scale * (scale * self._size + _norm(b)))
        wrong = waiting[force < -least]
        if len(wrong):
            by = "the norm" if level is None else self._level(level)
            raise NotDifferentiableError(
                f"{self.named(wrong[0])} is held at its {self._words(wrong[0])} bound, and {by} would be better without it: "
                "x is not the lexicographic optimum."
            )
        firm = force > least
        if not firm.any():
            return waiting
        if not firm.all():
            normals, bounds = normals[firm], bounds[firm]
            factors = np.linalg.svd(normals @ self.Z, full_matrices=True)
        self._note(normals, bounds)
        self._add(waiting[firm], normals, bounds, *factors, False)
        still: IntArray = waiting[~firm]
        return still

    def _independent(self, waiting: IntArray, normals: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        least = max(self.tolerance, RANK)
        projected = normals @ self.Z
        U, sigma, Vt = np.linalg.svd(projected, full_matrices=True)
        if len(sigma) < len(waiting) or sigma[-1] <= least:
            alone = np.linalg.norm(projected, axis=1)
            what = int(np.argmin(alone)) if alone.min() <= least else int(np.argmax(np.abs(U[:, -1])))
            raise NotDifferentiableError(
                f"{self.named(waiting[what])} is held at its {self._words(waiting[what])} bound beside rows that determine it "
                "already: which of them hold the answer is not unique, and it has one-sided derivatives only."
            )
        return U, sigma, Vt

    def _words(self, row: int) -> str:
        return "upper" if self.side[row] > 0 else "lower"

    def _note(self, B: FloatArray, b: FloatArray) -> None:
        """How long an x the bounds of rows ask for."""
        length = _norm(B)
        if length > 0.0:
            self._size = max(self._size, _norm(b) / length)

    def _agree(self, y: FloatArray) -> None:
        apart = _norm(self.at - y)
        if not apart <= AGREES * self._size:
            raise NotDifferentiableError(
                f"x is not the lexicographic optimum: with its active rows that is {apart:.1e} away, of size {self._size:.1e}. "
                "Take a solver that is exact for this problem."
            )

    def _multipliers(self) -> list[Pulled]:
        found = []
        for i, block in enumerate(self.blocks):
            if block.residual is not None:
                weights = self.sweep(-(block.B.T @ block.residual), i)
                weights[block.rows] = block.residual
                found.append(Pulled(i, weights))
        found.append(Pulled(len(self.blocks), self.sweep(self.zeta - self.at, len(self.blocks))))
        return found


def _norm(v: FloatArray) -> float:
    return math.sqrt(float(np.vdot(v, v)))


def _lengths(A: FloatArray) -> FloatArray:
    """(m,) ||a_i||_2; each row is scaled by its own largest entry, so that squares do not overflow."""
    largest = np.abs(A).max(axis=1, initial=0.0)
    unit = A / np.where(largest > 0.0, largest, 1.0)[:, None]
    lengths: FloatArray = largest * np.sqrt(np.einsum("ij,ij->i", unit, unit))
    return lengths


def _rounding(problem: Problem, x: FloatArray, matrix: FloatArray, lengths: FloatArray) -> FloatArray | float:
    """What `rounding_at_zero` makes of rows, which is 0 but for an x much shorter than the bounds."""
    _, lower, upper, _ = problem.with_hard
    asked = np.concatenate((np.abs(lower), np.abs(upper)))
    some = np.isfinite(asked) & (np.concatenate((lengths, lengths)) > 0.0)
    reach = float((asked[some] / np.concatenate((lengths, lengths))[some]).max(initial=0.0))
    return _lengths(matrix @ rounding_at_zero(problem, x)) if _norm(x) <= NEAR_ZERO * reach else 0.0
