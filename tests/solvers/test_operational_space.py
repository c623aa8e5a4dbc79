"""Operational-space control: the null-space answer in the metric M, and what its singularity handling does."""

import numpy as np
import pytest

from hqp_rp import ConstantDamping, Level, Problem, SettingError, UnknownNameError, certify, solve, truth
from hqp_rp.solvers.operational_space import OperationalSpace, equation_khatib_sentis


def mechanism(seed, rows=(3, 2, 4), n=7):
    rng = np.random.default_rng(seed)
    Q = rng.standard_normal((n, n))
    J = [rng.standard_normal((m, n)) for m in rows]
    b = [rng.standard_normal(m) for m in rows]
    return J, b, Q @ Q.T + np.eye(n)


def problem_of(J, b, M):
    return Problem([Level.equality(A, r) for A, r in zip(J, b, strict=True)], metric=M)


@pytest.mark.parametrize("seed", range(5))
def test_the_torques_of_the_recursion_give_the_lexicographic_acceleration(seed):
    J, b, M = mechanism(seed)
    problem = problem_of(J, b, M)
    x = np.linalg.solve(M, equation_khatib_sentis(J, b, M))
    np.testing.assert_allclose(x, truth(problem).x, atol=1e-9)
    for singularity in ("as damping says", "selective", "blend"):
        found = solve(problem, "operational_space", singularity=singularity, low=1e-6, high=1e-5)
        np.testing.assert_allclose(found.x, x, atol=1e-9)
        assert certify(problem, found.x).ok
    np.testing.assert_array_equal(solve(problem, "operational_space").x, solve(problem, "null_space").x)


def singular(sigma, seed=0):
    """Level 1 with singular values 1, 0.5 and sigma in the metric; level 2 asks for what level 1 hardly can."""
    rng = np.random.default_rng(seed)
    _, _, M = mechanism(seed)
    R = np.linalg.cholesky(M).T
    U, V = np.linalg.qr(rng.standard_normal((3, 3)))[0], np.linalg.qr(rng.standard_normal((7, 7)))[0]
    J = (U * np.array([1.0, 0.5, sigma])) @ V[:, :3].T @ R
    return (
        U,
        V[:, :3].T @ R,
        Problem([Level.equality(J, rng.standard_normal(3)), Level.equality(V[:, 2:3].T @ R, [1.0])], metric=M),
    )


@pytest.mark.parametrize("sigma", [1e-1, 1e-2, 1e-4, 1e-8, 0.0])
def test_selective_damping_is_bounded_and_exact_in_the_other_directions(sigma):
    U, rows, problem = singular(sigma)
    x = solve(problem, "operational_space", singularity="selective", low=0.01, high=0.2).x
    missing = U.T @ (problem.levels[0].A @ x - problem.levels[0].lower)
    np.testing.assert_allclose(missing[:2], 0.0, atol=1e-9)
    assert np.linalg.norm(rows @ x) < 20.0  # 1 / (2 high) of the singular direction at most
    plain = solve(problem, "operational_space").x
    if 0.0 < sigma <= 1e-4:
        assert np.linalg.norm(plain) > 1e2


def test_blending_leaves_the_singular_direction_to_the_level_below():
    _, rows, problem = singular(1e-4)
    x = solve(problem, "operational_space", singularity="blend", low=0.01, high=0.2).x
    assert rows[2] @ x == pytest.approx(1.0)
    kept = solve(problem, "operational_space", singularity="selective", low=0.01, high=0.2).x
    assert abs(rows[2] @ kept - 1.0) > 0.5


def test_without_a_metric_it_is_null_space_priority():
    J, b, _ = mechanism(1)
    problem = Problem([Level.equality(A, r) for A, r in zip(J, b, strict=True)])
    np.testing.assert_array_equal(solve(problem, "operational_space").x, solve(problem, "null_space").x)


def test_it_says_what_is_lexicographic():
    J, b, M = mechanism(0)
    problem = problem_of(J, b, M)
    assert OperationalSpace().is_lexicographic(problem)
    assert not OperationalSpace(singularity="blend").is_lexicographic(problem)
    assert not OperationalSpace(damping=ConstantDamping(0.1)).is_lexicographic(problem)


def test_settings_are_checked():
    with pytest.raises(UnknownNameError, match="singularity of operational_space"):
        OperationalSpace(singularity="none")
    with pytest.raises(SettingError, match="0 < low < high < 1"):
        OperationalSpace(low=0.2, high=0.1)
    with pytest.raises(SettingError, match="brings its own damping"):
        OperationalSpace(singularity="selective", damping=ConstantDamping(0.1))
