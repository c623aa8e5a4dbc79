"""Random families of equalities: independent, dependent, over-constrained, rank-deficient, badly scaled, near-singular.

Every product that makes rows dependent is one of small integers, exact in floating point: what is called dependent here is
so in exact arithmetic, and a distance of 2**-k is that distance to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.problems.recipe import Draw, Recipe, equalities, random_levels, shape_of

_UNIFORM = "Entries uniform on multiples of 2^-20 in [-1, 1]"


def independent() -> Iterator[Recipe]:
    """Every level can be met; the last shapes leave no freedom, or have one level."""
    shapes = [(7, (3, 3)), (7, (2, 2, 2)), (7, (4,)), (6, (3, 3)), (7, (1, 1, 1, 1, 1, 1, 1)), (30, (6, 4, 10))]
    for s, (n, rows) in enumerate([*shapes, (40, (12, 3, 6, 6, 10))]):
        for i in range(2 if n < 10 else 1):
            yield Recipe(
                "independent",
                f"n{n}_{shape_of(rows)}_s{i}",
                1000 + 10 * s + i,
                f"{_UNIFORM}; all rows of all levels are linearly independent.",
                lambda draw, n=n, rows=rows: random_levels(draw, n, rows),  # type: ignore[misc]
            )


def over_constrained() -> Iterator[Recipe]:
    """More rows than unknowns in all, or within the first level."""
    shapes = [(7, (6, 3)), (7, (6, 3, 7)), (7, (6, 1, 7)), (7, (3, 3, 7)), (4, (9,)), (4, (6, 3)), (20, (12, 12, 20))]
    for s, (n, rows) in enumerate([*shapes, (40, (12, 3, 12, 12, 38))]):
        for i in range(2 if n < 10 else 1):
            yield Recipe(
                "over_constrained",
                f"n{n}_{shape_of(rows)}_s{i}",
                2000 + 10 * s + i,
                f"{_UNIFORM}; more rows than unknowns, so that levels contradict the ones before them.",
                lambda draw, n=n, rows=rows: random_levels(draw, n, rows),  # type: ignore[misc]
            )


def dependent() -> Iterator[Recipe]:
    """A level's rows are exact combinations of earlier levels' rows: an algorithmic singularity."""
    for i, (rows, shared) in enumerate(
        [((3, 3), 1), ((3, 3), 2), ((3, 3), 3), ((4, 4), 2), ((6, 3), 3), ((3, 3, 7), 1)]
    ):
        for agree in (False, True):
            words = "agree with" if agree else "contradict"
            yield Recipe(
                "dependent",
                f"n7_{shape_of(rows)}_shared{shared}_{'agree' if agree else 'conflict'}",
                3000 + 10 * i + agree,
                f"The last {shared} rows of level 2 are combinations of level 1's rows with weights -3 ... 3; entries are "
                f"integers -9 ... 9 before. Their targets {words} level 1.",
                lambda draw, rows=rows, shared=shared, agree=agree: _dependent(draw, rows, shared, agree),  # type: ignore[misc]
                0.0,
            )
    yield Recipe(
        "dependent",
        "n7_2-2-3_jointly",
        3900,
        "Level 3's last row is the sum of a row of level 1 and a row of level 2: independent of either, dependent on both.",
        _jointly,
        0.0,
    )
    yield Recipe(
        "dependent",
        "n7_3-3_repeated",
        3901,
        "Level 2 is level 1 again, with other targets.",
        lambda draw: (lambda A: equalities([A, A], [draw.grid(3), draw.grid(3)]))(draw.grid((3, 7))),
        0.0,
    )


def _dependent(draw: Draw, rows: Sequence[int], shared: int, agree: bool) -> Problem:
    matrices = [draw.integers(-9, 9, (m, 7)) for m in rows]
    weights = draw.integers(-3, 3, (shared, rows[0]))
    weights[np.arange(shared), np.arange(shared)] = 1  # no row of zeros
    matrices[1][-shared:] = weights @ matrices[0]
    targets = [draw.grid(m) for m in rows]
    if agree:
        targets[1][-shared:] = weights @ targets[0]
    return equalities([A.astype(np.float64) for A in matrices], targets)


def _jointly(draw: Draw) -> Problem:
    A, B, C = (draw.integers(-9, 9, (m, 7)).astype(np.float64) for m in (2, 2, 3))
    C[-1] = A[0] + B[1]
    return equalities([A, B, C], [draw.grid(m) for m in (2, 2, 3)])


def rank_deficient() -> Iterator[Recipe]:
    """A level's own matrix lacks rank: a kinematic singularity."""
    cases = [((4, 3), (2, 2)), ((6, 8), (3, 4)), ((3, 3, 7), (2, 3, 7)), ((3, 3, 7), (3, 1, 5)), ((5, 5, 5), (3, 3, 3))]
    for i, (rows, ranks) in enumerate([*cases, ((2, 3), (0, 3))]):
        for seed in range(2):
            yield Recipe(
                "rank_deficient",
                f"n7_{shape_of(rows)}_rank{shape_of(ranks)}_s{seed}",
                4000 + 10 * i + seed,
                f"Level k is a product of integer matrices with entries -4 ... 4 of rank {list(ranks)}.",
                lambda draw, rows=rows, ranks=ranks: _rank_deficient(draw, rows, ranks),  # type: ignore[misc]
                0.0,
            )


