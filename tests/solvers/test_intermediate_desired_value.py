"""Intermediate desired values: the ends, the published blend of two tasks, other ways to the same answer, and no jump."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import Problem, SettingError, Status, solve
from hqp_rp.control import blend
from tests.problems import independent, over_constrained


def levels_of(problem: Problem, kept: list[int]) -> Problem:
    return Problem([problem.levels[i] for i in kept])


@pytest.mark.parametrize("seed", range(3))
def test_present_and_absent_levels(seed: int) -> None:
    problem, zeta = over_constrained(seed, rows=(3, 2, 7)), np.linspace(-1.0, 1.0, 7)
    full = solve(problem, "intermediate_desired_value", secondary=zeta).x
    np.testing.assert_allclose(full, solve(problem, "null_space", secondary=zeta).x, rtol=1e-10)
    without = solve(problem, "intermediate_desired_value", activation=[1.0, 0.0, 1.0]).x
    np.testing.assert_allclose(without, solve(levels_of(problem, [0, 2]), "null_space").x, rtol=1e-9, atol=1e-11)
    nothing = solve(problem, "intermediate_desired_value", activation=0.0, secondary=zeta).x
    np.testing.assert_allclose(nothing, zeta)


@pytest.mark.parametrize("moving", [0, 1, 2])
@pytest.mark.parametrize("h", [0.1, 0.5, 0.9])
def test_one_level_in_transition_is_the_blend_of_with_and_without(moving: int, h: float) -> None:
    problem = over_constrained(4, rows=(2, 3, 4))
    activation = [1.0] * 3
    activation[moving] = h
    x = solve(problem, "intermediate_desired_value", activation=activation).x
    np.testing.assert_allclose(x, blend(problem, "null_space", levels=activation).x, rtol=1e-8, atol=1e-10)
    kept = [i for i in range(3) if i != moving]
    expected = h * solve(problem, "null_space").x + (1.0 - h) * solve(levels_of(problem, kept), "null_space").x
    np.testing.assert_allclose(x, expected, rtol=1e-8, atol=1e-10)


def test_two_levels_in_transition_by_the_formula() -> None:
    problem, h = over_constrained(6, rows=(2, 3)), (0.3, 0.8)
    (A1, b1), (A2, b2) = ((level.A, level.lower) for level in problem.levels)
    only_1, only_2 = h[0] * np.linalg.pinv(A1) @ b1, h[1] * np.linalg.pinv(A2) @ b2
    c1, c2 = h[0] * b1 + (1 - h[0]) * A1 @ only_2, h[1] * b2 + (1 - h[1]) * A2 @ only_1
    x1 = np.linalg.pinv(A1) @ c1
    N = np.eye(7) - np.linalg.pinv(A1) @ A1
    expected = x1 + np.linalg.pinv(A2 @ N) @ (c2 - A2 @ x1)
    x = solve(problem, "intermediate_desired_value", activation=h).x
    np.testing.assert_allclose(x, expected, rtol=1e-9, atol=1e-11)


def test_a_level_comes_without_a_jump() -> None:
    problem = over_constrained(2, rows=(3, 3, 7))
    hard = np.linalg.norm(solve(problem, "null_space").x - solve(levels_of(problem, [1, 2]), "null_space").x)
    path = np.linspace(0.0, 1.0, 401)
    answers = [solve(problem, "intermediate_desired_value", activation=(h, 1.0, 1.0 - h)).x for h in path]
    assert np.linalg.norm(np.diff(answers, axis=0), axis=1).max() < 0.05 * hard


def test_refusals() -> None:
    problem = independent(0, n=20, rows=(1,) * 12)
    solution = solve(problem, "intermediate_desired_value", activation=0.5)
    assert solution.status is Status.REFUSED
    assert "12 levels are in transition" in solution.message
    solution = solve(problem, "intermediate_desired_value", activation=(1.0, 1.0))
    assert solution.message == "activation is for 2 levels and the problem has 12."


@pytest.mark.parametrize("bad", [-0.1, 1.1, float("nan"), True, "1", (0.5, 2.0)])
def test_bad_activation(bad: object) -> None:
    with pytest.raises(SettingError, match=r"every degree must be a number in \[0, 1\]"):
        solve(independent(0), "intermediate_desired_value", activation=bad)


@pytest.mark.parametrize("bad", [np.array(0.5), ["a"], [None], [[0.5]]])
def test_what_is_no_list_of_numbers_is_refused(bad: object) -> None:
    with pytest.raises(SettingError, match="a number in \\[0, 1\\], or one for each level"):
        solve(independent(0), "intermediate_desired_value", activation=bad)
