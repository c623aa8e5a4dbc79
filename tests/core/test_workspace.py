"""Nothing is allocated inside a solve after the first of its size, however singular the later ones are."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
import pytest

from hqp_rp import ConstantDamping, Level, Problem, Solver, get_solver, solve_batch
from hqp_rp.core import _native

SOLVERS = {
    "null_space": get_solver("null_space"),
    "null_space, damped": get_solver("null_space", damping=ConstantDamping(0.1)),
    "reverse_priority": get_solver("reverse_priority"),
    "reverse_priority, damped": get_solver("reverse_priority", damping=ConstantDamping(0.1)),
    "hierarchical_active_set": get_solver("hierarchical_active_set"),
    "hierarchical_active_set, warm": get_solver("hierarchical_active_set", warm_start=True),
    "saturation_null_space": get_solver("saturation_null_space"),
    "saturation_null_space, optimal": get_solver("saturation_null_space", variant="optimal"),
}
SHAPES = [
    (1, (1,)),
    (3, (1, 1)),
    (7, (3, 3)),
    (7, (3, 3, 7)),
    (7, (12, 9)),
    (30, (6, 6, 3, 30)),
    (45, (98,)),
    (38, (12, 3, 6, 38)),
]
BREAKS = (None, 0.0, 1e-12, 1e-9, 1e-5)


def _problem(rng: np.random.Generator, n: int, sizes: tuple[int, ...], size: float | None, kind: str) -> Problem:
    """Random levels; with a size, each begins with rows of the one before it, so far from them."""
    levels: list[Level] = []
    for m in sizes:
        A, b = rng.standard_normal((m, n)), rng.standard_normal(m)
        if size is not None and levels:
            r = min(m, levels[-1].m)
            A[:r] = levels[-1].A[:r] + size * rng.standard_normal((r, n))
        if size is not None and m > 1:
            A[-1] = 2.0 * A[0] + size * rng.standard_normal(n)
        width = np.abs(rng.standard_normal(m)) if kind == "bands" else np.zeros(m)
        levels.append(Level(A, b - width, b + width))
    return Problem(levels, hard=None if kind == "free" else Level(np.eye(n), -0.3, 0.3))


def _blocks_in_a_fresh_thread(calls: list[Callable[[], object]]) -> list[int]:
    """Blocks of this thread's workspace after each call; a workspace belongs to a thread."""
    counts: list[int] = []

    def work() -> None:
        for call in calls:
            call()
            counts.append(_native.workspace_allocations())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    return counts


@pytest.mark.parametrize(("n", "sizes"), SHAPES)
@pytest.mark.parametrize("name", SOLVERS)
def test_nothing_is_allocated_after_the_first_solve_of_a_size(name: str, n: int, sizes: tuple[int, ...]) -> None:
    rng = np.random.default_rng(n + sum(sizes))
    solver: Solver = SOLVERS[name]
    kind = next(
        kind for kind in ("bands", "box", "free") if solver.refuses(_problem(rng, n, sizes, None, kind)) is None
    )
    problems = [_problem(rng, n, sizes, size, kind) for _ in range(6) for size in BREAKS]
    counts = _blocks_in_a_fresh_thread([lambda problem=problem: solver.solve(problem) for problem in problems])
    assert counts[0] >= 1
    assert len(counts) == len(problems)
    assert counts == [counts[0]] * len(counts)


@pytest.mark.parametrize("name", ["null_space", "reverse_priority"])
def test_nor_in_a_batch(name: str) -> None:
    rng = np.random.default_rng(3)
    for n, sizes in SHAPES:
        batches = []
        for size in BREAKS:
            problems = [_problem(rng, n, sizes, size, "free") for _ in range(17)]
            batches.append((np.stack([q.matrix for q in problems]), np.stack([q.lower for q in problems])))
        offsets = problems[0].offsets
        counts = _blocks_in_a_fresh_thread(
            [
                lambda A=A, b=b, at=offsets: solve_batch(A, b, None, at, solver=SOLVERS[name], threads=1)
                for A, b in batches
            ]
        )
        assert counts == [counts[0]] * len(batches), (n, sizes)
