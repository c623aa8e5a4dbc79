"""Levels whose rows differ in length, by the exact truth, per decade: `python -m tests.fuzz_uneven --count 4000 --seed 0`.

Wrong: row by row, the violations at the answer and at the truth differ by more than 1e-6 of `||a_i|| ||x|| + |bound_i|`.
"""

from __future__ import annotations

import argparse
import collections
import sys

import numpy as np

from hqp_rp import Problem, Status, certify, get_solver, truth
from hqp_rp.core.diagnostics import violation
from hqp_rp.core.problem import FloatArray
from tests.problems import uneven


def row_errors(problem: Problem, x: FloatArray, right: FloatArray) -> float:
    """How far the violations at x and at the right answer are apart at most, as a part of ||a_i|| ||x|| + |bound_i|."""
    worst = 0.0
    for level in problem.levels:
        apart = np.abs(violation(level, x) - violation(level, right))
        near = np.clip(level.A @ right, level.lower, level.upper)
        size = np.linalg.norm(level.A, axis=1) * np.linalg.norm(right) + np.abs(near)
        worst = max(worst, float((apart / np.maximum(size, 1e-300)).max()))
    return worst


def counts(solver_name: str, count: int, seed: int) -> dict[int, collections.Counter[str]]:
    """By decade of the ratio of lengths: problems, statuses, wrong answers called solved, wrong verdicts of the certificate."""
    found: dict[int, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    solver = get_solver(solver_name)
    for at in range(seed, seed + count):
        decades = float(np.random.default_rng([at, 1]).uniform(0.0, 8.0))
        problem = uneven(at, decades, box=at % 3 == 0)
        right = truth(problem)
        if right.ambiguous or right.x is None or solver.refuses(problem):
            continue
        solver.reset()
        solution = solver.solve(problem)
        told = found[int(decades)]
        told["problems"] += 1
        told[solution.status.name] += 1
        told["truth refused"] += not certify(problem, right.x).ok
        if solution.x is None:
            continue
        wrong = row_errors(problem, solution.x, right.x) > 1e-6
        told["wrong SOLVED"] += wrong and solution.status is Status.SOLVED
        told["wrong certified"] += wrong and certify(problem, solution.x).ok
    return found


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--solver", default="hierarchical_active_set")
    asked = parser.parse_args(arguments)
    found = counts(asked.solver, asked.count, asked.seed)
    total: collections.Counter[str] = collections.Counter()
    for decade in sorted(found):
        total.update(found[decade])
        print(f"1e{decade}: {dict(found[decade])}")
    print(f"all: {dict(total)}")
    return int(total["wrong SOLVED"] > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