def _rank_deficient(draw: Draw, rows: Sequence[int], ranks: Sequence[int]) -> Problem:
    matrices = [
        (draw.integers(-4, 4, (m, r)) @ draw.integers(-4, 4, (r, 7))).astype(np.float64)
        for m, r in zip(rows, ranks, strict=True)
    ]
    return equalities(matrices, [draw.grid(m) for m in rows])


def badly_scaled() -> Iterator[Recipe]:
    """Levels, rows or unknowns in units that differ by powers of two: exactly the problem that they scale."""
    for i, rows in enumerate([(3, 3), (6, 3, 7)]):
        for kind, power, words in (
            ("levels", 498, "Whole levels (rows and targets) times 2^498 and 2^-498 in turn, about 1e150 and 1e-150"),
            ("rows", 10, "Each row and its target times 2^-10 ... 2^10 at random"),
            ("columns", 10, "Each column times 2^-10 ... 2^10 at random, as mixed units of the unknowns would"),
        ):
            yield Recipe(
                "badly_scaled",
                f"n7_{shape_of(rows)}_{kind}",
                5000 + 10 * i + len(kind),
                f"{_UNIFORM}. {words}.",
                lambda draw, rows=rows, kind=kind, power=power: _badly_scaled(draw, rows, kind, power),  # type: ignore[misc]
            )


def _badly_scaled(draw: Draw, rows: Sequence[int], kind: str, power: int) -> Problem:
    problem = random_levels(draw, 7, rows)
    columns = draw.integers(-power, power, 7) if kind == "columns" else np.zeros(7, np.int64)
    levels = []
    for k, level in enumerate(problem.levels):
        exponents = (
            np.full(level.m, power if k % 2 == 0 else -power) if kind == "levels" else np.zeros(level.m, np.int64)
        )
        if kind == "rows":
            exponents = draw.integers(-power, power, level.m)
        levels.append(
            Level.equality(np.ldexp(level.A, exponents[:, None] + columns[None, :]), np.ldexp(level.lower, exponents))
        )
    return Problem(levels)


def near_singular() -> Iterator[Recipe]:
    """At distance 2^-k from a singularity, from far to below every rank rule."""
    exponents = (7, 13, 20, 27, 33, 37, 39, 40, 42, 44)
    for kind, rows, words in (
        ("all", (3, 3), "A_2 = C A_1 + 2^-{k} R in all rows: an algorithmic singularity of level 2"),
        ("one", (3, 3, 7), "The last row of A_2 is c A_1 + 2^-{k} r: an algorithmic singularity of level 2"),
        (
            "own",
            (4, 3),
            "The last row of A_1 is a combination of its others + 2^-{k} r: a kinematic singularity of level 1",
        ),
    ):
        for k in exponents if kind != "own" else (7, 20, 33, 39, 40, 44):
            yield Recipe(
                "near_singular",
                f"n7_{shape_of(rows)}_{kind}_1p-{k:02d}",
                {"all": 6000, "one": 6100, "own": 6200}[kind],
                words.format(k=k)
                + "; entries of A are multiples of 1/4 in [-2, 2], weights integers -3 ... 3. One seed for "
                "all distances: only the power of two changes.",
                lambda draw, kind=kind, rows=rows, k=k: _near_singular(draw, kind, rows, k),  # type: ignore[misc]
                2.0**-k,
            )


def _near_singular(draw: Draw, kind: str, rows: Sequence[int], k: int) -> Problem:
    matrices: list[FloatArray] = [draw.grid((m, 7), 2.0, 3) for m in rows]
    base = matrices[0] if kind != "own" else matrices[0][:-1]
    last = matrices[1] if kind == "all" else matrices[1][-1:] if kind == "one" else matrices[0][-1:]
    weights = draw.integers(-3, 3, (len(last), len(base)))
    weights[:, 0] = 1
    last[:] = weights @ base + np.ldexp(draw.grid(last.shape, 1.0, 3), -k)
    return equalities(matrices, [draw.grid(m) for m in rows])
