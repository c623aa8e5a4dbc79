"""Null-space priority: exact against the truth in its stable form, and where the textbook recursion is lost."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import (
    ConstantDamping,
    Level,
    ManipulabilityDamping,
    NumericalFiltering,
    Problem,
    Status,
    Truncation,
    UnknownNameError,
    VariableDamping,
    solve,
    truth,
)
from tests import reference
from tests.problems import EQUALITY_CASES, conditioned, independent, near_singular, over_constrained, scaled

EPS = np.finfo(float).eps


def error(x, expected):
    return np.abs(x - expected).max() / max(1e-300, np.abs(expected).max())


@pytest.mark.parametrize("name", EQUALITY_CASES)
@pytest.mark.parametrize("variant", ["basis", "projector"])
def test_it_is_the_lexicographic_optimum(name, variant):
    for seed in range(4):
        problem = EQUALITY_CASES[name](seed)
        bound = 1e3 * EPS * reference.condition(problem)
        x = solve(problem, "null_space", variant=variant).x
        # The textbook recursion loses a further factor of the condition.
        assert error(x, truth(problem).x) < bound * (1 if variant == "basis" else 1e2 * reference.condition(problem))


@pytest.mark.parametrize("exponent", range(1, 11))
@pytest.mark.parametrize("rows", [(3, 3), (3, 3, 7), (2, 2, 2)])
def test_it_is_within_rounding_error_times_condition(exponent, rows):
    for make in (near_singular, lambda eps, seed, rows: conditioned(1 / eps, seed, rows=rows)):
        for seed in range(3):
            problem = make(10.0**-exponent, seed, rows=rows)
            condition = reference.condition(problem)
            assert error(solve(problem, "null_space").x, truth(problem).x) < 1e3 * EPS * condition


@pytest.mark.parametrize("exponent", range(17))
def test_level_1_stays_at_rounding_error_at_every_condition(exponent):
    for seed in range(3):
        problem = near_singular(10.0**-exponent, seed, rows=(3, 3, 7))
        x = solve(problem, "null_space").x
        A, b = problem.levels[0].A, problem.levels[0].lower
        assert np.linalg.norm(A @ x - b) <= 1e2 * EPS * np.linalg.norm(A, 2) * np.linalg.norm(x)


def test_the_textbook_recursion_loses_level_1_and_says_so():
    problem = near_singular(1e-7, 0)
    textbook = solve(problem, "null_space", variant="projector")
    assert textbook.levels[0].residual > 1e3 * solve(problem, "null_space").levels[0].residual
    assert textbook.status is Status.INACCURATE
    assert 'variant="basis"' in textbook.message
    assert solve(independent(), "null_space", variant="projector").status is Status.SOLVED


@pytest.mark.parametrize("rows", [(6, 1, 7), (6, 3, 7), (6, 6, 6), (7, 7)])
def test_levels_without_freedom_do_not_blow_up(rows):
    for seed in range(5):
        problem = over_constrained(seed, rows=rows)
        x = solve(problem, "null_space").x
        assert error(x, truth(problem).x) < 1e3 * EPS * reference.condition(problem)


@pytest.mark.parametrize("a", [2.0**498, 2.0**-498, 1.0])
@pytest.mark.parametrize("b", [2.0**498, 2.0**-498, 1.0])
@pytest.mark.parametrize("variant", ["basis", "projector"])
def test_the_scale_of_a_level_plays_no_part(a, b, variant):
    for name in ("independent 3+3", "dependent 3+3", "rank-deficient", "over-constrained 6+3"):
        problem = EQUALITY_CASES[name](1)
        np.testing.assert_array_equal(
            solve(scaled(problem, (a, b)), "null_space", variant=variant).x,
            solve(problem, "null_space", variant=variant).x,
        )


def test_the_free_vector_fills_what_the_levels_leave():
    problem, zeta = independent(4, rows=(2, 3)), np.linspace(-2, 1, 7)
    np.testing.assert_allclose(solve(problem, "null_space", secondary=zeta).x, truth(problem, zeta).x, rtol=1e-12)


@pytest.mark.parametrize(
    "damping",
    [
        ConstantDamping(0.3),
        VariableDamping(3.0, 0.3),
        Truncation(0.5),
        ManipulabilityDamping(9.0, 0.3),
        NumericalFiltering(3.0, 0.3),
    ],
)
def test_damping_does_not_make_levels_leak(damping):
    # However level 1 is damped, what it reached is not moved by the levels below it.
    problem = over_constrained(2, rows=(3, 3, 7))
    alone = solve(Problem(problem.levels[:1]), "null_space", damping=damping).x
    x = solve(problem, "null_space", damping=damping).x
    A = problem.levels[0].A
    np.testing.assert_allclose(A @ x, A @ alone, atol=1e-13)


def test_damping_is_the_damped_inverse_of_each_projected_level():
    problem, eta = over_constrained(3, rows=(3, 3)), 0.4
    (A1, A2), (b1, b2) = zip(*((level.A, level.lower) for level in problem.levels), strict=True)
    x1 = np.linalg.solve(A1.T @ A1 + eta**2 * np.eye(7), A1.T @ b1)
    N = np.eye(7) - np.linalg.pinv(A1) @ A1
    B = A2 @ N
    expected = x1 + np.linalg.solve(B.T @ B + eta**2 * np.eye(7), B.T @ (b2 - A2 @ x1))
    for variant in ("basis", "projector"):
        x = solve(problem, "null_space", damping=ConstantDamping(eta), variant=variant).x
        np.testing.assert_allclose(x, expected, atol=1e-12)


def test_variable_damping_is_continuous_at_delta():
    problem = independent(1, rows=(3,))
    sigma = float(np.linalg.svd(problem.matrix, compute_uv=False)[-1])
    plain = solve(problem, "null_space").x
    for factor in (1 - 1e-12, 1.0, 1 + 1e-12):
        x = solve(problem, "null_space", damping=VariableDamping(sigma * factor, 1.0)).x
        np.testing.assert_allclose(x, plain, rtol=1e-9)
    assert not np.allclose(solve(problem, "null_space", damping=VariableDamping(2 * sigma, 1.0)).x, plain, rtol=1e-3)


def test_the_rank_tolerance_decides_what_is_lost():
    problem = near_singular(1e-8, 3)
    assert np.linalg.norm(solve(problem, "null_space").x) > 1e6
    assert np.linalg.norm(solve(problem, "null_space", rank_tolerance=1e-6).x) < 100


@settings(max_examples=100, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 12),
    rows=st.lists(st.integers(0, 8), min_size=1, max_size=5),
    integers=st.booleans(),
)
def test_any_stack_is_certified(seed, n, rows, integers):
    rng = np.random.default_rng(seed)

    def draw(*shape):
        return rng.integers(-2, 3, shape).astype(float) if integers else rng.standard_normal(shape)

    problem = Problem([Level.equality(draw(m, n), draw(m)) for m in rows])
    solution = solve(problem, "null_space")
    assert solution.status is Status.SOLVED
    from hqp_rp import certify

    assert certify(problem, solution.x).ok


def test_unknown_variant_is_named():
    with pytest.raises(UnknownNameError, match=r"variant of null_space named 'bases'. Did you mean 'basis'"):
        solve(independent(), "null_space", variant="bases")
