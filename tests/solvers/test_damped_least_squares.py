"""Damped least squares (6)-(7), (14)-(19) against its normal equations and its singular values."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import ConstantDamping, Level, NoDamping, Problem, SettingError, Status, Truncation, VariableDamping, solve
from tests.problems import independent, over_constrained


def one_level(A, b):
    return Problem([Level.equality(A, b)])


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), m=st.integers(1, 9), n=st.integers(1, 9), eta=st.floats(1e-2, 1e2))
def test_it_solves_the_normal_equations_of_14(seed, m, n, eta):
    rng = np.random.default_rng(seed)
    J, b, zeta = rng.standard_normal((m, n)), rng.standard_normal(m), rng.standard_normal(n)
    x = solve(one_level(J, b), "damped_least_squares", damping=ConstantDamping(eta), secondary=zeta).x
    expected = np.linalg.solve(J.T @ J + eta**2 * np.eye(n), J.T @ b + eta**2 * zeta)
    np.testing.assert_allclose(x, expected, rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("diagonal", [True, False])
def test_the_weight_matrix_is_lambda_of_7(diagonal):
    rng = np.random.default_rng(1)
    problem, zeta = over_constrained(1, rows=(2, 2)), rng.standard_normal(7)
    root = rng.standard_normal((7, 7))
    W = np.diag(rng.uniform(0.5, 2.0, 7)) if diagonal else root @ root.T + np.eye(7)
    J, b = problem.matrix, problem.lower
    x = solve(
        problem,
        "damped_least_squares",
        damping=ConstantDamping(1.0),
        weight=np.diag(W) if diagonal else W,
        secondary=zeta,
    ).x
    np.testing.assert_allclose(x, np.linalg.solve(J.T @ J + W, J.T @ b + W @ zeta), rtol=1e-10)
    # (7) rewritten: the damped answer plus what damping leaves of the free vector.
    inverse = np.linalg.inv(J.T @ J + W)
    np.testing.assert_allclose(x, inverse @ J.T @ b + (np.eye(7) - inverse @ J.T @ J) @ zeta, rtol=1e-9)


def test_the_free_term_of_7_as_printed_is_zero():
    problem = independent(2)
    J, W = problem.matrix, np.eye(7)
    inverse = np.linalg.inv(J.T @ J + W)
    np.testing.assert_allclose(np.eye(7) - inverse @ (J.T @ J + W), 0.0, atol=1e-13)


def test_variable_damping_is_18_and_19():
    U, V = (np.linalg.qr(np.random.default_rng(s).standard_normal((3, 3)))[0] for s in (1, 2))
    sigma = np.array([2.0, 1.0, 0.02])
    delta, maximum = 0.1, 0.3
    square = (1 - (sigma[-1] / delta) ** 2) * maximum**2
    expected = V @ (sigma / (sigma**2 + square) * (U.T @ np.ones(3)))
    x = solve(
        one_level((U * sigma) @ V.T, np.ones(3)), "damped_least_squares", damping=VariableDamping(delta, maximum)
    ).x
    np.testing.assert_allclose(x, expected, rtol=1e-12)


def test_variable_damping_is_continuous_at_delta_and_absent_above_it():
    A = np.diag([1.0, 0.5])
    answers = {
        f: solve(one_level(A, [1.0, 1.0]), "damped_least_squares", damping=VariableDamping(0.5 * f, 10.0)).x
        for f in (0.5, 1 - 1e-13, 1.0, 1 + 1e-13, 1 + 1e-9)
    }
    for f in (0.5, 1 - 1e-13, 1.0):
        np.testing.assert_allclose(answers[f], [1.0, 2.0], rtol=1e-15)
    np.testing.assert_allclose(answers[1 + 1e-13], [1.0, 2.0], rtol=1e-8)
    np.testing.assert_allclose(answers[1 + 1e-9], [1.0, 2.0], rtol=1e-5)


@pytest.mark.parametrize("scale", [1e-150, 1e150])
@pytest.mark.parametrize("damping", [NoDamping(), ConstantDamping(0.1), VariableDamping(0.5, 0.1), Truncation(0.01)])
def test_extreme_rows_break_nothing(scale, damping):
    solution = solve(one_level(scale * np.eye(3), scale * np.ones(3)), "damped_least_squares", damping=damping)
    assert solution.status is Status.SOLVED
    if scale > 1 or damping.kind == 0:
        np.testing.assert_allclose(solution.x, 1.0, rtol=1e-12)
    else:
        assert np.abs(solution.x).max() < 1e-100  # rows this small are far below the damping


@pytest.mark.parametrize(
    ("weight", "message"),
    [
        (np.ones((2, 3)), r"shape \(2, 3\)"),
        ([[1.0, 2.0], [0.0, 1.0]], "not symmetric"),
        ([1.0, -1.0], "not positive definite .*-1"),
        ([1.0, np.nan], "finite"),
    ],
)
def test_a_wrong_weight_is_named(weight, message):
    with pytest.raises(SettingError, match=message):
        solve(one_level(np.eye(2), [1.0, 1.0]), "damped_least_squares", weight=weight)


def test_a_weight_of_another_size_is_refused():
    solution = solve(independent(), "damped_least_squares", weight=np.ones(3))
    assert solution.status is Status.REFUSED
    assert "3 unknowns and the problem has 7" in solution.message
