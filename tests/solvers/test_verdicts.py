"""Verdicts that must hold for every solver: contradictions, warm starts, threads, and the certificate at zero."""

from __future__ import annotations

import dataclasses
import threading
from pathlib import Path

import numpy as np
import pytest

from hqp_rp import Level, Problem, Solver, Status, all_solvers, certify, get_solver, load_problem, truth
from tests.fuzz_verdicts import SOLVERS, random_feasible, random_infeasible, run

CASES = Path(__file__).parents[1] / "cases"
TAKERS = [get_solver(name) for name, kind in all_solvers().items() if kind.takes_hard]
TAKERS += [get_solver("qp_cascade", backend=backend) for backend in ("osqp", "quadprog", "piqp")]


@pytest.mark.parametrize("solver", TAKERS, ids=repr)
def test_hard_rows_that_contradict_each_other(solver: Solver) -> None:
    hard = Level([[1.0], [0.45], [1.0]], [-1.0, 0.72, -np.inf], [1.0, np.inf, 0.375])
    solution = solver.solve(Problem([Level.equality([[1.0]], [0.0])], hard=hard))
    assert solution.status is Status.INFEASIBLE
    assert solution.x is None


# set_based knows it only when it has tried every mode.
@pytest.mark.parametrize(
    "solver", [s for s in TAKERS if s.name not in ("saturation_null_space", "set_based")], ids=repr
)
def test_several_rows_in_conflict(solver: Solver) -> None:
    rng = np.random.default_rng(11)
    for _ in range(60):
        solution = solver.solve(random_infeasible(rng))
        assert solution.status is Status.INFEASIBLE
        assert solution.x is None


def test_modes_that_all_fail_are_a_contradiction_and_too_many_of_them_a_limit() -> None:
    rng = np.random.default_rng(11)
    solver = get_solver("set_based", max_modes=60)
    statuses = [solver.solve(random_infeasible(rng)).status for _ in range(60)]
    assert set(statuses) <= {Status.INFEASIBLE, Status.ITERATION_LIMIT}
    apart = Level([[1.0, 0.0], [1.0, 0.0]], [1.0, -np.inf], [np.inf, 0.0])
    assert solver.solve(Problem([Level.equality(np.eye(2), [3.0, 4.0])], hard=apart)).status is Status.INFEASIBLE


@pytest.mark.parametrize("name", "abcd")
def test_a_warm_start_changes_no_answer(name: str) -> None:
    problem = load_problem(CASES / f"warm_{name}.npz")
    solver = get_solver("hierarchical_active_set")
    solver.solve(load_problem(CASES / f"warm_{name}_before.npz"))
    warm = solver.solve(problem)
    right = {"a": [0.0, 0.0, 0.5], "b": 0.6772895892147311, "c": 1.2876226317991322, "d": 1.3830959682941488}[name]
    assert warm.status is Status.SOLVED
    if name == "a":
        np.testing.assert_allclose(warm.x, right, atol=1e-12)
    else:
        assert np.linalg.norm(warm.x) == pytest.approx(right, rel=1e-9)


def test_after_a_step_at_a_singularity_the_next_one_is_as_from_nothing() -> None:
    rng = np.random.default_rng(5)
    solver = get_solver("hierarchical_active_set")
    for _ in range(40):
        A = rng.standard_normal((3, 7))
        eps = 10.0 ** rng.uniform(-11, -8)
        B = rng.standard_normal((3, 3)) @ A + eps * rng.standard_normal((3, 7))
        box = Level(np.eye(7), -1e12, 1e12)
        solver.solve(
            Problem([Level.equality(A, rng.standard_normal(3)), Level.equality(B, rng.standard_normal(3))], hard=box)
        )
        harmless = [Level.equality(rng.standard_normal((3, 7)), rng.standard_normal(3)) for _ in range(2)]
        problem = Problem(harmless, hard=box)
        warm, cold = solver.solve(problem), dataclasses.replace(solver).solve(problem)
        assert warm.status is cold.status is Status.SOLVED
        np.testing.assert_allclose(warm.x, cold.x, rtol=0.0, atol=1e-9 * np.linalg.norm(cold.x))


def test_at_zero_the_certificate_knows_rounding_from_a_fault() -> None:
    problem = load_problem(CASES / "certificate_zero.npz")
    rng = np.random.default_rng(0)
    assert certify(problem, np.zeros(3)).ok
    for size in (1e-18, 1e-16, 4e-16, 6e-16, 1e-15):
        for _ in range(20):
            d = rng.standard_normal(3)
            assert certify(problem, size * d / np.linalg.norm(d)).ok
    refused = sum(not certify(problem, 1e-9 * rng.standard_normal(3)).ok for _ in range(20))
    assert refused == 20


@pytest.mark.parametrize("solver", [get_solver(name) for name in all_solvers()], ids=lambda solver: solver.name)
def test_one_object_serves_four_threads(solver: Solver) -> None:
    rng = np.random.default_rng(2)
    problems = [random_feasible(rng) for _ in range(24)]
    free = [Problem(problem.levels) for problem in problems]
    asked = [p if solver.refuses(p) is None else f for p, f in zip(problems, free, strict=True)]
    expected = [dataclasses.replace(solver).solve(problem) for problem in asked]
    wrong: list[str] = []

    def work(start: int) -> None:
        try:
            for i in [*range(start, len(asked)), *range(start)] * 3:
                found = solver.solve(asked[i])
                if found.status is not expected[i].status:
                    wrong.append(f"problem {i}: {found.status.name} for {expected[i].status.name}")
                elif found.x is not None:
                    np.testing.assert_allclose(found.x, expected[i].x, rtol=1e-5, atol=1e-6)
        except AssertionError as error:
            wrong.append(str(error))

    threads = [threading.Thread(target=work, args=(6 * k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong, wrong[:3]


def test_nearly_parallel_rows_are_never_wrong_and_called_solved() -> None:
    rng = np.random.default_rng(8)
    for _ in range(40):
        problem = random_feasible(rng, "parallel")
        exact = truth(problem).x
        for name in ("hierarchical_active_set", "qp_cascade", "daqp"):
            solution = get_solver(name).solve(problem)
            if solution.status is Status.SOLVED and name == "hierarchical_active_set":
                assert certify(problem, solution.x).ok
            if solution.status is Status.SOLVED:
                assert np.linalg.norm(solution.x - exact) < 0.1 * (1.0 + np.linalg.norm(exact)), name


def test_a_short_fuzz_finds_nothing() -> None:
    assert not run(SOLVERS, seed=0, count=240)
