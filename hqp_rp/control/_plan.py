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
    """

    __slots__ = (
        "_accelerated",
        "_asks",
        "_differences",
        "_kernel",
        "_own_q",
        "_packed",
        "_packs",
        "_plan",
        "_read_frames",
        "_robot",
        "_room",
        "_v",
        "_values",
        "counts",
        "frames",
        "index",
        "numbers",
        "table",
    )

    def __init__(self, tasks: Sequence[CompiledRows], robot: Robot) -> None:
        from hqp_rp.core.kernels.stack_rows import stack_rows_entry

        self._kernel = stack_rows_entry()
        self._robot = robot
        layouts = [task._layout(robot) for task in tasks]
        names = dict.fromkeys(name for layout in layouts for name in (layout.frame, layout.axes) if name is not None)
        self.frames = frames_of(robot, tuple(names))
        number: dict[str | Point | None, int] = {None: -1} | {name: i for i, name in enumerate(names)}
        self.counts = [layout.rows for layout in layouts]
        self._packs: list[tuple[Layout, slice]] = []
        self._packed = [(task, _UNPACKED) for task in tasks]
        # The first that needs the velocity before the step.
        self._accelerated = next(
            (task for task, layout in zip(tasks, layouts, strict=True) if layout.accelerated), None
        )
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
        asks = (self._read_frames, self._own_q, self._accelerated)
        self._asks = bool(self._differences) or any(one is not None for one in asks)

    def fill(
        self,
        matrix: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        dt: float | None,
        v: FloatArray | None,
        plain: bool,
        block: IntArray,
    ) -> int:
        """Make the rows of all tasks at the robot's current configuration, and say in the block where they are.

        Its address; 0 where a row, others' included, is not sound.

        Args:
            matrix: (M, nv). lower, upper: (M,); upper empty where every row is an equality. C-contiguous float64.
            dt, v, plain, block: as of `Assembly.described`.
        """
        for task, packed in self._packed:
            if task._packed is not packed:
                self.pack()
                break
        if self._asks:
            self._ask(v)
        dt = 0.0 if dt is None else dt
        address: int = self._kernel(self._plan, self._room, dt, plain, matrix, lower, upper, block)
        return address

    @property
    def is_compiled(self) -> bool:
        """Whether no coordinate needs the robot to subtract it."""
        return not self._differences

    def pack(self) -> None:
        """Bring `numbers` up to date: the plan is new, or a setter was called."""
        for i, ((task, packed), (layout, span)) in enumerate(zip(self._packed, self._packs, strict=True)):
            if task._packed is not packed:
                current = task._current(self._robot, layout)
                self.numbers[span] = current
                self._packed[i] = task, current

    def _ask(self, v: FloatArray | None) -> None:
        """The velocity before the step, and what only the robot knows: poses and Jacobians, coordinates, differences."""
        robot = self._robot
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
