"""The rows of a problem in words: whoever makes a problem from limits says what each row is, and messages use it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from hqp_rp.core.problem import Problem

ROW_NAMES = "hard row names"
"""Under this name `Problem.kept` holds what gives the fields of a `RowName` for every hard row; a `Stack` puts it there."""

LEVEL_ROW_NAMES = "level row names"
"""The same for the rows of the levels, as they are stacked."""

_SHOWN = 8


class RowName(NamedTuple):
    """One row in words.

    Attributes:
        group: the limit that it belongs to, "" where nobody said. row: the row. unit: of its bounds, or "".
        lower_from, upper_from: what made its bounds, such as "acceleration 2 rad/s^2 x dt", or "".
        brakes: what to change in the limit so that x comes to it slower, a sentence that ends the words "To brake in time, ",
            or "". returns: what to change so that it asks for a slower way back, or "".
        keep: whether it bounds single joints, which other limits shall give way to.
        turned: whether the row is minus what its name says, so that its upper bound is that one's lower bound.
        fixed: whether it is a law of physics or the robot's own strength, which no setting moves to a level.
    """

    group: str
    row: str
    unit: str = ""
    lower_from: str = ""
    upper_from: str = ""
    brakes: str = ""
    returns: str = ""
    keep: bool = False
    turned: bool = False
    fixed: bool = False

    def __str__(self) -> str:
        return f"{self.group}: {self.row}" if self.group else self.row

    def side(self, upper: bool) -> str:
        """ "upper" or "lower", of what the name says, for the row's own upper or lower bound."""
        return "upper" if upper != self.turned else "lower"


def row_names(problem: Problem) -> list[RowName]:
    """One for each hard row: what `ROW_NAMES` says, else `Level.row_names`, else its number."""
    stated = _made(problem, ROW_NAMES, _hard_rows(problem))
    if stated is not None:
        return stated
    hard = problem.hard
    if hard is None:
        return []
    if hard.row_names:
        return [RowName("", name) for name in hard.row_names]
    return [RowName("", f"{hard.name}[{i}]" if hard.name else f"hard row {i}") for i in range(hard.m)]


def level_row_names(problem: Problem) -> list[RowName]:
    """One for each row of the levels: what `LEVEL_ROW_NAMES` says, else the level and the row's name or number in it."""
    stated = _made(problem, LEVEL_ROW_NAMES, problem.rows)
    if stated is not None:
        return stated
    return [
        RowName("", f"{level.name}: {level.row_names[i]}" if level.row_names else f"{level.name}[{i}]")
        for level in problem.levels
        for i in range(level.m)
    ]


def has_row_names(problem: Problem) -> bool:
    """Whether somebody named the hard rows."""
    hard = problem.hard
    return ROW_NAMES in (problem.kept or {}) or (hard is not None and bool(hard.row_names or hard.name))


def hard_rows_in_words(problem: Problem, rows: Iterable[int]) -> str:
    """These hard rows as the beginning of a sentence: by name where they have names, else by number."""
    numbers = [int(i) for i in rows]
    if has_row_names(problem):
        names = row_names(problem)
        shown = [repr(str(names[i])) for i in numbers[:_SHOWN]]
    else:
        shown = [str(i) for i in numbers[:_SHOWN]]
    more = ", ..." if len(numbers) > _SHOWN else ""
    return f"Hard row{'' if len(numbers) == 1 else 's'} {', '.join(shown)}{more}"


def contradicting(problem: Problem, rows: Iterable[int]) -> str:
    """That these hard rows cannot all be met, as the beginning of a sentence."""
    numbers = list(rows)
    what = "cannot be met" if len(numbers) == 1 else "contradict each other"
    return f"{hard_rows_in_words(problem, numbers)} {what}"


def take_row_names(problem: Problem, made: Problem) -> None:
    """Give a problem that was `made` with the hard rows of `problem` the same names for them."""
    kept: dict[str, Any] = problem.kept or {}
    if ROW_NAMES in kept:
        made.kept = {**(made.kept or {}), ROW_NAMES: kept[ROW_NAMES]}
    elif has_row_names(problem) and not has_row_names(made):
        state_row_names(made, {ROW_NAMES: row_names(problem)})


def stated_row_names(problem: Problem) -> dict[str, list[RowName]]:
    """What `ROW_NAMES` and `LEVEL_ROW_NAMES` say, of those that are there, for `state_row_names`."""
    counts = {ROW_NAMES: _hard_rows(problem), LEVEL_ROW_NAMES: problem.rows}
    stated = {which: _made(problem, which, count) for which, count in counts.items()}
    return {which: names for which, names in stated.items() if names is not None}


def state_row_names(problem: Problem, stated: Mapping[str, list[RowName]]) -> None:
    """Give a problem names: under `ROW_NAMES` one for each hard row, under `LEVEL_ROW_NAMES` for each of the levels' rows."""
    made: dict[str, Callable[[], list[RowName]]] = {which: names.copy for which, names in stated.items()}
    problem.kept = {**(problem.kept or {}), **made}


def _hard_rows(problem: Problem) -> int:
    return problem.hard_rows if problem.hard is None else problem.hard.m


def _made(problem: Problem, which: str, count: int) -> list[RowName] | None:
    namer: Callable[[], Iterable[tuple[Any, ...]]] | None = (problem.kept or {}).get(which)
    if namer is None:
        return None
    try:
        names = [RowName(*named) for named in namer()]
    except Exception:
        # Names are for messages: a limit or a robot of one's own that cannot give them must not stop a solve.
        return None
    return names if len(names) == count else None
