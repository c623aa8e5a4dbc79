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
