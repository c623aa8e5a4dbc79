"""Problems that no solver here was ever tested on: drawn anew from a seed, judged by the certificate alone."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

import hqp_rp
from hqp_rp.problems.known_problem import KnownAnswer

SHAPES = {
    "n7_3-3": (7, (3, 3)),
    "n7_3-3-7": (7, (3, 3, 7)),
    "n7_6-1-7": (7, (6, 1, 7)),
    "n30_6-6-3-30": (30, (6, 6, 3, 30)),
}
COUNT = 20


class Fresh(NamedTuple):
    """As much of a `KnownProblem` as the judge reads: no answer is known."""

    problem: hqp_rp.Problem
    feasible: bool = True
    answers: tuple[KnownAnswer, ...] = ()


def draw(seed: int) -> dict[str, Fresh]:
    """Equality levels with normal entries, and the same with hard bounds on every unknown that cut into the answer: half of
    the largest entry that the answer has without them."""
    rng = np.random.default_rng(seed)
    found = {}
    for label, (n, rows) in SHAPES.items():
        for i in range(COUNT):
            levels = [hqp_rp.Level.equality(rng.standard_normal((m, n)), rng.standard_normal(m)) for m in rows]
            free = hqp_rp.Problem(levels)
            bound = 0.5 * np.abs(hqp_rp.solve(free, "null_space").require()).max()
            found[f"equalities/{label}_{i}"] = Fresh(free)
            found[f"limits/{label}_{i}"] = Fresh(hqp_rp.Problem(levels, hard=hqp_rp.Level(np.eye(n), -bound, bound)))
    return found


def save(found: dict[str, Fresh], folder: Path) -> dict[str, Path]:
    """Each as a plain .npz, as the problem set has them."""
    paths = {}
    for name, one in found.items():
        paths[name] = folder / f"{name.replace('/', '_')}.npz"
        hqp_rp.save_problem(one.problem, paths[name])
    return paths
