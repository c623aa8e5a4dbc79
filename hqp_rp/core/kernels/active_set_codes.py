"""How a search of `active_set` ended."""

SOLVED = 0
LIMIT = 1
INFEASIBLE = 2
NOT_FINITE = 3
DELICATE = 4  # solved, but a level was kept by a pivot so small that multipliers near rounding error decided
