"""Whether a solver takes the problems of a stack at all, asked before there is a robot to move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from hqp_rp.core.damping import LevelDamping
from hqp_rp.core.errors import SettingError
from hqp_rp.core.level import Level
from hqp_rp.core.problem import Problem
from hqp_rp.core.row_names import ROW_NAMES
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver

_MORE = (7, 8)  # unknowns beyond the levels' rows: what is refused at either size is refused at every size


class Outlined(Protocol):
    """What can be asked: a stack."""

    def _outline(self, n: int) -> Problem: ...

    @property
    def names(self) -> tuple[str, ...]: ...


def outline(
    n: int,
    names: Sequence[str],
    *,
    two_sided: bool,
    hard: str,
    wide: bool = False,
    damping: Sequence[LevelDamping | None] | None,
    metric: str | None,
) -> Problem:
    """A problem of n unknowns, one row a level, that has the kinds of rows, the damping and the metric of a stack's problems.

    Args:
        names: of the levels, fewer than n. two_sided: whether a level has rows that are no equalities.
        hard: the name of some hard rows, "" for none. wide: whether they bound several unknowns together.
        damping: of each level, or None. metric: "diagonal", "full" or None.
    """
    rows = np.eye(n)
    levels = [
        Level(
            rows[k : k + 1],
            [-1.0] if two_sided else [1.0],
            [1.0],
            name=name,
            damping=None if damping is None else damping[k],
        )
        for k, name in enumerate(names)
    ]
    bounded = Level(rows[:1] + wide * rows[1:2], [-1.0], [1.0], name="limits") if hard else None
    W = None if metric is None else 2.0 * np.eye(n) + (metric == "full") * np.ones((n, n))
    problem = Problem(levels, hard=bounded, metric=W)
    if hard:
        problem.kept = {**(problem.kept or {}), ROW_NAMES: lambda: [(hard, "its rows", "")]}
    return problem


def require_taken(solver: Solver, stack: Outlined) -> None:
    """Raises `SettingError`, in the solver's own words, where it refuses every problem of the stack.

    What it refuses at some numbers of unknowns only, such as a weight for another number of joints, is seen at the first step.
    """
    told = {solver.refuses(stack._outline(len(stack.names) + more)) for more in _MORE}
    sentence = told.pop()
    if sentence is not None and not told:
        raise SettingError(refusal(sentence, stack))


def require_not_refused(solution: Solution, stack: Outlined) -> None:
    """Raises `SettingError` for a solution of status REFUSED."""
    if solution.status is Status.REFUSED:
        raise SettingError(refusal(solution.message or solution.status.value, stack))


def refusal(sentence: str, stack: Outlined) -> str:
    """The solver's sentence, and what it is about."""
    return f"{sentence} It was given {stack!r}."
