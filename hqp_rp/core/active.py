"""Which rows determine an answer: the rows a solver holds at a bound, with those that equality or violation makes active."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.diagnostics import rounding_at_zero, row_norms
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.tolerances import ACTIVE

VIOLATED = ACTIVE
"""A row counts as violated beyond this part of ||a_i|| ||x|| + |bound|."""


def active_rows(problem: Problem, x: FloatArray, held: NDArray[np.integer] | float) -> NDArray[np.int8]:
    """`Solution.active`, (hard.m + M,) and read-only, from x (n,) and `Solution.held`."""
    matrix, lower, upper, _ = problem.with_hard
    with np.errstate(all="ignore"):
        value = matrix @ x
        bound = np.clip(value, lower, upper)
        beyond = value - bound
        size = row_norms(matrix) * np.linalg.norm(x)
        noise = row_norms(matrix @ rounding_at_zero(problem, x))
        if isinstance(held, float):
            at_upper = np.abs(value - upper) <= held * (size + np.abs(upper)) + noise
            at_lower = np.abs(value - lower) <= held * (size + np.abs(lower)) + noise
            held = np.where(at_upper & np.isfinite(upper), 1, np.where(at_lower & np.isfinite(lower), -1, 0))
        violated = np.abs(beyond) > VIOLATED * (size + np.abs(bound)) + noise
    active = np.where(violated, np.sign(beyond), np.sign(held)).astype(np.int8)
    active[lower == upper] = 1
    active.flags.writeable = False
    return active


def in_words(problem: Problem, active: NDArray[np.int8]) -> tuple[str, ...]:
    """One entry for each active inequality row: its level, its row within the level, and the bound it is at or beyond."""
    _, lower, upper, offsets = problem.with_hard
    hard = problem.hard.name if problem.hard is not None and problem.hard.name else "hard"
    names = (hard, *problem.names)
    words = []
    for i in np.flatnonzero((active != 0) & (lower != upper)):
        k = int(np.searchsorted(offsets, i, side="right")) - 1
        words.append(f"{names[k]}[{i - offsets[k]}] at its {'upper' if active[i] > 0 else 'lower'} bound")
    return tuple(words)
