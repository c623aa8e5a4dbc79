"""Saturation in the null space: answers known by hand, the cascade where nothing saturates, bounds that always hold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import Level, Problem, SettingError, Status, solve, truth
from hqp_rp.solvers.saturation_null_space import SaturationNullSpace, ScaledSolution
from tests.hard_problems import KINDS, box_problem, hard_violation, polytope_problem
from tests.problems import boxed, equality_cases, independent, over_constrained, two_sided

SNS = SaturationNullSpace()
INF = np.inf


def run(problem: Problem, secondary: np.ndarray | None = None) -> ScaledSolution:
    solution = SNS.solve(problem, secondary)
    assert solution.status is Status.SOLVED, solution.message
    assert isinstance(solution, ScaledSolution)
    return solution


def box(n: int, bound: float) -> Level:
    return Level(np.eye(n), -bound, bound)


def test_one_task_known_by_hand() -> None:
    # Least norm (1.2, 0.6) breaks |x0| <= 1: x0 saturates and x1 takes over.
    solution = run(Problem([Level.equality([[2.0, 1.0]], [3.0])], box(2, 1.0)))
    np.testing.assert_allclose(solution.x, [1.0, 1.0])
    np.testing.assert_array_equal(solution.scales, [1.0])
    assert solution.iterations == 1
    # 6 is beyond reach: both saturate and the task runs at half its size.
    solution = run(Problem([Level.equality([[2.0, 1.0]], [6.0])], box(2, 1.0)))
    np.testing.assert_allclose(solution.scales, [0.5])
    np.testing.assert_allclose(solution.x, [1.0, 1.0])


def test_scaling_keeps_the_direction_of_the_task() -> None:
    J, b = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([2.0, 1.0])
    solution = run(Problem([Level.equality(J, b)], box(3, 1.0)))
    np.testing.assert_allclose(J @ solution.x, 0.5 * b)
    np.testing.assert_allclose(solution.scales, [0.5])


def test_a_second_level_uses_what_the_first_leaves() -> None:
    levels = [Level.equality([[1.0, 1.0, 0.0]], [1.0]), Level.equality([[1.0, 0.0, 0.0]], [3.0])]
    solution = run(Problem(levels, box(3, 1.0)))
    np.testing.assert_allclose(solution.x, [1.0, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(solution.scales, [1.0, 1.0 / 3.0])


CASES = equality_cases(2)


@pytest.mark.parametrize(("name", "problem"), CASES, ids=[name for name, _ in CASES])
def test_without_saturation_it_is_the_null_space_cascade(name: str, problem: Problem) -> None:
    zeta = np.linspace(-1.0, 2.0, problem.n)
    expected = solve(problem, "null_space", secondary=zeta).x
    wide = Problem(problem.levels, box(problem.n, 10.0 * np.abs(expected).max() + 10.0))
    for case in (problem, wide):
        solution = run(case, zeta)
        assert np.linalg.norm(solution.x - expected) <= 1e-9 * (1.0 + np.linalg.norm(expected))
        np.testing.assert_array_equal(solution.scales, 1.0)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(KINDS))
def test_bounds_hold_or_are_named_infeasible(seed: int, kind: str) -> None:
    problem = box_problem(seed, kind)
    solution = SNS.solve(problem)
    if kind == "infeasible":
        assert solution.status is Status.INFEASIBLE
        assert solution.x is None
        return
    assert solution.status is Status.SOLVED, solution.message
    assert hard_violation(problem, solution.x) <= 1e-15
    assert ((solution.scales >= 0.0) & (solution.scales <= 1.0)).all()


@pytest.mark.parametrize("seed", range(30))
def test_levels_keep_their_scale_and_their_order(seed: int) -> None:
    problem = boxed(independent(seed, rows=(2, 2, 2)), 0.4)
    solution = run(problem)
    for level, s in zip(problem.levels, solution.scales, strict=True):
        if s > 0.0:
            np.testing.assert_allclose(level.A @ solution.x, s * level.lower, atol=1e-10)
    first = problem.levels[0]
    alone = run(Problem([first], problem.hard))
    np.testing.assert_allclose(first.A @ solution.x, first.A @ alone.x, atol=1e-10)
    # The exact optimum of the first level is never worse than its saturated answer.
    best = truth(problem).residuals[0]
    assert best <= np.linalg.norm(first.A @ solution.x - first.lower) + 1e-12


def test_it_saturates_often_enough_to_matter() -> None:
    scaled = saturated = 0
    for seed in range(30):
        solution = run(boxed(independent(seed, rows=(3, 3)), 1.5))
        scaled += bool((solution.scales < 1.0).any())
        saturated += solution.iterations > 0
    assert 0 < scaled < saturated < 30


def test_a_box_without_zero_is_reached_from_its_nearest_point() -> None:
    hard = Level(np.eye(3), [0.5, -INF, 0.2], [1.0, INF, 0.2])
    solution = run(Problem([Level.equality([[0.0, 1.0, 1.0]], [1.0])], hard))
    np.testing.assert_allclose(solution.x, [0.5, 0.8, 0.2])


def test_what_it_refuses_and_what_it_names() -> None:
    levels = independent(0, n=3, rows=(1,)).levels
    general = SNS.solve(polytope_problem(3, "wide"))
    assert general.status is Status.REFUSED
    assert "single unknowns only" in general.message
    assert "two-sided" in SNS.refuses(two_sided(0))
    rows = Level([[2, 0, 0], [0, 1, 0], [-1, 0, 0]], [2, 0, 0.5], [4, 1, 3])
    solution = SNS.solve(Problem(levels, rows))
    assert solution.status is Status.INFEASIBLE
    assert "Hard rows 0, 2 contradict" in solution.message
    zero = SNS.solve(Problem(levels, Level([[0, 0, 0]], 1, 2)))
    assert zero.status is Status.INFEASIBLE
    assert "Hard row 0 is a row of zeros" in zero.message
    with pytest.raises(SettingError, match="rank_tolerance is 2"):
        SaturationNullSpace(rank_tolerance=2.0)


def test_it_is_lexicographic_only_without_a_box() -> None:
    problem = over_constrained(0)
    assert SNS.is_lexicographic(problem)
    assert not SNS.is_lexicographic(boxed(problem, 1.0))
