"""Which rows determine an answer: the rows a solver holds at a bound, with those that equality or violation makes active."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.diagnostics import row_norms
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.rounding import rounding_at_zero
from hqp_rp.core.row_names import ROW_NAMES, RowName, level_row_names, row_names
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
        near = held if isinstance(held, float) else VIOLATED
        at_upper = np.abs(value - upper) <= near * (size + np.abs(upper)) + noise
        at_lower = np.abs(value - lower) <= near * (size + np.abs(lower)) + noise
        touched = np.where(at_upper & np.isfinite(upper), 1, np.where(at_lower & np.isfinite(lower), -1, 0))
        if isinstance(held, float):
            held = touched
        elif problem.damping is not None:
            # What held a damped level back has no multiplier any more once later levels keep what that level reached.
            held = np.where(held == 0, touched, held)
        violated = np.abs(beyond) > VIOLATED * (size + np.abs(bound)) + noise
    active = np.where(violated, np.sign(beyond), np.sign(held)).astype(np.int8)
    active[lower == upper] = 1
    active.flags.writeable = False
    return active


def in_words(problem: Problem, active: NDArray[np.int8]) -> tuple[str, ...]:
    """One entry for each active inequality row, and the bound it is at or beyond: by its name where it has one, else the level
    and the row within it.

    A row whose bounds coincide is an inequality among those of a limit, or of a level, of which other rows are no equalities.
    """
    _, lower, upper, offsets = problem.with_hard
    kept = problem.kept or {}
    hard, levels = row_names(problem), level_row_names(problem)
    if ROW_NAMES not in kept and problem.hard is not None and not (problem.hard.row_names or problem.hard.name):
        hard = [RowName("", f"hard[{i}]") for i in range(len(hard))]
    stated = [*hard, *levels]
    level = np.searchsorted(offsets, np.arange(len(lower)), side="right") - 1
    groups = [(k, name.group) for k, name in zip(level.tolist(), stated, strict=True)]
    open_groups = {groups[i] for i in np.flatnonzero(lower != upper)}
    words = []
    for i in np.flatnonzero(active):
        if groups[i] not in open_groups:
            continue
        where = "only value" if lower[i] == upper[i] else f"{stated[i].side(bool(active[i] > 0))} bound"
        words.append(f"{stated[i]} at its {where}")
    return tuple(words)
