"""How a search of `active_set` ended."""

SOLVED = 0
LIMIT = 1
INFEASIBLE = 2
NOT_FINITE = 3
DELICATE = (
    4  # solved, but multipliers near rounding error decided, or hard rows contradict each other by next to nothing
)
