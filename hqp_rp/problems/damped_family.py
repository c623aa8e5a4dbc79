"""Problems whose levels are damped by a constant: what a level then misses on purpose is part of the exact answer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from hqp_rp.core.damping import ConstantDamping
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.problems.recipe import Draw, Recipe, random_levels, shape_of
from hqp_rp.problems.robots import load_snapshot

_ROWS = "Entries of A and targets uniform on multiples of 2^-20 in [-1, 1]"
_SIGMAS = (1e-1, 1e-2, 1e-4, 1e-6, 1e-8)


def damped() -> Iterator[Recipe]:
    """Constant damping 2^-k on single levels: far from singularities, near one of random rows, and near the Sawyer's own."""
    for s, (n, rows, at) in enumerate(
        [
            (7, (3, 3), {1: 3}),
            (7, (3, 3), {0: 4}),
            (7, (3, 3, 7), {1: 3, 2: 5}),
            (7, (6, 3, 7), {0: 2}),
            (14, (3, 3, 14), {1: 4}),
        ]
    ):
        words = ", ".join(f"level {k + 1} by 2^-{e}" for k, e in at.items())
        yield Recipe(
            "damped",
            f"n{n}_{shape_of(rows)}_{'-'.join(str(k + 1) for k in at)}",
            14_000 + 10 * s,
            f"{_ROWS}; damped: {words}.",
            lambda draw, n=n, rows=rows, at=at: with_damping(random_levels(draw, n, rows), at),  # type: ignore[misc]
        )
    for k in (7, 13, 20, 27):
        yield Recipe(
            "damped",
            f"n7_3-3-7_near_1p-{k:02d}",
            14_100,
            f"A_2 = C A_1 + 2^-{k} R: an algorithmic singularity of level 2, which is damped by 2^-5; entries of A are "
            "multiples of 1/4 in [-2, 2], weights integers -3 ... 3. One seed for all distances.",
            lambda draw, k=k: with_damping(_near(draw, k), {1: 5}),  # type: ignore[misc]
            2.0**-k,
        )
    for sigma in _SIGMAS:
        yield Recipe(
            "damped",
            f"sawyer_3-3-7_sigma{sigma:.0e}",
            14_200,
            f"The Sawyer's tool position, tool orientation, posture, at sigma_min = {sigma:.0e} as in the family sawyer; the "
            "orientation is damped by 2^-5. Targets: rates uniform on multiples of 2^-20 within 0.25, 0.25, 0.5 m/s or rad/s.",
            lambda draw, sigma=sigma: _sawyer(draw, sigma),  # type: ignore[misc]
            sigma,
        )


def with_damping(problem: Problem, exponents: Mapping[int, int]) -> Problem:
    """The same equalities, level k damped by `2**-exponents[k]` where there is one."""
    return Problem(
        [
            Level.equality(
                level.A,
                level.lower,
                name=level.name,
                damping=ConstantDamping(2.0 ** -exponents[k]) if k in exponents else None,
            )
            for k, level in enumerate(problem.levels)
        ]
    )


def _near(draw: Draw, k: int) -> Problem:
    matrices: list[FloatArray] = [draw.grid((m, 7), 2.0, 3) for m in (3, 3, 7)]
    weights = draw.integers(-3, 3, (3, 3))
    weights[:, 0] = 1
    matrices[1][:] = weights @ matrices[0] + np.ldexp(draw.grid((3, 7), 1.0, 3), -k)
    return Problem([Level.equality(A, draw.grid(len(A))) for A in matrices])


def _sawyer(draw: Draw, sigma: float) -> Problem:
    J = load_snapshot()[f"sawyer/sigma{sigma:.0e}/tool"]
    rows: Sequence[tuple[str, FloatArray, float]] = (
        ("tool position", J[:3], 0.25),
        ("tool orientation", J[3:], 0.25),
        ("posture", np.eye(7), 0.5),
    )
    levels = [Level.equality(A, draw.grid(len(A)) * size, name=name) for name, A, size in rows]
    return with_damping(Problem(levels), {1: 5})
