"""Random families with two-sided rows at several levels and hard rows: feasible, barely feasible, infeasible."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hqp_rp.core.problem import Level, Problem
from hqp_rp.problems.recipe import Draw, Recipe, random_levels, shape_of

_ROWS = "Entries of A and targets uniform on multiples of 2^-20 in [-1, 1]"


def inequality() -> Iterator[Recipe]:
    """Two-sided rows at several levels, no hard rows."""
    shapes = [(7, (3, 3, 7)), (6, (2, 3, 2, 4)), (5, (4, 4, 5)), (7, (7,)), (4, (6, 6)), (10, (4, 4, 10))]
    for s, (n, rows) in enumerate([*shapes, (20, (8, 8, 20))]):
        for i in range(2 if n < 10 else 1):
            yield Recipe(
                "inequality",
                f"n{n}_{shape_of(rows)}_s{i}",
                7000 + 10 * s + i,
                f"{_ROWS}; each row at random an equality, a band of half-width up to 1/2, or one-sided.",
                lambda draw, n=n, rows=rows: _mixed(draw, n, rows),  # type: ignore[misc]
            )


def hard_rows() -> Iterator[Recipe]:
    """Hard rows with room to move."""
    shapes = [(7, (3, 3)), (7, (3, 3, 7)), (10, (4, 4, 10)), (20, (6, 6, 20))]
    for i, (n, rows) in enumerate(shapes):
        for kind, words in (
            ("box", "hard bounds of +-1/4 on every unknown"),
            ("mixed", "two-sided rows at every level and hard bounds of +-1/2 on every unknown"),
            ("rows", "one hard equality and three hard bands around 0 with random rows"),
        ):
            yield Recipe(
                "hard_rows",
                f"n{n}_{shape_of(rows)}_{kind}",
                8000 + 10 * i + len(kind),
                f"{_ROWS}; {words}.",
                lambda draw, n=n, rows=rows, kind=kind: _hard(draw, n, rows, kind),  # type: ignore[misc]
            )


def barely_feasible() -> Iterator[Recipe]:
    """Hard rows that leave a set of width 2^-k, or of no width at all."""
    for rows in ((3, 3), (3, 3, 7)):
        for k in (10, 20, 30, 40, None):
            gap = 0.0 if k is None else 2.0**-k
            yield Recipe(
                "barely_feasible",
                f"n7_{shape_of(rows)}_{'touching' if k is None else f'1p-{k}'}",
                9000,
                f"{_WEDGE} The feasible set is {'a point in them' if k is None else f'2^-{k} wide in them'}.",
                lambda draw, rows=rows, gap=gap: _wedge(draw, rows, gap),  # type: ignore[misc]
                gap,
            )


def infeasible() -> Iterator[Recipe]:
    """Hard rows that contradict each other, plainly or by 2^-k; levels that could be met without them."""
    for k in (1, 10, 20, 30, 40):
        yield Recipe(
            "infeasible",
            f"n7_3-3_1p-{k:02d}",
            9000,
            f"{_WEDGE} They contradict each other by 2^-{k}.",
            lambda draw, k=k: _wedge(draw, (3, 3), -(2.0**-k)),  # type: ignore[misc]
            2.0**-k,
        )
    yield Recipe(
        "infeasible", "n7_3-3_equalities", 9101, "Two hard equalities with one row and two targets.", _two_targets
    )
    yield Recipe(
        "infeasible",
        "n7_3-3_box",
        9102,
        "Hard bounds of +-1/4 on every unknown and a hard row sum(x) >= 2, which they keep below 7/4.",
        _box_and_sum,
    )


def _mixed(draw: Draw, n: int, rows: Sequence[int]) -> Problem:
    levels = []
    for m in rows:
        A, b = draw.grid((m, n)), draw.grid(m)
        half = np.abs(draw.grid(m, 0.5))
        kind = draw.integers(0, 3, m)
        lower = np.where(kind == 3, -np.inf, np.where(kind == 0, b, b - half))
        upper = np.where(kind == 2, np.inf, np.where(kind == 0, b, b + half))
        levels.append(Level(A, lower, upper))
    return Problem(levels)


def _hard(draw: Draw, n: int, rows: Sequence[int], kind: str) -> Problem:
    if kind == "mixed":
        return Problem(_mixed(draw, n, rows).levels, hard=Level(np.eye(n), -0.5, 0.5, name="box"))
    levels = random_levels(draw, n, rows).levels
    if kind == "box":
        return Problem(levels, hard=Level(np.eye(n), -0.25, 0.25, name="box"))
    half = np.abs(draw.grid(4, 0.25))
    half[0] = 0.0
    return Problem(levels, hard=Level(draw.grid((4, n)), -half, half, name="bands"))


_WEDGE = (
    "Three hard rows a_i x <= a_i c (a_i integers -4 ... 4, c on multiples of 1/16) and a fourth, their negative combination "
    "with weights 1 ... 3: together they press x from all sides within the three directions."
)


def _wedge(draw: Draw, rows: Sequence[int], gap: float) -> Problem:
    """`a_i x <= a_i c` and `-w a x <= -w a c + gap`, w > 0: meets just when gap >= 0, and within gap / w_i in a_i."""
    A = draw.integers(-4, 4, (3, 7))
    weights = draw.integers(1, 3, 3)
    center = draw.grid(7, 1.0, 4)
    hard = np.vstack([A, -(weights @ A)]).astype(np.float64)
    upper = hard @ center + np.array([0.0, 0.0, 0.0, gap])
    return Problem(random_levels(draw, 7, rows).levels, hard=Level(hard, -np.inf, upper, name="wedge"))


def _two_targets(draw: Draw) -> Problem:
    row = draw.grid(7)
    hard = Level(np.vstack([row, row]), [0.25, 0.5], [0.25, 0.5], name="two targets")
    return Problem(random_levels(draw, 7, (3, 3)).levels, hard=hard)


def _box_and_sum(draw: Draw) -> Problem:
    A = np.vstack([np.eye(7), np.ones((1, 7))])
    lower, upper = np.append(np.full(7, -0.25), 2.0), np.append(np.full(7, 0.25), np.inf)
    return Problem(random_levels(draw, 7, (3, 3)).levels, hard=Level(A, lower, upper, name="box and sum"))
