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

import numba
from numba.core import types

from hqp_rp.core.kernels.compile import Compiled, lean
from hqp_rp.core.kernels.row_kinds import HEADER, PLAN_HEADER
from hqp_rp.core.kernels.task_rows import task_rows
from hqp_rp.core.kernels.tree import real_at, tree_frames


@lean
def stack_rows(plan, room, dt, plain, matrix, lower, upper):
    """Fill matrix (M, n), lower and upper (M,) and judge them, as `task_rows`; dt in s, where an item needs it."""
    K, F, n, bodies = plan[0], plan[2], plan[3], plan[9]
    of_items = PLAN_HEADER + K * HEADER
    items = plan[PLAN_HEADER:of_items].reshape((K, HEADER))
    index = plan[of_items : of_items + plan[1]]
    at = plan[4]
    numbers = room[:at]
    values = room[at : at + plan[5]]
    at += plan[5]
    rotations = room[at : at + 9 * F].reshape((F, 3, 3))
    at += 9 * F
    origins = room[at : at + 3 * F].reshape((F, 3))
    at += 3 * F
    jacobians = room[at : at + 6 * F * n].reshape((F, 6, n))
    at += 6 * F * n
    small, product = room[at : at + 18].reshape((3, 6)), room[at + 18 : at + 36].reshape((6, 3))
    nq = plan[6]
    if plan[7] != 0:
        for i in range(nq):
            values[i] = real_at(plan[7] + 8 * i)
    values[nq] = dt
    if plan[8] != 0:
        tree_frames(plan[plan[8] :], rotations, origins, jacobians, room[at + 36 :].reshape((bodies, 4)))
    return task_rows(
        items, index, numbers, rotations, origins, jacobians, values, plain, matrix, lower, upper, small, product
    )


@functools.cache
def stack_rows_entry() -> Compiled:
    """`stack_rows` without numba's dispatcher, which looks at the type of every argument at every call.

    Nothing is checked: plan int64 (P,), room float64 (R,), dt float, plain bool, matrix float64 (M, n), lower and upper float64
    (M,), all C-contiguous.
    """
    if numba.config.DISABLE_JIT:
        return stack_rows
    vector, matrix = types.Array(types.float64, 1, "C"), types.Array(types.float64, 2, "C")
    plan = types.Array(types.int64, 1, "C")
    signature = (plan, vector, types.float64, types.boolean, matrix, vector, vector)
    stack_rows.compile(signature)
    entry: Compiled = stack_rows.overloads[signature].entry_point
    return entry
