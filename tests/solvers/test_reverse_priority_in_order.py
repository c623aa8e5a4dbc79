"""Reverse priority in order: lexicographic on any number of levels, and bounded with level 1 exact once it is damped."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import (
    ConstantDamping,
    Level,
    NumericalFiltering,
    Problem,
    SettingError,
    VariableDamping,
    certify,
    get_solver,
    solve,
    truth,
)
from hqp_rp.solvers.reverse_priority_in_order import in_order
from tests.problems import independent, over_constrained

NAME = "reverse_priority_in_order"
VARIABLE = VariableDamping(0.1, 0.1)


def regular_levels(eps: float, seed: int, rows: tuple[int, ...] = (3, 3, 7)) -> Problem:
    """Levels that are regular one by one; level 2 is at distance eps from an algorithmic singularity with level 1."""
    rng = np.random.default_rng(seed)
    matrices = [np.linalg.qr(rng.normal(size=(7, m)))[0].T for m in rows]
    above = matrices[0].T @ matrices[0]
    leaning = above @ matrices[1][0]
    row = leaning / np.linalg.norm(leaning) + eps * (matrices[1][0] - leaning)
    matrices[1] = np.vstack([row, matrices[1][1:]])
    return Problem([Level.equality(A, rng.normal(size=len(A))) for A in matrices])


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.lists(st.integers(1, 4), min_size=1, max_size=5))
def test_undamped_it_is_the_lexicographic_optimum(seed: int, rows: list[int]) -> None:
    problem = independent(seed, rows=rows)
    x = solve(problem, NAME).x
    assert certify(problem, x).ok
    np.testing.assert_allclose(x, truth(problem).x, rtol=1e-7, atol=1e-7 * (1.0 + np.abs(x).max()))


@pytest.mark.parametrize("seed", range(5))
def test_with_a_free_vector_and_conflicting_levels_too(seed: int) -> None:
    problem = over_constrained(seed, rows=(3, 5, 7))
    free = np.random.default_rng(seed).normal(size=7)
    ours, known = (get_solver(name).solve(problem, free).x for name in (NAME, "null_space"))
    np.testing.assert_allclose(ours, known, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("seed", range(5))
def test_the_equation_in_matrices(seed: int) -> None:
    problem = independent(seed, rows=(2, 3, 2))
    J, b = [level.A for level in problem.levels], [level.lower for level in problem.levels]
    np.testing.assert_allclose(in_order(J, b, np.zeros(7)), solve(problem, NAME).x, rtol=1e-8, atol=1e-10)


def test_on_two_levels_it_is_the_papers_recursion() -> None:
    problem = independent(2, rows=(3, 3))
    np.testing.assert_allclose(solve(problem, NAME).x, solve(problem, "reverse_priority").x, rtol=1e-9, atol=1e-12)


def test_on_three_levels_the_papers_recursion_misses_level_two_and_this_one_does_not() -> None:
    problem = independent(1, rows=(3, 3, 7))
    missed = [solve(problem, name).levels[1].residual for name in (NAME, "reverse_priority")]
    assert missed[0] < 1e-12
    assert missed[1] > 0.1


@pytest.mark.parametrize("damping", [VARIABLE, ConstantDamping(0.1)])
@pytest.mark.parametrize("eps", [1e-1, 1e-2, 1e-4, 1e-8, 1e-12, 0.0])
def test_level_one_stays_exact_and_the_answer_bounded_through_a_singularity(eps: float, damping: object) -> None:
    for seed in range(10):
        problem = regular_levels(eps, seed)
        damped = solve(problem, NAME, damping=damping)
        assert damped.levels[0].residual < 1e-12
        # Every factor of the bound: ||J_k|| <= 2, inverses <= 1 / delta = 1 / (2 eta) = 10, or 5 for a constant 0.1.
        assert np.linalg.norm(damped.x) < 100.0
        if 1e-10 < eps < 1e-3:  # nearer, the rank test takes the rows for dependent
            assert np.linalg.norm(solve(problem, NAME).x) > 100.0


def test_away_from_singularities_the_threshold_leaves_it_lexicographic() -> None:
    agreed = 0
    for seed in range(80):
        problem = regular_levels(0.9, seed, rows=(2, 2, 3))
        stacked = np.vstack([level.A for level in problem.levels])
        if np.linalg.svd(stacked)[1].min() < 0.2:
            continue
        damped = solve(problem, NAME, damping=VARIABLE).x
        np.testing.assert_allclose(damped, truth(problem).x, rtol=1e-9, atol=1e-9)
        agreed += 1
    assert agreed >= 8


def test_it_is_continuous_through_the_singularity() -> None:
    path = np.linspace(-0.3, 0.3, 3001)
    x = np.array([solve(regular_levels(eps, 4), NAME, damping=VARIABLE).x for eps in path])
    steps = np.linalg.norm(np.diff(x, axis=0), axis=1)
    coarse = np.linalg.norm(np.diff(x[::10], axis=0), axis=1)
    assert steps.max() < 0.2 * coarse.max()  # a jump would be as large at a tenth of the step


def test_no_method_is_lexicographic_everywhere_and_bounded() -> None:
    for eps in (1.0, 1e-2, 1e-4, 1e-8):
        problem = Problem([Level.equality([[1.0, 0.0]], [0.0]), Level.equality([[1.0, eps]], [1.0])])
        exact = truth(problem).x
        np.testing.assert_allclose(exact, [0.0, 1.0 / eps], rtol=1e-12)
        bounded = solve(problem, NAME, damping=VARIABLE)
        assert np.linalg.norm(bounded.x) < 11.0
        assert certify(problem, bounded.x).ok == (eps >= 0.1)


def test_filtering_is_refused() -> None:
    with pytest.raises(SettingError, match="all but one direction"):
        get_solver(NAME, damping=NumericalFiltering(0.1, 0.1))
