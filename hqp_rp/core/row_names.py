"""The hard rows of a problem in words: whoever makes a problem from limits says what each row is, and messages use it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from hqp_rp.core.problem import Problem

ROW_NAMES = "hard row names"
"""Under this name `Problem.kept` holds what gives (group, row, unit) in words for every hard row; a `Stack` puts it there."""

_SHOWN = 8


class RowName(NamedTuple):
    """One hard row in words: the limit that it belongs to ("" where nobody said), the row, and the unit of its bounds or ""."""

    group: str
    row: str
    unit: str = ""

    def __str__(self) -> str:
        return f"{self.group}: {self.row}" if self.group else self.row


def row_names(problem: Problem) -> list[RowName]:
    """One for each hard row: what `ROW_NAMES` says, else its number."""
    made: Callable[[], list[tuple[str, ...]]] | None = (problem.kept or {}).get(ROW_NAMES)
    if made is not None:
        return [RowName(*named) for named in made()]
    return [RowName("", f"hard row {i}") for i in range(problem.hard_rows)]


def hard_rows_in_words(problem: Problem, rows: Iterable[int]) -> str:
    """These hard rows as the beginning of a sentence: by name where they have names, else by number."""
    numbers = [int(i) for i in rows]
    if ROW_NAMES in (problem.kept or {}):
        names = row_names(problem)
        shown = [repr(str(names[i])) for i in numbers[:_SHOWN]]
    else:
        shown = [str(i) for i in numbers[:_SHOWN]]
    more = ", ..." if len(numbers) > _SHOWN else ""
    return f"Hard row{'' if len(numbers) == 1 else 's'} {', '.join(shown)}{more}"


def take_row_names(problem: Problem, made: Problem) -> None:
    """Give a problem that was `made` with the hard rows of `problem` the same names for them."""
    kept: dict[str, Any] = problem.kept or {}
    if ROW_NAMES in kept:
        made.kept = {**(made.kept or {}), ROW_NAMES: kept[ROW_NAMES]}
