"""The rows of a stack's tasks and limits at a robot's current configuration, in one call of few arguments.

Each array that crosses from Python to compiled code costs as much as the rows of a small task. So everything that stays where
it is from step to step is in two arrays: `plan` (int64), which does not change, and `room` (float64). `plan` holds

    K, length of index, F, n, length of numbers, length of values, nq, address of q (0: it is in values already), where the
    tree begins (0: poses and Jacobians are in `room` already), bodies,
    items (K, 7), index, tree

with items, index and numbers as `task_rows` takes them, and tree as `tree_frames` does. `room` holds numbers, values (q (nq),
dt, the velocity before the step, differences), rotations (F, 3, 3), origins (F, 3), jacobians (F, 6, n) and what the kernels
need for themselves.
"""

from __future__ import annotations

import functools

from numba.core import types

from hqp_rp.core.kernels.compile import Compiled, entry, lean
from hqp_rp.core.kernels.direct import rows_at
from hqp_rp.core.kernels.room import as_matrix, as_stack, number_at
from hqp_rp.core.kernels.row_kinds import HEADER, PLAN_HEADER
from hqp_rp.core.kernels.task_rows import task_rows
from hqp_rp.core.kernels.tree import tree_frames


@lean
def stack_rows(plan, room, dt, plain, matrix, lower, upper, block):
    """Fill matrix (M, n), lower and upper (M,) and judge them, as `task_rows`; dt in s, where an item needs it.

    The block (see `direct`), which knows the rest already, learns where they are. Its address; 0 for rows that are not sound.
    """
    K, F, n, bodies = plan[0], plan[2], plan[3], plan[9]
    of_items = PLAN_HEADER + K * HEADER
    items = as_matrix(plan[PLAN_HEADER:of_items], K, HEADER)
    index = plan[of_items : of_items + plan[1]]
    at = plan[4]
    numbers = room[:at]
    values = room[at : at + plan[5]]
    at += plan[5]
    rotations = as_stack(room[at:], F, 3, 3)
    at += 9 * F
    origins = as_matrix(room[at:], F, 3)
    at += 3 * F
    jacobians = as_stack(room[at:], F, 6, n)
    at += 6 * F * n
    small, product = as_matrix(room[at:], 3, 6), as_matrix(room[at + 18 :], 6, 3)
    nq = plan[6]
    if plan[7] != 0:
        for i in range(nq):
            values[i] = number_at(plan[7] + 8 * i)
    values[nq] = dt
    if plan[8] != 0:
        tree_frames(plan[plan[8] :], rotations, origins, jacobians, as_matrix(room[at + 36 :], bodies, 4))
    rows_at(matrix, lower, upper, block)
    sound = task_rows(
        items, index, numbers, rotations, origins, jacobians, values, plain, matrix, lower, upper, small, product
    )
    return block.ctypes.data if sound else 0


@functools.cache
def stack_rows_entry() -> Compiled:
    """`stack_rows` without numba's dispatcher, which looks at the type of every argument at every call.

    Nothing is checked: plan int64 (P,), room float64 (R,), dt float, plain bool, matrix float64 (M, n), lower and upper float64
    (M,), block int64 (`direct.SIZE`,), all C-contiguous.
    """
    vector, matrix = types.Array(types.float64, 1, "C"), types.Array(types.float64, 2, "C")
    plan = types.Array(types.int64, 1, "C")
    signature = (plan, vector, types.float64, types.boolean, matrix, vector, vector, plan)
    return entry(stack_rows, signature)
