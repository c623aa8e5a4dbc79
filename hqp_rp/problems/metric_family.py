"""Problems with a metric W on the unknown: of all lexicographic optima the answer has the least sqrt(x^T W x)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.problems.recipe import Draw, Recipe, random_levels, shape_of
from hqp_rp.problems.robots import load_snapshot

_ROWS = "Entries of A and targets uniform on multiples of 2^-20 in [-1, 1]"
_METRICS = {
    "diagonal": "W is diagonal, powers of two from 2^-4 to 2^4",
    "full": "W = L L^T, L lower triangular of integers: 1 ... 4 on the diagonal, -2 ... 2 below",
}


def metric() -> Iterator[Recipe]:
    """Levels that leave freedom, so that the metric decides; dependent rows; hard bounds; the Sawyer's inertia."""
    for s, (n, rows) in enumerate([(7, (3,)), (7, (3, 3)), (7, (2, 2, 2)), (14, (3, 3, 4))]):
        for kind, words in _METRICS.items():
            yield Recipe(
                "metric",
                f"n{n}_{shape_of(rows)}_{kind}",
                13_000 + 10 * s + len(kind),
                f"{_ROWS}; {words}.",
                lambda draw, n=n, rows=rows, kind=kind: _random(draw, n, rows, kind),  # type: ignore[misc]
            )
    for kind, words in _METRICS.items():
        yield Recipe(
            "metric",
            f"n7_3-3_limits_{kind}",
            13_100 + len(kind),
            f"{_ROWS}; {words}; hard bounds of +-1/4 on every unknown.",
            lambda draw, kind=kind: _random(draw, 7, (3, 3), kind, 0.25),  # type: ignore[misc]
        )
    for i in range(3):
        for count, words in ((3, "Tool position"), (6, "Tool position, tool orientation")):
            yield Recipe(
                "metric",
                f"sawyer_{'3' if count == 3 else '3-3'}_inertia_q{i}",
                13_200 + 10 * i + count,
                f"{words}, at random configuration {i} of the Sawyer; W is its joint-space inertia M(q), kg m^2: the "
                "dynamically consistent answer. Targets: rates uniform on multiples of 2^-20 within 0.25 m/s or rad/s.",
                lambda draw, i=i, count=count: _inertia(draw, i, count),  # type: ignore[misc]
            )


def _random(draw: Draw, n: int, rows: Sequence[int], kind: str, bound: float | None = None) -> Problem:
    plain = random_levels(draw, n, rows)
    W: FloatArray
    if kind == "diagonal":
        W = np.diag(np.ldexp(1.0, draw.integers(-4, 4, n)))
    else:
        L = np.tril(draw.integers(-2, 2, (n, n)), -1) + np.diag(draw.integers(1, 4, n))
        W = (L @ L.T).astype(np.float64)
    hard = None if bound is None else Level(np.eye(n), -bound, bound, name="bounds")
    return Problem(list(plain.levels), hard, metric=W)


def _inertia(draw: Draw, i: int, rows: int) -> Problem:
    arrays = load_snapshot()
    J = arrays[f"sawyer/{i}/tool"]
    levels = [Level.equality(J[:3], draw.grid(3) * 0.25, name="tool position")]
    if rows == 6:
        levels.append(Level.equality(J[3:], draw.grid(3) * 0.25, name="tool orientation"))
    return Problem(levels, metric=arrays[f"sawyer/{i}/inertia"])
