"""What the weighted front ends have in common: which problems they state, with which weights, and what they then promise."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from serve import Array, Given, Rows, costs

WEIGHTS = "costs from 1e2 for the first level down by 100 (the last not below 1e-4)"
VARIANTS = {
    "weights": f"every level weighted, {WEIGHTS}",
    "first level strict": f"the first level a strict constraint, the others weighted, {WEIGHTS}",
}


class Split(NamedTuple):
    """equalities: strict rows A x = b. limits: hard rows with two bounds. soft: (A, b, cost) of each weighted level."""

    equalities: tuple[Array, Array] | None
    limits: Rows | None
    soft: list[tuple[Array, Array, float]]


def cannot(given: Given, variant: str) -> str:
    if not given.equalities:
        return "inequality rows only as hard rows"
    return "one level only: nothing to weigh" if variant != "weights" and len(given.levels) == 1 else ""


def split(given: Given, variant: str) -> Split:
    strict = [given.levels[0]] if variant != "weights" else []
    rest = given.levels[len(strict) :]
    limits = None
    if given.hard is not None:
        same = given.hard.lower == given.hard.upper
        if same.any():
            strict.append(Rows(*(part[same] for part in given.hard)))
        if not same.all():
            limits = Rows(*(part[~same] for part in given.hard))
    equalities = None
    if strict:
        equalities = np.vstack([rows.A for rows in strict]), np.concatenate([rows.lower for rows in strict])
    return Split(
        equalities,
        limits,
        [(level.A, level.lower, cost) for level, cost in zip(rest, costs(len(rest)), strict=True)],
    )


def one_sided(limits: Rows) -> tuple[Array, Array]:
    """G x <= h with the finite bounds."""
    up, low = np.isfinite(limits.upper), np.isfinite(limits.lower)
    return np.vstack((limits.A[up], -limits.A[low])), np.concatenate((limits.upper[up], -limits.lower[low]))


def promise(given: Given, variant: str) -> dict[str, Any]:
    strict = int(variant != "weights")
    return {"strict": strict, "weights": costs(len(given.levels) - strict)}
