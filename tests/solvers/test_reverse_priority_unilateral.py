"""Reverse priority with unilateral rows: the published step on active rows, hard rows that hold, no jump as rows come."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import (
    ConstantDamping,
    Level,
    Problem,
    SettingError,
    Solution,
    Status,
    VariableDamping,
    certify,
    solve,
    truth,
)
from hqp_rp.solvers.reverse_priority_unilateral import ReversePriorityUnilateral
from tests.hard_problems import KINDS, box_problem, hard_violation, polytope_problem
from tests.problems import boxed, equality_cases, independent, over_constrained, two_sided

RPU = ReversePriorityUnilateral()


def run(problem: Problem, solver: ReversePriorityUnilateral = RPU) -> Solution:
    solution = solver.solve(problem)
    assert solution.status is Status.SOLVED, solution.message
    return solution


CASES = equality_cases(2)


@pytest.mark.parametrize(("name", "problem"), CASES, ids=[name for name, _ in CASES])
def test_rows_that_are_not_reached_take_no_part(name: str, problem: Problem) -> None:
    zeta = np.linspace(-1.0, 2.0, problem.n)
    expected = solve(problem, "reverse_priority", secondary=zeta).x
    far = 10.0 * np.abs(expected).max() + 10.0
    for case in (problem, boxed(problem, far)):
        solution = RPU.solve(case, zeta)
        assert solution.status is Status.SOLVED
        assert np.linalg.norm(solution.x - expected) <= 1e-12 * (1.0 + np.linalg.norm(expected))


@pytest.mark.parametrize("damping", [None, ConstantDamping(0.3)])
@pytest.mark.parametrize("rows", [(3, 3), (3, 3, 7), (2, 1)])
def test_it_is_the_published_step_on_the_active_rows(rows: tuple[int, ...], damping) -> None:
    damped = {} if damping is None else {"damping": damping}
    taken = 0
    for seed in range(8):
        problem = boxed(independent(seed, rows=rows), 0.5)
        solution = run(problem, ReversePriorityUnilateral(**damped))
        held = solution.active[:7]
        active = held != 0
        taken += int(active.sum())
        top = Level.equality(np.eye(7)[active], 0.5 * held[active])
        expected = solve(Problem([top, *problem.levels]), "reverse_priority", **damped)
        np.testing.assert_allclose(solution.x, expected.x, atol=1e-9)
    assert taken > 8


@pytest.mark.parametrize("seed", range(10))
def test_the_levels_are_disturbed_least(seed: int) -> None:
    problem = boxed(over_constrained(seed, rows=(2, 2, 4)), 0.4)
    y = solve(Problem(problem.levels), "reverse_priority").x
    nearest = Problem([Level.equality(problem.matrix, problem.matrix @ y)], problem.hard)
    np.testing.assert_allclose(run(problem).x, truth(nearest, y).x, atol=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_one_level_is_the_lexicographic_optimum(seed: int) -> None:
    for rows in ((3,), (9,)):
        problem = boxed(independent(seed, rows=rows), 0.2)
        assert RPU.is_lexicographic(problem)
        zeta = np.linspace(-0.1, 0.1, 7)
        assert certify(problem, RPU.solve(problem, zeta).x, zeta).ok
    assert not RPU.is_lexicographic(boxed(independent(seed), 0.2))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(KINDS), st.sampled_from([box_problem, polytope_problem]))
def test_hard_rows_hold_or_it_is_not_called_solved(seed: int, kind: str, make) -> None:
    problem = make(seed, kind)
    solution = RPU.solve(problem)
    if kind == "infeasible":
        assert solution.status is Status.INFEASIBLE
        assert solution.x is None
        assert "contradict each other" in solution.message
        return
    assert solution.status is not Status.INFEASIBLE, solution.message
    if solution.status is Status.SOLVED:
        assert hard_violation(problem, solution.x) <= 1e-9


@pytest.mark.parametrize(("rows", "damping"), [((3, 3, 7), None), ((2, 2), ConstantDamping(0.3))])
def test_rows_enter_and_leave_without_a_jump(rows: tuple[int, ...], damping) -> None:
    solver = ReversePriorityUnilateral() if damping is None else ReversePriorityUnilateral(damping=damping)
    problem = independent(3, rows=rows)
    bounds = np.linspace(3.0, 0.02, 600)
    answers = [run(boxed(problem, bound), solver) for bound in bounds]
    active = np.array([np.count_nonzero(answer.active[: problem.n]) for answer in answers])
    assert active.max() >= 5
    assert active.min() == 0
    jumps = np.array([np.abs(b.x - a.x).max() for a, b in itertools.pairwise(answers)])
    # Continuous: no step of x is out of proportion to the step of the bound, also not where the active set changes.
    slope = jumps / (bounds[0] - bounds[1])
    assert slope.max() <= 50.0


def test_conflicts_are_named_and_limits_are_honest() -> None:
    hard = Level([[1, 0], [0, 1], [1, 0]], [1, -5, -np.inf], [np.inf, 5, 0])
    solution = RPU.solve(Problem([Level.equality(np.eye(2), [3.0, 4.0])], hard))
    assert solution.status is Status.INFEASIBLE
    assert "Hard rows 0, 2 contradict" in solution.message
    limited = ReversePriorityUnilateral(max_iterations=1).solve(boxed(over_constrained(0), 0.1))
    assert limited.status is Status.ITERATION_LIMIT
    assert limited.x is None


def test_what_it_refuses_and_its_settings() -> None:
    assert RPU.solve(two_sided(0)).status is Status.REFUSED
    with pytest.raises(SettingError, match=r"NoDamping\(\) or ConstantDamping"):
        ReversePriorityUnilateral(damping=VariableDamping(0.1, 0.1))
    with pytest.raises(SettingError, match="max_iterations is 0"):
        ReversePriorityUnilateral(max_iterations=0)
