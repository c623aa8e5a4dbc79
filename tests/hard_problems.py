"""Random problems with hard rows whose feasibility is known: wide, barely, and not feasible. Deterministic in the seed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hqp_rp import Level, Problem

KINDS = ("wide", "barely", "infeasible")


def soft_levels(rng: np.random.Generator, n: int, *, two_sided: bool) -> list[Level]:
    """One to three levels of small-integer rows, so that dependent rows are dependent exactly."""
    levels: list[Level] = []
    for _ in range(int(rng.integers(1, 4))):
        m = int(rng.integers(1, 6))
        A = rng.integers(-9, 10, (m, n)) / 4.0
        if levels and rng.random() < 0.3:
            A = rng.integers(-3, 4, (m, levels[-1].m)) @ levels[-1].A
        lower = 2.0 * rng.standard_normal(m)
        upper = np.where(rng.random(m) < 0.4, lower, lower + 2.0 * rng.random(m)) if two_sided else lower
        levels.append(Level(A, lower, upper))
    return levels


def box_problem(seed: int, kind: str, *, two_sided: bool = False) -> Problem:
    """Levels with a hard box on the unknowns, one row for each, some scaled, repeated or one-sided.

    "barely": some unknowns are pinned, by an equality or by two rows that meet. "infeasible": two rows of one unknown part.
    """
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    n = int(rng.integers(2, 9))
    levels = soft_levels(rng, n, two_sided=two_sided)
    lower = -rng.uniform(0.0, 1.5, n)
    upper = rng.uniform(0.0, 1.5, n)
    away = rng.random(n) < 0.2  # bounds that exclude zero, as on the way back into limits
    lower, upper = np.where(away, upper, lower), np.where(away, upper + rng.uniform(0.0, 1.0, n), upper)
    if kind == "barely":
        pinned = rng.random(n) < 0.5
        lower = np.where(pinned, upper, lower)
    A = np.eye(n)
    repeated = rng.integers(0, n, int(rng.integers(0, 3)))
    A, lower, upper = (np.concatenate((part, part[repeated])) for part in (A, lower, upper))
    if kind != "infeasible":
        open_above = (rng.random(len(A)) < 0.2) & (lower < upper)
        upper = np.where(open_above, np.inf, upper)
    else:
        i = int(rng.integers(0, n))
        A = np.concatenate((A, A[i : i + 1]))
        lower = np.concatenate((lower, [upper[i] + rng.uniform(1e-3, 1.0)]))
        upper = np.concatenate((upper, [np.inf]))
    scale = 2.0 ** rng.integers(-2, 3, len(A)) * rng.choice([-1.0, 1.0], len(A))
    lower, upper = np.where(scale > 0, lower * scale, upper * scale), np.where(scale > 0, upper * scale, lower * scale)
    return Problem(levels, Level(A * scale[:, None], lower, upper, name="box"))


def polytope_problem(seed: int, kind: str, *, two_sided: bool = False) -> Problem:
    """Levels with general hard rows. "barely": rows that only one point, or one face, meets; "infeasible": rows in conflict."""
    rng = np.random.default_rng([seed, KINDS.index(kind), 7])
    n = int(rng.integers(2, 8))
    levels = soft_levels(rng, n, two_sided=two_sided)
    m = int(rng.integers(1, 2 * n))
    A = rng.integers(-9, 10, (m, n)) / 4.0
    x = rng.integers(-8, 9, n) / 8.0  # the rows' values at it are exact
    centre: NDArray[np.float64] = A @ x
    if kind == "wide":
        return Problem(levels, Level(A, centre - 0.3 * rng.random(m) - 0.01, centre + rng.random(m) + 0.01))
    # A positive combination of rows vanishes and all meet at x: the face where they all hold with equality is all there is.
    A = np.concatenate((A, -A.sum(axis=0)[None, :]))
    upper = A @ x
    if kind == "infeasible":
        upper = upper - rng.uniform(0.01, 0.5) * np.linalg.norm(A, axis=1)
    return Problem(levels, Level(A, -np.inf, upper))


def hard_violation(problem: Problem, x: NDArray[np.float64]) -> float:
    """Largest violation of a hard row at x, relative to `||a_i|| ||x|| + |bound_i|` + 1e-12."""
    if problem.hard is None or not problem.hard.m:
        return 0.0
    value = problem.hard.A @ x
    bound = np.clip(value, problem.hard.lower, problem.hard.upper)
    reach = np.linalg.norm(problem.hard.A, axis=1) * np.linalg.norm(x) + np.abs(bound) + 1e-12
    return float((np.abs(value - bound) / reach).max())
