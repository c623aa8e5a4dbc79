"""How compiled task rows are numbered: shared by `task_rows` and by what fills its arrays, which does not load the
compiler."""

FRAME = 0
TWIST = 1
POSTURE = 2
RELATIVE = 3
POINTING = 4
BOX = 5

HEADER = 7
"""Columns of the table of tasks."""

TREE_HEADER = 5
FRAME_ROW = 4
DOF_ROW = 5
BODY_ROW = 4
"""Numbers that `hqp_rp.core.kernels.tree` wants of a tree, and of each of its frames, dofs and bodies."""

ROOM = 36
"""Numbers that a task's kernel needs beside its arrays: (3, 6) and (6, 3)."""

PLAN_HEADER = 10
"""Numbers before the table of tasks in the plan that `hqp_rp.core.kernels.stack_rows` reads."""
