"""Chiaverini's singularity-robust priority (13) against exact arithmetic."""

import numpy as np
import pytest

from hqp_rp import ConstantDamping, solve, truth
from tests import reference
from tests.problems import EQUALITY_CASES, independent, near_singular, scaled

EPS = np.finfo(float).eps


@pytest.mark.parametrize("name", [name for name in EQUALITY_CASES if "scaled" not in name])
def test_it_is_13_on_n_levels(name):
    for seed in range(3):
        problem = EQUALITY_CASES[name](seed)
        x, expected = solve(problem, "singularity_robust").x, reference.singularity_robust(problem)
        assert np.abs(x - expected).max() < 1e4 * EPS * reference.condition(problem) * np.abs(expected).max()


@pytest.mark.parametrize("exponent", range(0, 16, 3))
def test_it_stays_bounded_and_keeps_level_1_at_an_algorithmic_singularity(exponent):
    problem = near_singular(10.0**-exponent, 1, rows=(3, 3, 2))
    solution = solve(problem, "singularity_robust")
    A1 = problem.levels[0].A
    assert solution.levels[0].residual <= 1e2 * EPS * np.linalg.norm(A1, 2) * np.linalg.norm(solution.x)
    own = sum(np.linalg.norm(np.linalg.pinv(level.A) @ level.lower) for level in problem.levels)
    assert np.linalg.norm(solution.x) <= own * (1 + 1e-12)


def test_it_is_not_the_optimum_where_all_levels_could_be_met():
    problem = independent(0)
    solution = solve(problem, "singularity_robust")
    assert np.linalg.norm(problem.levels[1].A @ truth(problem).x - problem.levels[1].lower) < 1e-12
    assert solution.levels[1].residual > 0.1


def test_the_free_vector_is_projected():
    problem, zeta = independent(1, rows=(2, 3)), np.arange(7.0)
    with_free, without = (solve(problem, "singularity_robust", secondary=z).x for z in (zeta, None))
    projector = np.eye(7) - np.linalg.pinv(problem.matrix) @ problem.matrix
    np.testing.assert_allclose(with_free - without, projector @ zeta, atol=1e-12)


def test_damping_acts_on_each_levels_own_inverse():
    problem, eta = independent(2), 0.5
    (A1, A2), (b1, b2) = zip(*((level.A, level.lower) for level in problem.levels), strict=True)

    def damped(A, b):
        return np.linalg.solve(A.T @ A + eta**2 * np.eye(7), A.T @ b)

    expected = damped(A1, b1) + (np.eye(7) - np.linalg.pinv(A1) @ A1) @ damped(A2, b2)
    x = solve(problem, "singularity_robust", damping=ConstantDamping(eta)).x
    np.testing.assert_allclose(x, expected, atol=1e-12)


def test_the_scale_of_a_level_plays_no_part():
    problem = independent(3)
    x = solve(scaled(problem, (2.0**498, 2.0**-498)), "singularity_robust").x
    np.testing.assert_array_equal(x, solve(problem, "singularity_robust").x)
