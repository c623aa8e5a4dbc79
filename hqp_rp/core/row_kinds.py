"""How compiled task rows are numbered: shared by `hqp_rp.core.kernels.task_rows` and by what fills its arrays, so that a
task can be built before the compiler is loaded."""

FRAME = 0
TWIST = 1
POSTURE = 2
RELATIVE = 3
POINTING = 4
BOX = 5

HEADER = 8
"""Columns of the table of tasks."""
