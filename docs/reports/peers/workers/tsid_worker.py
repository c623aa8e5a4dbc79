"""tsid: `HQPData` of two levels on problems: the first hard, the second weighted least squares (its whole hierarchy)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import tsid
from serve import Answer, Given, Rows, Worker, serve

VARIANTS = {
    "hard first": "SolverHQuadProgFast.solve(HQPData): level 0 the hard rows, or else the first level; level 1 the next one"
}
KEPT: list[list[Any]] = []
"""HQPData holds no reference to what is put into it, and ends the process when that has gone before it."""

STATUS = {-1: "UNKNOWN", 0: "OPTIMAL", 1: "INFEASIBLE", 2: "UNBOUNDED", 3: "MAX_ITER_REACHED", 4: "ERROR"}


def cannot(given: Given, variant: str) -> str:
    count = len(given.levels) + (given.hard is not None)
    if count > 2:
        return "more than two levels"
    if not given.levels[-1].equal:
        return "an inequality at its second level"
    first = given.hard if given.hard is not None else given.levels[0]
    # The solver writes past its arrays then, and the process ends sooner or later.
    return "more equality rows at its first level than unknowns" if count == 2 and _equal(first) > given.n else ""


def _equal(rows: Rows) -> int:
    return int((rows.lower == rows.upper).sum())


def prepare(given: Given, variant: str) -> Callable[[], Any]:
    first = given.hard if given.hard is not None else (given.levels[0] if len(given.levels) == 2 else None)
    alive: list[Any] = []
    KEPT.append(alive)
    hard, soft = tsid.ConstraintLevel(), tsid.ConstraintLevel()
    equalities = inequalities = 0
    if first is not None:
        same = first.lower == first.upper
        equalities, inequalities = int(same.sum()), int((~same).sum())
        if equalities:
            alive.append(tsid.ConstraintEquality("equalities", first.A[same], first.lower[same]))
            hard.append(1.0, alive[-1])
        if inequalities:
            alive.append(tsid.ConstraintInequality("inequalities", *_far(first, ~same)))
            hard.append(1.0, alive[-1])
    alive.append(tsid.ConstraintEquality("level", given.levels[-1].A, given.levels[-1].lower))
    soft.append(1.0, alive[-1])
    data = tsid.HQPData()
    data.append(hard)
    data.append(soft)
    alive += [hard, soft, data]
    solver = tsid.SolverHQuadProgFast("solver")
    solver.resize(given.n, equalities, inequalities)

    def call() -> Any:
        return solver.solve(alive[-1])

    return call


def _far(rows: Rows, chosen: Any) -> tuple[Any, Any, Any]:
    """Finite bounds, as tsid's own tasks give where there is none."""
    return rows.A[chosen], np.clip(rows.lower[chosen], -1e10, 1e10), np.clip(rows.upper[chosen], -1e10, 1e10)


def read(found: Any, given: Given, variant: str) -> Answer:
    x = np.array(found.x)
    strict = len(given.levels) - 1
    promise = {"strict": strict, "weights": [1.0]}
    sound = len(x) == given.n and bool(np.isfinite(x).all())
    return Answer(x if sound else None, found.status == 0, STATUS.get(int(found.status), "?"), promise)


if __name__ == "__main__":
    serve(Worker("tsid", VARIANTS, cannot, prepare, read))
