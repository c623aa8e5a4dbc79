"""Families whose norms are not the plain one: a metric on the unknown, and damped levels.

Metrics are B^T B + I of integer matrices B, or diagonal powers of two, so that no entry rounds; damping factors are powers of
two.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hqp_rp.core.damping import ConstantDamping, ErrorDamping, LevelDamping
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.problems.recipe import Draw, Recipe, random_levels, shape_of

SINCE = "1.1"
_ENTRIES = "Entries of A and targets uniform on multiples of 2^-20 in [-1, 1]"


def metric() -> Iterator[Recipe]:
    """Least ||x||_W instead of ||x||: equalities, dependent rows, and within hard rows."""
    shapes = [(7, (3,)), (7, (3, 3)), (7, (2, 2, 2)), (7, (4, 4)), (10, (3, 3)), (20, (6, 4, 6))]
    for i, (n, rows) in enumerate(shapes):
        yield Recipe(
            "metric",
            f"n{n}_{shape_of(rows)}_dense",
            13_000 + i,
            f"{_ENTRIES}; W = B^T B + I with integers -3 ... 3 in B (n, n).",
            lambda draw, n=n, rows=rows: _in_metric(random_levels(draw, n, rows), _dense(draw, n)),  # type: ignore[misc]
            since=SINCE,
        )
    for power in (5, 20):
        yield Recipe(
            "metric",
            f"n7_3-3_diagonal_2p{power}",
            13_100,
            f"{_ENTRIES}; W diagonal, powers of two from 1 to 2^{power}: heavy and light unknowns.",
            lambda draw, power=power: _in_metric(random_levels(draw, 7, (3, 3)), _diagonal(draw, 7, power)),  # type: ignore[misc]
            since=SINCE,
        )
    yield Recipe(
        "metric",
        "n7_3-3_dependent",
        13_200,
        "Entries integers -9 ... 9; the last row of level 2 is the first of level 1, with another target; W = B^T B + I.",
        _dependent,
        0.0,
        since=SINCE,
    )
    for rows in ((3, 3), (2, 3, 2)):
        yield Recipe(
            "metric",
            f"n7_{shape_of(rows)}_box",
            13_300 + len(rows),
            f"{_ENTRIES}; W = B^T B + I; hard bounds of +-1/4 on every unknown.",
            lambda draw, rows=rows: _boxed(draw, rows),  # type: ignore[misc]
            since=SINCE,
        )


def damped() -> Iterator[Recipe]:
    """Levels that minimize ||A x - b||^2 + lambda^2 ||x||^2 in what freedom they have, others exact."""
    policies: tuple[tuple[str, str, LevelDamping], ...] = (
        ("constant_1p-02", "constant, 2^-2", ConstantDamping(0.25)),
        ("constant_1p-06", "constant, 2^-6", ConstantDamping(2.0**-6)),
        ("error_1p-03", "2^-3 ||A x - b||^2 before the level", ErrorDamping(0.125)),
    )
    for i, (label, words, policy) in enumerate(policies):
        for rows, which in (((3, 3), (1,)), ((3, 3, 7), (1, 2)), ((4, 4, 4), (0, 1, 2))):
            where = ", ".join(str(k + 1) for k in which)
            yield Recipe(
                "damped",
                f"n7_{shape_of(rows)}_{label}",
                14_000 + 10 * i + len(which),
                f"{_ENTRIES}; levels {where} damped, {words}.",
                lambda draw, rows=rows, which=which, policy=policy: _damped(
                    random_levels(draw, 7, rows), which, policy
                ),  # type: ignore[misc]
                since=SINCE,
            )
    for k in (7, 20, 30):
        yield Recipe(
            "damped",
            f"n7_3-3_near_1p-{k:02d}",
            14_100,
            f"Entries multiples of 1/4 in [-2, 2]; the last row of A_2 is the first of A_1 + 2^-{k} r: an algorithmic "
            "singularity of level 2, which is damped, constant, 2^-4. One seed for all distances.",
            lambda draw, k=k: _near(draw, k),  # type: ignore[misc]
            2.0**-k,
            since=SINCE,
        )
    for label, words, policy in policies:
        yield Recipe(
            "damped",
            f"n7_3-3-4_limits_{label}",
            14_200,
            f"{_ENTRIES}; level 2 bands of half-width 1/4, damped, {words}; hard bounds of +-1/2 on every unknown.",
            lambda draw, policy=policy: _limited(draw, policy),  # type: ignore[misc]
            since=SINCE,
        )


def _in_metric(problem: Problem, W: FloatArray) -> Problem:
    return Problem(problem.levels, problem.hard, metric=W)


def _dense(draw: Draw, n: int) -> FloatArray:
    B = draw.integers(-3, 3, (n, n))
    return (B.T @ B + np.eye(n, dtype=np.int64)).astype(np.float64)


def _diagonal(draw: Draw, n: int, power: int) -> FloatArray:
    exponents = draw.integers(0, power, n)
    exponents[:2] = 0, power
    return np.diag(np.ldexp(1.0, exponents))


def _dependent(draw: Draw) -> Problem:
    A, B = (draw.integers(-9, 9, (3, 7)).astype(np.float64) for _ in range(2))
    B[-1] = A[0]
    levels = [Level.equality(A, draw.grid(3)), Level.equality(B, draw.grid(3))]
    return Problem(levels, metric=_dense(draw, 7))


def _boxed(draw: Draw, rows: Sequence[int]) -> Problem:
    problem = random_levels(draw, 7, rows)
    return Problem(problem.levels, Level(np.eye(7), -0.25, 0.25, "box"), metric=_dense(draw, 7))


def _damped(problem: Problem, which: Sequence[int], policy: LevelDamping) -> Problem:
    return Problem(
        [
            Level.equality(level.A, level.lower, damping=policy if k in which else None)
            for k, level in enumerate(problem.levels)
        ]
    )


def _near(draw: Draw, k: int) -> Problem:
    A, B = (draw.grid((3, 7), 2.0, 3) for _ in range(2))
    B[-1] = A[0] + np.ldexp(draw.grid(7, 1.0, 3), -k)
    return Problem([Level.equality(A, draw.grid(3)), Level.equality(B, draw.grid(3), damping=ConstantDamping(2.0**-4))])


def _limited(draw: Draw, policy: LevelDamping) -> Problem:
    first, second, third = random_levels(draw, 7, (3, 3, 4)).levels
    band = Level(second.A, second.lower - 0.25, second.lower + 0.25, damping=policy)
    return Problem([first, band, third], Level(np.eye(7), -0.5, 0.5, "box"))
