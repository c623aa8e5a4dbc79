"""Set-based tasks: modes, the tangent cone rule, and where the method parts from the lexicographic optimum."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import Level, Problem, SettingError, Status, certify, solve
from tests.problems import boxed, independent


def test_an_inactive_task_is_left_out_and_an_active_one_is_held_at_its_bound() -> None:
    task = Level.equality([[1.0, 1.0]], [2.0])
    for top, x, held in ((3.0, [1.0, 1.0], 0), (0.5, [0.5, 1.5], 1)):
        problem = Problem([Level([[1.0, 0.0]], [-np.inf], [top]), task])
        solution = solve(problem, "set_based")
        np.testing.assert_allclose(solution.x, x, atol=1e-12)
        assert solution.held[0] == held
        assert solution.status is Status.SOLVED


def test_of_two_bounds_the_one_that_would_be_passed_is_held() -> None:
    for wanted, expected in ((3.0, 1.0), (-3.0, -1.0)):
        problem = Problem([Level.equality([[1.0, 0.0]], [wanted])], hard=Level(np.eye(2), -1.0, 1.0))
        np.testing.assert_allclose(solve(problem, "set_based").x, [expected, 0.0], atol=1e-12)


@pytest.mark.parametrize("far", [1e9, 1e20, np.inf])
def test_a_bound_far_away_does_not_widen_the_near_one(far: float) -> None:
    for sign in (1.0, -1.0):
        bounds = (0.0, far) if sign > 0.0 else (-far, 0.0)
        problem = Problem(
            [Level.equality([[1.0, 0.0]], [-0.5 * sign])], hard=Level([[1.0, 0.0]], [bounds[0]], [bounds[1]])
        )
        np.testing.assert_allclose(solve(problem, "set_based").x, [0.0, 0.0], atol=1e-12)


def test_priority_decides_between_a_task_and_a_bound_below_it() -> None:
    problem = Problem([Level.equality([[1.0, 0.0]], [2.0]), Level([[1.0, 0.0]], [-np.inf], [0.5])])
    solution = solve(problem, "set_based")
    np.testing.assert_allclose(solution.x, [2.0, 0.0], atol=1e-12)  # the bound below is active, and missed
    assert solution.levels[1].residual == pytest.approx(1.5)


@pytest.mark.parametrize("seed", range(12))
def test_a_hard_box_is_kept_and_the_answer_is_never_better_than_the_optimum(seed: int) -> None:
    problem = boxed(independent(seed, n=5, rows=(2, 2)), 0.5)
    solution = solve(problem, "set_based")
    assert solution.status in (Status.SOLVED, Status.INFEASIBLE)
    if solution.x is None:
        return
    assert np.abs(solution.x).max() <= 0.5 * (1.0 + 1e-8)
    best = solve(problem, "hierarchical_active_set").levels[0].residual
    assert solution.levels[0].residual >= best - 1e-9


def test_where_the_first_mode_that_fits_holds_too_much() -> None:
    """No multiplier tells a task to leave: among random boxes some answers are the optimum and some are not."""
    optimal = []
    for seed in range(30):
        problem = boxed(independent(seed, n=4, rows=(2, 2)), 0.4)
        x = solve(problem, "set_based").x
        optimal.append(x is not None and certify(problem, x, tolerance=1e-7).ok)
    assert 5 < sum(optimal) < 30


def test_on_equalities_it_is_null_space_priority() -> None:
    problem, zeta = independent(3, rows=(3, 2)), np.linspace(-1.0, 1.0, 7)
    np.testing.assert_allclose(
        solve(problem, "set_based", secondary=zeta).x, solve(problem, "null_space", secondary=zeta).x, rtol=1e-12
    )


def test_contradicting_hard_rows_and_too_many_modes_are_a_status() -> None:
    contradiction = Level([[1.0, 0.0], [1.0, 0.0]], [1.0, -np.inf], [np.inf, 0.0])
    solution = solve(Problem([Level.equality(np.eye(2), [0.0, 0.0])], hard=contradiction), "set_based")
    assert solution.status is Status.INFEASIBLE
    many = boxed(independent(1, n=7, rows=(3, 3)), 1e-3)
    solution = solve(many, "set_based", max_modes=3)
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.x is None
    assert "raise max_modes" in solution.message


@pytest.mark.parametrize("bad", [0, -1, 1.5, True, "1"])
def test_bad_settings(bad: object) -> None:
    with pytest.raises(SettingError, match=r"max_modes is .*; it must be an integer of at least 1\."):
        solve(independent(0), "set_based", max_modes=bad)
    with pytest.raises(SettingError, match=r"slack is .*; it must be a number in \[0, 1\)\."):
        solve(independent(0), "set_based", slack=-1.0)
