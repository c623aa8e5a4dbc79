"""Random and nasty problems against every solver's verdict: `python -m tests.fuzz_verdicts --count 2000 --seed 1`.

What must hold, whatever the problem: hard rows that contradict each other are never called solved and come with x None; no x
that breaks a hard row comes back; what is called solved is certified to the solver's tolerance where its method promises the
optimum; and a solver that has seen other problems before answers as a fresh one does, or does not say that it solved.
"""

from __future__ import annotations

import argparse
import collections
import dataclasses
import sys
from collections.abc import Iterator

import numpy as np

from hqp_rp import Level, Problem, Solution, Solver, Status, certify, get_solver
from hqp_rp.core.verify import breaks_hard_rows

SOLVERS = (
    "hierarchical_active_set",
    "qp_cascade",
    "weighted",
    "daqp",
    "saturation_null_space",
    "reverse_priority_unilateral",
)
KINDS = ("feasible", "infeasible", "parallel", "scaled", "dependent", "tiny")


def random_infeasible(rng: np.random.Generator) -> Problem:
    """Hard rows of which several together, and no fewer, cannot be met: g_i x <= h_i with w G = 0 and w h < 0, w > 0."""
    n = int(rng.integers(1, 6))
    k = int(rng.integers(2, n + 2))
    G = rng.standard_normal((k, n))
    w = rng.uniform(0.2, 2.0, k)
    G[-1] = -(w[:-1] @ G[:-1]) / w[-1]
    h = rng.standard_normal(k)
    h[-1] -= (w @ h + rng.uniform(0.05, 2.0)) / w[-1]
    others = int(rng.integers(0, 6))
    A = np.concatenate((G, rng.standard_normal((others, n))))
    upper = np.concatenate((h, np.full(others, 5.0)))
    lower = np.concatenate((np.full(k, -np.inf), np.full(others, -5.0)))
    order = rng.permutation(len(A))
    flip = rng.random(len(A)) < 0.5
    low, up = np.where(flip, -upper, lower), np.where(flip, -lower, upper)
    rows = np.where(flip[:, None], -A, A)
    scale = 10.0 ** rng.uniform(-2, 2, len(A))
    hard = Level((scale[:, None] * rows)[order], (scale * low)[order], (scale * up)[order])
    return Problem([Level.equality(rng.standard_normal((2, n)), rng.standard_normal(2))], hard=hard)


def random_feasible(rng: np.random.Generator, kind: str = "feasible") -> Problem:
    """Hard rows that a known point meets, and levels of equalities; nearly parallel, badly scaled or dependent by `kind`."""
    n = int(rng.integers(2, 8))
    inside = rng.standard_normal(n)
    A = np.concatenate((np.eye(n), rng.standard_normal((int(rng.integers(0, 5)), n))))
    if kind == "parallel":
        copies = A[rng.integers(0, len(A), 3)]
        A = np.concatenate((A, copies + 10.0 ** rng.uniform(-10, -4) * rng.standard_normal(copies.shape)))
    value = A @ inside
    lower, upper = value - rng.uniform(0.0, 1.0, len(A)), value + rng.uniform(0.0, 1.0, len(A))
    levels = []
    for _ in range(int(rng.integers(1, 4))):
        J = rng.standard_normal((int(rng.integers(1, 4)), n))
        if kind == "dependent" and levels:
            J[0] = levels[0].A[0] * rng.standard_normal()
        levels.append(Level.equality(J, J @ inside + rng.standard_normal(len(J))))
    if kind == "scaled":
        factors = 10.0 ** rng.uniform(-6, 6, len(A))
        A, lower, upper = factors[:, None] * A, factors * lower, factors * upper
        levels = [
            Level.equality(s * level.A, s * level.lower) for level in levels for s in (10.0 ** rng.uniform(-6, 6),)
        ]
    if kind == "tiny":
        factor = 10.0 ** rng.uniform(-12, -6)
        lower, upper = factor * lower, factor * upper
        levels = [Level.equality(level.A, factor * level.lower) for level in levels]
    return Problem(levels, hard=Level(A, lower, upper))


def problems(seed: int, count: int) -> Iterator[tuple[str, Problem]]:
    """`count` problems of every kind in turn."""
    rng = np.random.default_rng(seed)
    for i in range(count):
        kind = KINDS[i % len(KINDS)]
        yield kind, random_infeasible(rng) if kind == "infeasible" else random_feasible(rng, kind)


def fault(solver: Solver, kind: str, problem: Problem, solution: Solution, fresh: Solution) -> str:
    """What is wrong with an answer, or ""; `fresh` is what a solver that has seen nothing says."""
    if kind == "infeasible":
        if solution.x is not None or solution.status is Status.SOLVED:
            return f"an x for hard rows in conflict, {solution.status.name}"
        return (
            "" if solution.status in (Status.INFEASIBLE, Status.REFUSED) else f"conflict called {solution.status.name}"
        )
    if solution.status is Status.INFEASIBLE:
        return "a feasible problem called INFEASIBLE"
    if solution.x is None:
        return ""
    if breaks_hard_rows(problem, solution.x, 2.0 * solver.tolerance):
        return f"an x that breaks a hard row, {solution.status.name}"
    if solution.status is not Status.SOLVED:
        return ""
    if solver.is_lexicographic(problem) and not certify(problem, solution.x, tolerance=solver.tolerance).ok:
        return "SOLVED, and not the optimum"
    if fresh.status is Status.SOLVED and fresh.x is not None:
        apart = float(np.linalg.norm(solution.x - fresh.x)) / (1e-300 + float(np.linalg.norm(fresh.x)))
        if solver.is_lexicographic(problem) and solver.name == "hierarchical_active_set" and apart > 1e-9:
            return f"another answer than a fresh solver's (relative {apart:.1e})"
    return ""


def run(names: tuple[str, ...], seed: int, count: int) -> collections.Counter[tuple[str, str, str]]:
    """How often which solver failed how on which kind of problem."""
    found: collections.Counter[tuple[str, str, str]] = collections.Counter()
    solvers = {name: get_solver(name) for name in names}
    for kind, problem in problems(seed, count):
        for name, solver in solvers.items():
            if solver.refuses(problem) is not None:
                continue
            fresh = dataclasses.replace(solver).solve(problem) if name == "hierarchical_active_set" else None
            solution = solver.solve(problem)
            said = fault(solver, kind, problem, solution, solution if fresh is None else fresh)
            if said:
                found[name, kind, said.partition(" (")[0]] += 1
    return found


def main() -> int:
    """Print every fault with its number; 1 when there is any."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--solver", nargs="*", default=list(SOLVERS))
    asked = parser.parse_args()
    found = run(tuple(asked.solver), asked.seed, asked.count)
    for (name, kind, said), times in sorted(found.items()):
        print(f"{name:30} {kind:12} {times:6}  {said}")
    print(f"{asked.count} problems, {sum(found.values())} wrong verdicts.")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
