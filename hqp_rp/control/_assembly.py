"""The rows of many tasks and limits in one matrix, checked: the inner part of `Stack.problem`.

The library's own tasks and joint limits state what they want as numbers, and one compiled call makes the rows of all of them;
other tasks and limits, and mink's, give theirs one by one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from hqp_rp.control._checks import real_array
from hqp_rp.control._compiled import CompiledRows
from hqp_rp.control._plan import Plan
from hqp_rp.core.description import unknown_block
from hqp_rp.core.errors import ProblemError, SettingError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.core.threads import in_shares
from hqp_rp.robot.robot import Robot

TASK, LIMIT, MINK_TASK = 0, 1, 2

Rows: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
Where: TypeAlias = Callable[[Any], str]

_empty = np.empty
_NONE = np.empty(0)
_WORTH_A_THREAD = 500  # configurations that take longer than a thread to start


class Assembly:
    """The rows of items on one robot.

    Args:
        items: pairs of a kind (TASK, LIMIT, MINK_TASK) and the item.
        robot: whose rows.
        two_sided: whether upper may differ from lower; otherwise it is the same array.
        where: says where an item stands, for errors.

    Attributes:
        robot: the robot. counts: how many rows each item had when `rows` was last called.
    """

    __slots__ = (
        "_items",
        "_n",
        "_others",
        "_own",
        "_plan",
        "_rows_of",
        "_shape",
        "_total",
        "_two_sided",
        "_where",
        "counts",
        "robot",
    )

    def __init__(self, items: Sequence[tuple[int, Any]], robot: Robot, two_sided: bool, where: Where) -> None:
        self.robot, self._n = robot, robot.nv
        self._items, self._two_sided, self._where = tuple(items), two_sided, where
        tasks = [(k, task) for k, (_, item) in enumerate(items) if (task := _compiled(item)) is not None]
        self._own = [k for k, _ in tasks]
        self._others = [(k, kind, item) for k, (kind, item) in enumerate(items) if k not in self._own]
        self._plan = Plan([task for _, task in tasks], robot)
        counts = [0] * len(self._items)
        for k, rows in zip(self._own, self._plan.counts, strict=True):
            counts[k] = rows
        self._place(counts)

    def _place(self, counts: list[int]) -> None:
        """Give every item its rows."""
        ends = np.cumsum([0, *counts])
        self._plan.table[:, 2] = ends[self._own]
        self.counts, self._shape, self._total = counts, (int(ends[-1]), self._n), int(ends[-1])
        self._rows_of = [slice(a, b) for a, b in itertools.pairwise(ends.tolist())]

    def rows(self, dt: float | None = None, v: FloatArray | None = None, *, plain: bool = False) -> Rows:
        """Matrix (M, nv), lower (M,) and upper (M,) of all items at the robot's current configuration; fresh arrays.

        Args:
            dt: s; not None where an item needs it.
            v: (nv,) velocity before the step, or None.
            plain: compiled tasks without weights, and with their errors in the place of rates.

        Raises `ProblemError` for rows that do not fit the robot, are not finite or have crossed bounds.
        """
        return self.described(dt, v, plain, unknown_block())[:3]

    def described(
        self, dt: float | None, v: FloatArray | None, plain: bool, block: IntArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, int]:
        """`rows`, and the address of a block of `hqp_rp.core.description.block_of`, which now says where they are."""
        others = self._given(dt, v) if self._others else None
        # Fresh at each step: a problem that someone keeps must not change when the next one is built.
        matrix, lower = _empty(self._shape), _empty(self._total)
        upper = _empty(self._total) if self._two_sided else _NONE
        if others is not None:
            for k, A, low, high in others:
                rows = self._rows_of[k]
                matrix[rows], lower[rows] = A, low
                if self._two_sided:
                    upper[rows] = high
        address = self._plan.fill(matrix, lower, upper, dt, v, plain, block)
        if not self._two_sided:
            upper = lower
        if not address:
            self._refuse(matrix, lower, upper)
        return matrix, lower, upper, address

    @property
    def is_compiled(self) -> bool:
        """Whether `many` serves: every row is a compiled task's, and no coordinate needs the robot to subtract it."""
        return self._plan.is_compiled and not (self._others or self._two_sided)

    def many(self, q: FloatArray, threads: int | None) -> tuple[FloatArray, FloatArray]:
        """Matrices (N, M, nv) and bounds (N, M) of equalities at q (N, nq), in one compiled call; errors as `rows`."""
        from hqp_rp.core.kernels.task_rows import many_task_rows

        plan = self._plan
        plan.pack()
        rotations, origins, jacobians = plan.frames.many(q, threads)
        matrices, lowers = np.empty((len(q), self._total, self._n)), np.empty((len(q), self._total))
        fixed = (plan.table, plan.index, plan.numbers)

        def work(span: slice) -> None:
            moving = (rotations[span], origins[span], jacobians[span], q[span], matrices[span], lowers[span])
            bad = many_task_rows(*fixed, *moving, _NONE)
            if bad >= 0:
                self._refuse(matrices[span][bad], lowers[span][bad], lowers[span][bad])

        in_shares(work, len(q), threads, least=_WORTH_A_THREAD)
        return matrices, lowers

    def _given(self, dt: float | None, v: FloatArray | None) -> list[tuple[int, Any, Any, Any]]:
        """(number, matrix, lower, upper) of every item that is not compiled; where a count changed, rows are dealt anew."""
        robot, n = self.robot, self._n
        found = []
        counts = self.counts
        for k, kind, item in self._others:
            if kind == TASK:
                A, lower = item.evaluate(robot)
                upper = lower
            elif kind == LIMIT:
                A, lower, upper = item.rows(robot, dt, v)
            else:
                A, lower = item.evaluate(robot, dt)
                upper = lower
            m = -1
            try:
                m = len(lower)
                fits = A.shape == (m, n) and lower.shape == (m,) == upper.shape
                fits = fits and A.dtype.kind in "fiub" and lower.dtype.kind in "fiub" and upper.dtype.kind in "fiub"
            except (AttributeError, TypeError):
                fits = False
            if not fits:
                A, lower, upper = (self._as_array(value, item) for value in (A, lower, upper))
                m = lower.size
                if not (A.shape == (m, n) and upper.shape == lower.shape == (m,)):
                    raise _misfit(A, lower, upper, n, self._where(item))
            if m != counts[k]:
                counts = [*counts[:k], m, *counts[k + 1 :]]
            found.append((k, A, lower, upper))
        if counts is not self.counts:
            self._place(counts)
        return found

    def _as_array(self, value: Any, item: Any) -> FloatArray:
        """What an item that is not ours returned, as an array; raises `ProblemError` where it is no real array."""
        try:
            return real_array(value, "it gives a value that")
        except SettingError as error:
            raise ProblemError(f"{self._where(item)}: {error}") from None

    def _refuse(self, matrix: FloatArray, lower: FloatArray, upper: FloatArray) -> None:
        """Raise `ProblemError` for the first item with a nan, an infinite entry or crossed bounds."""
        for (kind, item), rows in zip(self._items, self._rows_of, strict=True):
            A, low, high = matrix[rows], lower[rows], upper[rows]
            if not np.isfinite(A).all():
                i, j = (int(k) for k in np.argwhere(~np.isfinite(A))[0])
                raise ProblemError(f"{self._where(item)}: matrix[{i}, {j}] is {A[i, j]}; every entry must be finite.")
            if kind == LIMIT:
                bad = np.flatnonzero(~((low <= high) & (low < math.inf) & (high > -math.inf)))
                told = "lower[{0}] is {1}, upper[{0}] is {2}; every bound must be a number with lower <= upper, and infinite "
                told += "only to mean none."
            else:
                bad = np.flatnonzero(~np.isfinite(low))
                told = "rate[{0}] is {1}; every entry must be finite."
            if bad.size:
                i = int(bad[0])
                raise ProblemError(f"{self._where(item)}: {told.format(i, low[i], high[i])}")

    def __reduce__(self) -> tuple[Any, ...]:
        # Its arrays are views of one robot's own state: whoever is copied makes a new one when it needs one.
        return _none, ()


def _none() -> None:
    return None


def _compiled(item: Any) -> CompiledRows | None:
    """The compiled rows that an item is, or is made of; None where its own `evaluate` or `rows` has to be called."""
    task = getattr(item, "compiled", None)
    return task if isinstance(task, CompiledRows) else None


def _misfit(A: FloatArray, lower: FloatArray, upper: FloatArray, n: int, place: str) -> ProblemError:
    shapes = f"a matrix {np.shape(A)} and bounds {np.shape(lower)}"
    if np.shape(upper) != np.shape(lower):
        shapes += f" and {np.shape(upper)}"
    return ProblemError(f"{place} gives {shapes}; for this robot it must be a matrix (m, {n}) and m bounds, (m,).")
