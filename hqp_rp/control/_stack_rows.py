"""The rows of many tasks and limits in one matrix, checked: the inner part of `Stack.problem`.

The library's own tasks and joint limits state what they want as numbers, and one native call makes the rows of all of them;
other tasks and limits, and those of mink and pink, give theirs one by one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hqp_rp.control._checks import real_array
from hqp_rp.control._native_rows import Layout, NativeRows
from hqp_rp.core import _native
from hqp_rp.core.errors import ProblemError, SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.row_kinds import BOX, POSTURE
from hqp_rp.core.threads import in_shares
from hqp_rp.robot.frames import Point, frames_of
from hqp_rp.robot.robot import Robot

TASK, LIMIT, DISPLACEMENT_TASK = 0, 1, 2

Rows: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
Where: TypeAlias = Callable[[Any], str]

_empty = np.empty
_NONE = np.empty(0)
_WORTH_A_THREAD = 500  # configurations that take longer than a thread to start


class StackRows:
    """The rows of items on one robot.

    Args:
        items: pairs of a kind (TASK, LIMIT, DISPLACEMENT_TASK) and the item.
        robot: whose rows.
        two_sided: whether upper may differ from lower; otherwise it is the same array.
        where: says where an item stands, for errors.

    Attributes:
        robot: the robot. counts: how many rows each item had when `rows` was last called.
    """

    __slots__ = (
        "_a",
        "_accelerated",
        "_differences",
        "_fill",
        "_frames",
        "_index",
        "_items",
        "_jerked",
        "_n",
        "_native",
        "_numbers",
        "_others",
        "_own",
        "_own_q",
        "_packed",
        "_packs",
        "_read_frames",
        "_rows_of",
        "_shape",
        "_table",
        "_total",
        "_two_sided",
        "_unactuated",
        "_v",
        "_values",
        "_where",
        "counts",
        "robot",
    )

    def __init__(self, items: Sequence[tuple[int, Any]], robot: Robot, two_sided: bool, where: Where) -> None:
        self.robot, self._n = robot, robot.nv
        self._items, self._two_sided, self._where = tuple(items), two_sided, where
        tasks = [(k, task) for k, (_, item) in enumerate(items) if (task := _native_rows(item)) is not None]
        self._own = [k for k, _ in tasks]
        self._others = [(k, kind, item) for k, (kind, item) in enumerate(items) if k not in self._own]
        self._unactuated = getattr(robot, "unactuated", None)
        rows = self._lay_out([task for _, task in tasks])
        counts = [0] * len(self._items)
        for k, count in zip(self._own, rows, strict=True):
            counts[k] = count
        self._place(counts)

    def _lay_out(self, tasks: list[NativeRows]) -> list[int]:
        """Give the native rows their arrays, once; how many rows each task has."""
        robot, n = self.robot, self._n
        layouts = [task._layout(robot) for task in tasks]
        names = dict.fromkeys(name for layout in layouts for name in (layout.frame, layout.axes) if name is not None)
        frames = self._frames = frames_of(robot, tuple(names))
        number: dict[str | Point | None, int] = {None: -1} | {name: i for i, name in enumerate(names)}
        self._packs: list[tuple[Layout, slice]] = []
        self._packed = [(task, _NONE) for task in tasks]
        # The first that needs the velocity before the step, and the first that needs the acceleration.
        pairs = list(zip(tasks, layouts, strict=True))
        self._accelerated = next((task for task, layout in pairs if layout.accelerated), None)
        self._jerked = next((task for task, layout in pairs if layout.jerked), None)
        self._differences: list[tuple[NativeRows, slice]] = []
        nq = robot.nq if {POSTURE, BOX} & {layout.kind for layout in layouts} else 0
        before = nq + 1 + n
        values = before + (n if self._jerked is not None else 0)  # q, dt, v and a before the step; then differences
        table: list[list[int]] = []
        index: list[int] = []
        end = 0
        for task, layout in pairs:
            size = len(task._current(robot, layout))
            table.append([layout.kind, layout.rows, 0, end, number[layout.frame], number[layout.axes], len(index)])
            self._packs.append((layout, slice(end, end + size)))
            end += size
            index += layout.index
            if layout.difference:  # minus what only the robot can subtract
                self._differences.append((task, slice(values, values + n)))
                index += [values + i for i in layout.index]
                values += n
            elif layout.kind == BOX:
                index += [nq, before if layout.jerked else -1]
        self._table = np.array(table, dtype=np.int64).reshape(len(table), 7)
        self._index = np.array(index, dtype=np.int64)
        self._numbers, self._values = np.zeros(end), np.zeros(values)
        self._v, self._a = self._values[nq + 1 : before], self._values[before : before + n]
        kinematics = frames.kinematics if names else None
        kept_q = frames.q if nq else None
        self._own_q = self._values[:nq] if nq and kept_q is None else None
        self._read_frames = frames.read if names and kinematics is None else None
        arrays = (self._table, self._index, self._numbers, self._values)
        poses = (frames.rotations, frames.origins, frames.jacobians)
        self._native = _native.Rows(*arrays, *poses, kinematics, kept_q, nq)
        self._fill = self._native.fill
        return [layout.rows for layout in layouts]

    def _place(self, counts: list[int]) -> None:
        """Give every item its rows."""
        ends = np.cumsum([0, *counts])
        self._table[:, 2] = ends[self._own]
        self._native.place()
        self.counts, self._shape, self._total = counts, (int(ends[-1]), self._n), int(ends[-1])
        self._rows_of = [slice(a, b) for a, b in itertools.pairwise(ends.tolist())]

    @property
    def is_jerked(self) -> bool:
        """Whether the acceleration before the step is needed."""
        return self._jerked is not None

    def rows(
        self, dt: float | None = None, v: FloatArray | None = None, a: FloatArray | None = None, *, plain: bool = False
    ) -> Rows:
        """Matrix (M, nv), lower (M,) and upper (M,) of all items at the robot's current configuration; fresh arrays.

        Args:
            dt: s; not None where an item needs it.
            v: (nv,) velocity before the step, or None. a: (nv,) acceleration before the step, or None.
            plain: native tasks without weights, and with their errors in the place of rates.

        Raises `ProblemError` for rows that do not fit the robot, are not finite or have crossed bounds.
        """
        v = self._own_velocity(v)
        others = self._given(dt, v) if self._others else None
        # Fresh at each step: a problem that someone keeps must not change when the next one is built.
        matrix, lower = _empty(self._shape), _empty(self._total)
        upper = _empty(self._total) if self._two_sided else None
        if others is not None:
            for k, A, low, high in others:
                rows = self._rows_of[k]
                matrix[rows], lower[rows] = A, low
                if upper is not None:
                    upper[rows] = high
        for i, (task, packed) in enumerate(self._packed):
            if task._packed is not packed:
                self._pack_one(i, task)
        if (
            self._accelerated is not None
            or self._own_q is not None
            or self._read_frames is not None
            or self._differences
        ):
            self._ask(v, a)
        sound = self._call_native(matrix, lower, upper, 0.0 if dt is None else dt, plain)
        if upper is None:
            upper = lower
        if not sound:
            self._refuse(matrix, lower, upper)
        if self._unactuated is not None and self._unactuated.size and not plain:
            self._take_out(matrix, lower, upper)
        return matrix, lower, upper

    def _own_velocity(self, v: FloatArray | None) -> FloatArray | None:
        """The velocity that rows are made with."""
        return v

    def _call_native(
        self, matrix: FloatArray, lower: FloatArray, upper: FloatArray | None, dt: float, plain: bool
    ) -> bool:
        return self._fill(matrix, lower, upper, dt, plain)

    def _take_out(self, matrix: FloatArray, lower: FloatArray, upper: FloatArray) -> None:
        """Move what the robot does not drive, at its known velocity, to the right side: A_d v_d = b - A_o v_o."""
        others = self._unactuated
        known: FloatArray = self.robot.unactuated_velocity  # type: ignore[attr-defined]
        theirs = matrix[:, others]
        alone: NDArray[np.bool_] = np.any(theirs != 0.0, axis=1)
        matrix[:, others] = 0.0
        if known.any():
            moved = theirs @ known
            lower -= moved
            if upper is not lower:
                upper -= moved
        alone &= ~np.any(matrix != 0.0, axis=1)
        for (kind, _), rows in zip(self._items, self._rows_of, strict=True):
            if kind == LIMIT and alone[rows].any():  # a limit on something else binds nobody here
                lower[rows][alone[rows]] = -math.inf
                upper[rows][alone[rows]] = math.inf

    def _pack(self) -> None:
        """Bring the numbers up to date: the rows are new, or a setter was called."""
        for i, (task, packed) in enumerate(self._packed):
            if task._packed is not packed:
                self._pack_one(i, task)

    def _pack_one(self, i: int, task: NativeRows) -> None:
        layout, span = self._packs[i]
        current = task._current(self.robot, layout)
        self._numbers[span] = current
        self._packed[i] = task, current

    def _ask(self, v: FloatArray | None, a: FloatArray | None) -> None:
        """The motion before the step, and what only the robot knows: poses and Jacobians, coordinates, differences."""
        robot = self.robot
        if self._jerked is not None:
            if v is None or a is None:
                self._jerked._require_acceleration()
            self._a[...] = a
        if self._accelerated is not None:
            if v is None:
                self._accelerated._require_velocity()
            self._v[...] = v
        if self._read_frames is not None:
            self._read_frames()
        if self._own_q is not None:
            self._own_q[...] = robot.q
        for task, span in self._differences:
            self._values[span] = -robot.difference(robot.q, task.target)  # type: ignore[attr-defined]

    @property
    def is_native(self) -> bool:
        """Whether `many` serves: every row is a native task's, and no coordinate needs the robot to subtract it."""
        others = self._unactuated is not None and self._unactuated.size
        return not (self._differences or self._others or self._two_sided or others)

    def many(self, q: FloatArray, threads: int | None) -> tuple[FloatArray, FloatArray]:
        """Matrices (N, M, nv) and bounds (N, M) of equalities at q (N, nq), in one native call; errors as `rows`."""
        self._pack()
        rotations, origins, jacobians = self._frames.many(q, threads)
        matrices, lowers = np.empty((len(q), self._total, self._n)), np.empty((len(q), self._total))
        q = np.ascontiguousarray(q)

        def work(span: slice) -> None:
            moving = (rotations[span], origins[span], jacobians[span], q[span], matrices[span], lowers[span])
            bad = self._native.fill_many(*moving)
            if bad >= 0:
                self._refuse(matrices[span][bad], lowers[span][bad], lowers[span][bad])

        in_shares(work, len(q), threads, least=_WORTH_A_THREAD)
        return matrices, lowers

    def _given(self, dt: float | None, v: FloatArray | None) -> list[tuple[int, Any, Any, Any]]:
        """(number, matrix, lower, upper) of every item that is not native; where a count changed, rows are dealt anew."""
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


def _native_rows(item: Any) -> NativeRows | None:
    """The native rows that an item is, or is made of; None where its own `evaluate` or `rows` has to be called."""
    task = getattr(item, "native", None)
    return task if isinstance(task, NativeRows) else None


def _misfit(A: FloatArray, lower: FloatArray, upper: FloatArray, n: int, place: str) -> ProblemError:
    shapes = f"a matrix {np.shape(A)} and bounds {np.shape(lower)}"
    if np.shape(upper) != np.shape(lower):
        shapes += f" and {np.shape(upper)}"
    return ProblemError(f"{place} gives {shapes}; for this robot it must be a matrix (m, {n}) and m bounds, (m,).")
