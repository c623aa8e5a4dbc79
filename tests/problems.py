"""Problems that every part of the library is tested on: each generator is deterministic in its seed.

`from tests.problems import ...`. A generator returns a `Problem`; `equality_cases` names a spread of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from hqp_rp import (
    ConstantDamping,
    ErrorDamping,
    Level,
    ManipulabilityDamping,
    NumericalFiltering,
    Problem,
    Truncation,
    VariableDamping,
)

Array = NDArray[np.float64]

POLICIES = (
    ConstantDamping(0.2),
    ErrorDamping(0.05),
    VariableDamping(0.8, 0.3),
    Truncation(0.4),
    ManipulabilityDamping(2.0, 0.4),
    NumericalFiltering(0.8, 0.3),
    ErrorDamping(0.1, power=1),
    ErrorDamping(0.05, toward="rest"),
    None,
)
"""Of single levels, each kind at least once."""


def stack(
    matrices: Sequence[Array], targets: Sequence[Array], names: Sequence[str] | None = None, hard: Level | None = None
) -> Problem:
    """The equality problem `A_k x = b_k`, k = 1 ... p."""
    labels = names if names is not None else [""] * len(matrices)
    pairs = zip(matrices, targets, labels, strict=True)
    return Problem([Level.equality(A, b, name=name) for A, b, name in pairs], hard=hard)


def independent(seed: int = 0, n: int = 7, rows: Sequence[int] = (3, 3)) -> Problem:
    """Random levels whose rows are all independent when `sum(rows) <= n`; every level can be met."""
    rng = np.random.default_rng(seed)
    return stack([rng.standard_normal((m, n)) for m in rows], [rng.standard_normal(m) for m in rows])


def in_metric(problem: Problem, seed: int = 0, condition: float = 1e3) -> Problem:
    """`problem` with a random metric of that condition."""
    rng = np.random.default_rng(1000 + seed)
    Q = np.linalg.qr(rng.standard_normal((problem.n, problem.n)))[0]
    W = (Q * np.logspace(0.0, np.log10(condition), problem.n)) @ Q.T
    return Problem(problem.levels, problem.hard, metric=0.5 * (W + W.T))


def over_constrained(seed: int = 0, n: int = 7, rows: Sequence[int] = (6, 3, 7)) -> Problem:
    """Random levels with more rows than unknowns in all: the later ones conflict with the earlier ones."""
    return independent(seed, n, rows)


def dependent(seed: int = 0, n: int = 7, rows: tuple[int, int] = (3, 3), shared: int = 1) -> Problem:
    """Two levels whose row spaces share exactly `shared` directions: an algorithmic singularity in exact arithmetic.

    Entries are small integers, so the dependence is exact in floating point. The last `shared` rows of level 2 are
    integer combinations of level 1's rows, with targets that contradict them.
    """
    rng = np.random.default_rng(seed)
    A1 = rng.integers(-9, 10, (rows[0], n)).astype(float)
    A2 = rng.integers(-9, 10, (rows[1], n)).astype(float)
    if shared:
        A2[-shared:] = rng.integers(-3, 4, (shared, rows[0])).astype(float) @ A1
    return stack([A1, A2], [rng.standard_normal(m) for m in rows])


def rank_deficient(seed: int = 0, n: int = 7, rows: Sequence[int] = (4, 3), ranks: Sequence[int] = (2, 2)) -> Problem:
    """Levels whose own matrices have the given ranks exactly (products of small integers): kinematic singularities."""
    rng = np.random.default_rng(seed)
    matrices = [
        (rng.integers(-4, 5, (m, r)) @ rng.integers(-4, 5, (r, n))).astype(float)
        for m, r in zip(rows, ranks, strict=True)
    ]
    return stack(matrices, [rng.standard_normal(m) for m in rows])


def near_singular(eps: float, seed: int = 0, n: int = 7, rows: Sequence[int] = (3, 3)) -> Problem:
    """`A_2 = C A_1 + eps R`, further levels random: distance eps from an algorithmic singularity of level 2."""
    rng = np.random.default_rng(seed)
    A1 = rng.standard_normal((rows[0], n))
    C = rng.standard_normal((rows[1], rows[0]))
    R = rng.standard_normal((rows[1], n))
    matrices = [A1, C @ A1 + eps * R, *(rng.standard_normal((m, n)) for m in rows[2:])]
    return stack(matrices, [rng.standard_normal(m) for m in rows])


def conditioned(condition: float, seed: int = 0, n: int = 7, rows: Sequence[int] = (3, 3)) -> Problem:
    """Levels whose own singular values run geometrically from 1 down to 1 / condition, in random directions."""
    rng = np.random.default_rng(seed)
    matrices = []
    for m in rows:
        k = min(m, n)
        U = np.linalg.qr(rng.standard_normal((m, m)))[0][:, :k]
        V = np.linalg.qr(rng.standard_normal((n, n)))[0][:, :k]
        matrices.append(np.ascontiguousarray((U * np.geomspace(1.0, 1.0 / condition, k)) @ V.T))
    return stack(matrices, [rng.standard_normal(m) for m in rows])


def scaled(problem: Problem, factors: Sequence[float]) -> Problem:
    """The same problem with level k's rows and bounds multiplied by factors[k] > 0; its answer is the same.

    Powers of two keep it the same to the last bit.
    """
    levels = [
        Level(level.A * f, level.lower * f, level.upper * f, level.name)
        for level, f in zip(problem.levels, factors, strict=True)
    ]
    return Problem(levels, hard=problem.hard)


def badly_scaled(seed: int = 0, n: int = 7, rows: Sequence[int] = (3, 3)) -> Problem:
    """Random levels scaled by about 1e150, 1e-150, 1e150, ... (powers of two: the answer is that of `independent`)."""
    return scaled(independent(seed, n, rows), [2.0 ** (498 if k % 2 == 0 else -498) for k in range(len(rows))])


def two_sided(
    seed: int = 0, n: int = 7, rows: Sequence[int] = (3, 3, 7), band: float = 0.5, box: float | None = None
) -> Problem:
    """Random levels, each row an equality, a band of half-width up to `band` or one-sided; hard box +-box if given."""
    rng = np.random.default_rng(seed)
    levels = []
    for m in rows:
        A, b = rng.standard_normal((m, n)), rng.standard_normal(m)
        half = rng.uniform(0.0, band, m)
        kind = rng.integers(0, 4, m)
        lower = np.where(kind == 3, -np.inf, np.where(kind == 0, b, b - half))
        upper = np.where(kind == 2, np.inf, np.where(kind == 0, b, b + half))
        levels.append(Level(A, lower, upper))
    hard = None if box is None else Level(np.eye(n), -box, box, name="box")
    return Problem(levels, hard=hard)


def damped(problem: Problem, shift: int = 0) -> Problem:
    """The same levels, each with one of the policies of damping in turn, from number `shift` on."""
    levels = [
        Level(level.A, level.lower, level.upper, level.name, damping=POLICIES[(k + shift) % len(POLICIES)])
        for k, level in enumerate(problem.levels)
    ]
    return Problem(levels, hard=problem.hard)


def boxed(problem: Problem, bound: float) -> Problem:
    """The same levels with hard bounds `-bound <= x <= bound` on every unknown."""
    return Problem(problem.levels, hard=Level(np.eye(problem.n), -bound, bound, name="box"))


EQUALITY_CASES: dict[str, Callable[[int], Problem]] = {
    "independent 3+3": independent,
    "independent 3+3, n=6": lambda seed: independent(seed, n=6),
    "one level": lambda seed: independent(seed, rows=(4,)),
    "three levels 2+2+2": lambda seed: independent(seed, rows=(2, 2, 2)),
    "dependent 3+3": dependent,
    "dependent 4+4, 2 shared": lambda seed: dependent(seed, rows=(4, 4), shared=2),
    "over-constrained 6+3": lambda seed: over_constrained(seed, rows=(6, 3)),
    "over-constrained first level": lambda seed: over_constrained(seed, n=4, rows=(6, 3)),
    "rank-deficient": rank_deficient,
    "rank-deficient over-constrained": lambda seed: rank_deficient(seed, rows=(6, 8), ranks=(3, 4)),
    "near-singular 1e-4": lambda seed: near_singular(1e-4, seed),
    "badly scaled": badly_scaled,
    "empty level": lambda seed: stack(
        [np.zeros((0, 7)), *(level.A for level in independent(seed).levels)],
        [np.zeros(0), *(level.lower for level in independent(seed).levels)],
    ),
    "6+1+7": lambda seed: over_constrained(seed, rows=(6, 1, 7)),
    "6+3+7": over_constrained,
}
"""Name -> generator of equality problems by seed; for parametrized tests."""


def equality_cases(seeds: int = 3) -> list[tuple[str, Problem]]:
    """(name, problem) for every entry of `EQUALITY_CASES` and seeds 0 ... seeds - 1."""
    return [(f"{name} [{s}]", make(s)) for name, make in EQUALITY_CASES.items() for s in range(seeds)]


def degenerate(seed: int = 0) -> Problem:
    """Small integer rows with as many ties as possible: n <= 8, repeated and dependent rows, up to 2 n hard rows.

    Half of the hard polyhedra have all their rows through one integer point; some of the others are empty.
    """
    rng = np.random.default_rng(seed)
    n, size = int(rng.integers(1, 9)), int(rng.integers(1, 4))
    levels: list[Level] = []
    for _ in range(int(rng.integers(1, 4))):
        m = int(rng.integers(1, 7))
        A = rng.integers(-size, size + 1, (m, n)).astype(float)
        if levels and rng.random() < 0.4:
            A = rng.integers(-1, 2, (m, levels[-1].m)) @ levels[-1].A
        if m > 1 and rng.random() < 0.4:
            A[-1] = A[0] * rng.integers(-2, 3)
        lower = rng.integers(-3, 4, m).astype(float)
        upper = np.where(rng.random(m) < 0.4, lower, lower + rng.integers(0, 3, m))
        kind, band = rng.random(m), lower < upper
        levels.append(
            Level(A, np.where((kind > 0.8) & band, -np.inf, lower), np.where((kind < 0.15) & band, np.inf, upper))
        )
    count = int(rng.integers(0, 2 * n + 1))
    if count == 0:
        return Problem(levels)
    A = rng.integers(-1, 2, (count, n)).astype(float)
    if rng.random() < 0.5:
        corner = A @ rng.integers(-1, 2, n)
        return Problem(levels, Level(A, np.where(rng.random(count) < 0.3, corner, -np.inf), corner))
    lower = -rng.integers(0, 2, count).astype(float)
    return Problem(levels, Level(A, lower, lower + rng.integers(0, 3, count)))


def nearly_degenerate(seed: int, by: float) -> tuple[Problem, Array]:
    """`degenerate(seed)` in unknowns turned a little and with rows scaled a little, so that every rank stays; bounds moved by
    about `by`, so that levels contradict each other by that little; and a secondary vector of that length.
    """
    problem, rng = degenerate(seed), np.random.default_rng(seed)
    A, lower, upper, _ = problem.with_hard
    turn, size = 0.3 * rng.standard_normal((problem.n, problem.n)), 0.3 * rng.standard_normal(len(A))
    A = (A + by * size[:, None] * A) @ (np.eye(problem.n) + by * turn)
    rng = np.random.default_rng(seed + 10**6)
    low = lower + by * rng.standard_normal(len(lower))
    up = np.maximum(np.where(lower == upper, low, upper + by * rng.standard_normal(len(lower))), low)
    h = problem.hard_rows
    hard = Level(A[:h], low[:h], up[:h]) if h else None
    moved = Problem.from_stacked(A[h:], low[h:], up[h:], problem.offsets, hard=hard)
    return moved, by * rng.standard_normal(problem.n)


def uneven(seed: int, decades: float, box: bool = False) -> Problem:
    """Two or three levels of equality, one-sided and two-sided rows, whose lengths within a level differ by 10^decades; now and
    then the last row of a level is parallel to its first. `box`: hard bounds on the unknowns, in rows as uneven.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    levels = []
    for _ in range(int(rng.integers(2, 4))):
        m = int(rng.integers(1, 5))
        A = rng.standard_normal((m, n))
        if m > 1 and rng.random() < 0.4:
            A[-1] = A[0] * rng.choice([-1.0, 1.0, 0.5])
        size = 10.0 ** rng.uniform(0.0, decades, m)
        if m > 1:
            size[rng.permutation(m)[:2]] = 1.0, 10.0**decades
        size = 2.0 ** np.round(np.log2(size * 10.0 ** rng.uniform(-2.0, 2.0)))  # parallel rows stay parallel
        centre, width, kind = rng.standard_normal(m), rng.exponential(0.7, m), rng.integers(0, 4, m)
        low = np.where(kind == 2, -np.inf, centre - width)
        up = np.where(kind == 1, np.inf, np.where(kind == 0, centre - width, centre + width))
        levels.append(Level(size[:, None] * A, size * low, size * up))
    size = 10.0 ** rng.uniform(0.0, decades, n)
    return Problem(levels, Level(np.diag(size), -size, size) if box else None)


def dependent_up_to_rounding(seed: int = 0, n: int = 7, box: float | None = None) -> Problem:
    """Two-sided levels of which the second is a product with the first: dependent but for the rounding of its entries."""
    rng = np.random.default_rng(seed)
    A1 = rng.standard_normal((3, n))
    levels = []
    for A in (A1, rng.standard_normal((2, 3)) @ A1, rng.standard_normal((4, n))):
        centre, width = rng.standard_normal(len(A)), rng.random(len(A))
        levels.append(Level(A, centre - width, np.where(rng.random(len(A)) < 0.5, centre - width, centre + width)))
    return Problem(levels, None if box is None else Level(np.eye(n), -box, box))
