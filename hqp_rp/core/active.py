"""Which rows determine an answer: the rows a solver holds at a bound, with those that equality or violation makes active."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.diagnostics import row_norms
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.verify import with_hard_rows

VIOLATED = 1e-9
"""A row counts as violated beyond this part of ||a_i|| ||x|| + |bound|."""


def active_rows(problem: Problem, x: FloatArray, held: NDArray[np.integer]) -> NDArray[np.int8]:
    """`Solution.active` (hard.m + M,) from x (n,) and the rows that the solver holds, (hard.m + M,) of -1, 0, +1; read-only."""
    matrix, lower, upper, _ = with_hard_rows(problem)
    with np.errstate(all="ignore"):
        value = matrix @ x
        bound = np.clip(value, lower, upper)
        beyond = value - bound
        violated = np.abs(beyond) > VIOLATED * (row_norms(matrix) * np.linalg.norm(x) + np.abs(bound))
    active = np.where(violated, np.sign(beyond), np.sign(held)).astype(np.int8)
    active[lower == upper] = 1
    active.flags.writeable = False
    return active


def touching(problem: Problem, x: FloatArray) -> NDArray[np.int8]:
    """-1, +1 for each row (hard.m + M,) whose value at x (n,) is its lower or upper bound to rounding error, else 0."""
    matrix, lower, upper, _ = with_hard_rows(problem)
    value = matrix @ x
    size = row_norms(matrix) * np.linalg.norm(x)
    at_upper = np.abs(value - upper) <= 1e-12 * (size + np.abs(upper))
    at_lower = np.abs(value - lower) <= 1e-12 * (size + np.abs(lower))
    return (at_upper & np.isfinite(upper)).astype(np.int8) - (at_lower & np.isfinite(lower) & ~at_upper)


def in_words(problem: Problem, active: NDArray[np.int8]) -> tuple[str, ...]:
    """A sentence part for each active inequality row: level, row within the level, and the bound it is at or beyond."""
    _, lower, upper, offsets = with_hard_rows(problem)
    hard = problem.hard.name if problem.hard is not None and problem.hard.name else "hard"
    names = (hard, *problem.names)
    words = []
    for i in np.flatnonzero((active != 0) & (lower != upper)):
        k = int(np.searchsorted(offsets, i, side="right")) - 1
        words.append(f"{names[k]}[{i - offsets[k]}] at its {'upper' if active[i] > 0 else 'lower'} bound")
    return tuple(words)
