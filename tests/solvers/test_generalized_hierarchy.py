"""Generalized hierarchical control: strict priority and none at its ends, and a swap of priorities without a jump between."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import Level, Problem, SettingError, Status, solve
from tests.problems import independent, over_constrained


def swapped(problem: Problem) -> Problem:
    return Problem([problem.levels[1], problem.levels[0]])


@pytest.mark.parametrize("seed", range(4))
def test_strict_priorities_are_the_singularity_robust_form(seed: int) -> None:
    problem = over_constrained(seed, rows=(3, 2, 7))
    zeta = np.linspace(-1.0, 1.0, 7)
    for free in (None, zeta):
        np.testing.assert_allclose(
            solve(problem, "generalized_hierarchy", secondary=free).x,
            solve(problem, "singularity_robust", secondary=free).x,
            rtol=1e-9,
            atol=1e-11,
        )


def test_no_priorities_are_the_sum_and_a_level_that_is_gone_does_nothing() -> None:
    problem = independent(2, rows=(2, 3))
    own = [np.linalg.pinv(level.A) @ level.lower for level in problem.levels]
    np.testing.assert_allclose(solve(problem, "generalized_hierarchy", alpha=0.0).x, sum(own), rtol=1e-10)
    gone = solve(problem, "generalized_hierarchy", alpha=[[1.0, 0.0], [0.0, 0.0]]).x
    np.testing.assert_allclose(gone, own[1], rtol=1e-10, atol=1e-13)


def test_half_a_priority_is_half_a_projection() -> None:
    problem = independent(2, rows=(2, 3))
    (A1, b1), (A2, b2) = ((level.A, level.lower) for level in problem.levels)
    N = np.eye(7) - 0.5 * np.linalg.pinv(A1) @ A1
    expected = np.linalg.pinv(A1) @ b1 + N @ np.linalg.pinv(A2) @ b2
    np.testing.assert_allclose(solve(problem, "generalized_hierarchy", alpha=0.5).x, expected, rtol=1e-10)


def test_a_swap_has_no_jump_where_a_hard_one_has() -> None:
    problem = over_constrained(1, rows=(4, 5))
    hard = np.linalg.norm(solve(problem, "null_space").x - solve(swapped(problem), "null_space").x)
    answers = [
        solve(problem, "generalized_hierarchy", alpha=[[0.0, s], [1.0 - s, 0.0]]).x for s in np.linspace(0.0, 1.0, 501)
    ]
    jumps = np.linalg.norm(np.diff(answers, axis=0), axis=1)
    assert jumps.max() < 0.01 * hard
    np.testing.assert_allclose(answers[0], solve(problem, "singularity_robust").x, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(answers[-1], solve(swapped(problem), "singularity_robust").x, rtol=1e-9, atol=1e-11)


def test_three_levels_change_places_without_a_jump() -> None:
    problem = over_constrained(5, rows=(2, 3, 4))
    path = np.linspace(0.0, 1.0, 801)
    answers = []
    for s in path:  # the priorities of 1 and 2 over 3 cross at s = 1/2
        alpha = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.2 + 0.6 * s, 0.8 - 0.6 * s, 0.0]]
        answers.append(solve(problem, "generalized_hierarchy", alpha=alpha).x)
    jumps = np.linalg.norm(np.diff(answers, axis=0), axis=1)
    assert jumps.max() < 5.0 * np.median(jumps)


def test_a_number_of_levels_that_alpha_is_not_for_is_refused() -> None:
    solution = solve(independent(0, rows=(2, 2, 2)), "generalized_hierarchy", alpha=[[0.0, 0.0], [1.0, 0.0]])
    assert solution.status is Status.REFUSED
    assert solution.message == "alpha is for 2 levels and the problem has 3."


@pytest.mark.parametrize(
    "bad", [-0.1, 1.1, float("nan"), True, "1", [[0.0, 2.0], [0.0, 0.0]], [[0.0, True], [0.0, 0.0]]]
)
def test_bad_priorities(bad: object) -> None:
    if bad == [[0.0, True], [0.0, 0.0]]:  # a list of rows is read as numbers
        solve(independent(0), "generalized_hierarchy", alpha=bad)
        return
    with pytest.raises(SettingError, match=r"every priority must be a number in \[0, 1\]"):
        solve(independent(0), "generalized_hierarchy", alpha=bad)


@pytest.mark.parametrize("bad", [[0.5, 0.5], (0.5, 0.5), np.array(0.5), [["a", 0.0], [0.0, 0.0]], [[None]]])
def test_what_is_no_table_of_numbers_is_refused(bad: object) -> None:
    with pytest.raises(SettingError, match="a number, or p rows of p numbers"):
        solve(independent(0), "generalized_hierarchy", alpha=bad)


def test_rows_of_another_length_are_refused() -> None:
    with pytest.raises(SettingError, match="it must be p rows of p numbers"):
        solve(Problem([Level.equality(np.eye(2), [1.0, 1.0])]), "generalized_hierarchy", alpha=[[0.0, 1.0]])
