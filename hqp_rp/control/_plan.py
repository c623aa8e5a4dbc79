"""The compiled tasks and limits of one stack on one robot, laid out once for the kernel that makes their rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hqp_rp.control._compiled import CompiledRows, Layout
from hqp_rp.core.kernels.row_kinds import BOX, HEADER, PLAN_HEADER, POSTURE, ROOM
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.frames import Point, frames_of
from hqp_rp.robot.robot import Robot

_UNPACKED = np.empty(0)


class Plan:
    """What `hqp_rp.core.kernels.stack_rows` needs: two arrays, and what has to be put into them at each step.

    Args:
        tasks: the compiled tasks and limits. robot: whose rows.

    Attributes:
        frames: the frames that the tasks use. counts: rows of each task.
        table: (K, 7), `items` of the kernel; its third column, where the rows of each task begin, is the caller's to fill in.
        numbers: what the tasks state, one after the other. index: for each task, what `Layout.index` says.
        accelerated: the first task that needs the velocity before the step, or None.
    """

    __slots__ = (
        "_differences",
        "_held",
        "_kernel",
        "_needs_python",
        "_own_q",
        "_packs",
        "_plan",
        "_read_frames",
        "_robot",
        "_room",
        "_tasks",
        "_v",
        "_values",
        "accelerated",
        "counts",
        "frames",
        "index",
        "numbers",
        "table",
    )

    def __init__(self, tasks: Sequence[CompiledRows], robot: Robot) -> None:
        from hqp_rp.core.kernels.stack_rows import stack_rows_entry

        self._kernel = stack_rows_entry()
        self._robot, self._tasks = robot, tuple(tasks)
        layouts = [task._layout(robot) for task in tasks]
        names = dict.fromkeys(name for layout in layouts for name in (layout.frame, layout.axes) if name is not None)
        self.frames = frames_of(robot, tuple(names))
        number: dict[str | Point | None, int] = {None: -1} | {name: i for i, name in enumerate(names)}
        self.counts = [layout.rows for layout in layouts]
        self._packs: list[tuple[Layout, slice]] = []
        self._held = [_UNPACKED] * len(tasks)
        self.accelerated = next((task for task, layout in zip(tasks, layouts, strict=True) if layout.accelerated), None)
        self._differences: list[tuple[CompiledRows, slice]] = []
        nq = robot.nq if {POSTURE, BOX} & {layout.kind for layout in layouts} else 0
        values = nq + 1 + robot.nv  # q, dt, the velocity before the step; then differences
        rows: list[list[int]] = []
        index: list[int] = []
        end = 0
        for task, layout in zip(tasks, layouts, strict=True):
            size = len(task._current(robot, layout))
            rows.append([layout.kind, layout.rows, 0, end, number[layout.frame], number[layout.axes], len(index)])
            self._packs.append((layout, slice(end, end + size)))
            end += size
            index += layout.index
            if layout.difference:  # minus what only the robot can subtract
                self._differences.append((task, slice(values, values + robot.nv)))
                index += [values + i for i in layout.index]
                values += robot.nv
            elif layout.kind == BOX:
                index.append(nq)
        self._lay_out(rows, index, (end, values, nq))

    def _lay_out(self, rows: list[list[int]], index: list[int], sizes: tuple[int, int, int]) -> None:
        frames, n = self.frames, self._robot.nv
        F = len(frames.names)
        numbers, values, nq = sizes
        compiled = frames.tree is not None and F > 0
        bodies = frames.bodies if compiled else 0
        kept_q = frames.q if nq else None
        tree_at = PLAN_HEADER + HEADER * len(rows) + len(index)
        address = 0 if kept_q is None else int(kept_q.__array_interface__["data"][0])
        header = [len(rows), len(index), F, n, numbers, values, nq, address, tree_at if compiled else 0, bodies]
        table = [number for row in rows for number in row]
        tree = frames.tree if frames.tree is not None and compiled else np.empty(0, np.int64)
        self._plan: IntArray = np.concatenate((np.array([*header, *table, *index], dtype=np.int64), tree))
        self.table = self._plan[PLAN_HEADER : PLAN_HEADER + len(table)].reshape(len(rows), HEADER)
        self.index = self._plan[PLAN_HEADER + len(table) : tree_at]

        ends = np.cumsum([numbers, values, 9 * F, 3 * F, 6 * n * F, ROOM + 4 * bodies])
        self._room = np.zeros(int(ends[-1]))
        parts = np.split(self._room, ends[:-1])
        self.numbers, self._values = parts[:2]
        frames.move_to(parts[2].reshape(F, 3, 3), parts[3].reshape(F, 3), parts[4].reshape(F, 6, n))
        self._own_q = self._values[:nq] if nq and kept_q is None else None
        self._v = self._values[nq + 1 : nq + 1 + n]
        self._read_frames = frames.read if F and not compiled else None
        self._needs_python = self._read_frames is not None or self._own_q is not None or bool(self._differences)

    def fill(
        self,
        matrix: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        dt: float | None,
        v: FloatArray | None,
        plain: bool,
    ) -> bool:
        """Make the rows of all tasks at the robot's current configuration; whether all rows, others' included, are sound.

        Args:
            matrix: (M, nv). lower, upper: (M,); upper empty where every row is an equality. C-contiguous float64.
            dt, v, plain: as of `Assembly.rows`.
        """
        held = self._held
        for i, task in enumerate(self._tasks):
            if task._packed is not held[i]:
                self._pack(i, task)
        if self._needs_python:
            self._ask()
        if self.accelerated is not None:
            if v is None:
                self.accelerated._require_velocity()
            self._v[:] = v
        sound: bool = self._kernel(self._plan, self._room, 0.0 if dt is None else dt, plain, matrix, lower, upper)
        return sound

    @property
    def is_compiled(self) -> bool:
        """Whether no coordinate needs the robot to subtract it."""
        return not self._differences

    def pack(self) -> None:
        """Bring `numbers` up to date."""
        for i, task in enumerate(self._tasks):
            self._pack(i, task)

    def _pack(self, i: int, task: CompiledRows) -> None:
        """Put a task's numbers in their place: it is new here, or one of its setters was called."""
        layout, span = self._packs[i]
        self.numbers[span] = self._held[i] = task._current(self._robot, layout)

    def _ask(self) -> None:
        """What only the robot knows: poses and Jacobians, coordinates, differences between configurations."""
        robot = self._robot
        if self._read_frames is not None:
            self._read_frames()
        if self._own_q is not None:
            self._own_q[:] = robot.q
        for task, span in self._differences:
            self._values[span] = -robot.difference(robot.q, task.target)  # type: ignore[attr-defined]
