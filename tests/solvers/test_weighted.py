"""The soft-weight baseline: its formula, its place beside the lexicographic answer, its hard rows."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from hqp_rp import Level, Problem, SettingError, Status, get_solver, solve
from hqp_rp.solvers.weighted import Weighted
from tests.problems import boxed, dependent, independent, over_constrained, scaled


def normal_equations(problem: Problem, weights: list[float], damping: float, secondary: np.ndarray) -> np.ndarray:
    n = problem.n
    H = damping * np.eye(n)
    g = damping * secondary
    for level, w in zip(problem.levels, weights, strict=True):
        H += w * level.A.T @ level.A
        g += w * level.A.T @ level.lower
    return np.linalg.solve(H, g)


@pytest.mark.parametrize("seed", range(5))
def test_the_formula(seed: int) -> None:
    problem = over_constrained(seed)
    secondary = np.random.default_rng(seed).standard_normal(7)
    solution = solve(problem, "weighted", ratio=1e-2, damping=1e-3, secondary=secondary)
    assert solution.status is Status.SOLVED
    expected = normal_equations(problem, [1, 1e-2, 1e-4], 1e-3, secondary)
    np.testing.assert_allclose(solution.x, expected, rtol=1e-8)
    again = solve(problem, "weighted", weights=(1.0, 1e-2, 1e-4), damping=1e-3, secondary=secondary)
    np.testing.assert_array_equal(again.x, solution.x)


def test_without_damping_it_is_the_nearest_least_squares_answer() -> None:
    problem = independent(0, rows=(2, 2))
    secondary = np.arange(7.0)
    x = solve(problem, "weighted", damping=0, secondary=secondary).x
    A, b = problem.matrix, problem.lower
    np.testing.assert_allclose(x, secondary + np.linalg.pinv(A) @ (b - A @ secondary), atol=1e-12)


def test_conflicting_levels_trade_where_a_cascade_does_not() -> None:
    problem = dependent(0)
    soft = solve(problem, "weighted").levels[0].residual
    strict = solve(problem, "qp_cascade").levels[0].residual
    assert strict < 1e-9 < 1e-4 < soft
    assert not get_solver("weighted").is_lexicographic(problem)


def test_the_trade_vanishes_with_the_ratio() -> None:
    problem = dependent(0)
    lost = [solve(problem, "weighted", ratio=r).levels[0].residual for r in (1e-2, 1e-4, 1e-6)]
    assert lost[0] > 10 * lost[1] > 100 * lost[2]


@pytest.mark.parametrize("backend", ["proxqp", "osqp", "daqp", "quadprog"])
def test_a_hard_box_against_bounded_least_squares(backend: str) -> None:
    for seed in range(5):
        problem = boxed(over_constrained(seed), 0.3)
        solution = solve(problem, "weighted", backend=backend, damping=1e-6)
        assert solution.status is Status.SOLVED, solution.message
        costs = np.sqrt(np.repeat([1.0, 1e-4, 1e-8], [6, 3, 7]))
        A = np.vstack([costs[:, None] * problem.matrix, 1e-3 * np.eye(7)])
        b = np.concatenate([costs * problem.lower, np.zeros(7)])
        expected = lsq_linear(A, b, (-0.3, 0.3), method="bvls", tol=1e-14).x
        np.testing.assert_allclose(solution.x, expected, atol=1e-6)
        assert np.abs(solution.x).max() <= 0.3 + 1e-9


def test_two_sided_rows_cost_only_their_violation() -> None:
    # x0 in [1, 2] costs nothing at 1.5; x1 in [1, 2] against x1 = 0: (1 - x1)^2 + w x1^2.
    band = Level(np.eye(2), 1.0, 2.0)
    point = Level.equality(np.eye(2), [1.5, 0.0])
    x = solve(Problem([band, point]), "weighted", ratio=0.25, damping=0.0).x
    np.testing.assert_allclose(x, [1.5, 0.8], atol=1e-8)


def test_hard_rows_in_conflict() -> None:
    hard = Level(np.array([[1.0, 0.0], [1.0, 0.0]]), [1.0, -np.inf], [np.inf, 0.0])
    solution = solve(Problem([Level.equality(np.eye(2), [3.0, 4.0])], hard), "weighted")
    assert solution.status is Status.INFEASIBLE
    assert solution.x is None
    assert "Hard rows 0, 1 contradict each other" in solution.message


def test_extreme_scales_break_nothing() -> None:
    for factors in ((1e-150, 1e150), (1e150, 1e-150), (1e-150, 1e-150)):
        solution = solve(scaled(independent(0), factors), "weighted")
        assert solution.x is not None
        assert np.isfinite(solution.x).all()


def test_settings_out_of_range() -> None:
    with pytest.raises(SettingError, match="ratio is 0"):
        Weighted(ratio=0)
    with pytest.raises(SettingError, match="damping is -1"):
        Weighted(damping=-1)
    with pytest.raises(SettingError, match=r"weights\[1\] is -2"):
        Weighted(weights=(1.0, -2.0))
    with pytest.raises(SettingError, match="installed:"):
        Weighted(backend="none")
    solution = solve(independent(0), "weighted", weights=(1.0,))
    assert solution.status is Status.REFUSED
    assert "1 weights for 2 levels" in solution.message


def test_copies_carry_settings_and_nothing_else() -> None:
    solver = Weighted(ratio=0.5)
    solver.solve(boxed(independent(0), 1.0))
    copy = pickle.loads(pickle.dumps(solver))
    assert copy == solver
    assert repr(copy) == repr(solver)
