"""Reverse priority against its own recursion in exact arithmetic, and what it does and does not share with the optimum."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import (
    ConstantDamping,
    Level,
    ManipulabilityDamping,
    NoDamping,
    Problem,
    Truncation,
    UnknownNameError,
    VariableDamping,
    solve,
    truth,
)
from tests import reference
from tests.problems import (
    EQUALITY_CASES,
    dependent,
    independent,
    near_singular,
    over_constrained,
    rank_deficient,
    scaled,
)

EPS = np.finfo(float).eps
FORMS = ("columns", "projector")


def error(x, expected):
    return np.abs(x - expected).max() / max(1e-300, np.abs(expected).max())


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", [name for name in EQUALITY_CASES if "scaled" not in name])
def test_it_is_its_recursion_in_exact_arithmetic(name, form):
    for seed in range(3):
        problem = EQUALITY_CASES[name](seed)
        expected = reference.reverse_priority(problem)
        assert error(solve(problem, "reverse_priority", form=form).x, expected) < (
            1e3 * EPS * reference.condition(problem)
        )


@pytest.mark.parametrize(
    "name", ["independent 3+3", "dependent 3+3", "rank-deficient", "6+3+7", "over-constrained 6+3"]
)
def test_the_two_forms_are_one_map_by_28(name):
    problem = EQUALITY_CASES[name](1)
    assert error(reference.reverse_priority_projector(problem), reference.reverse_priority(problem)) < 4 * EPS


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "make",
    [
        independent,
        dependent,
        lambda seed: dependent(seed, rows=(4, 4), shared=2),
        rank_deficient,
        lambda seed: over_constrained(seed, rows=(6, 3)),
        lambda seed: over_constrained(seed, rows=(9, 2)),
        lambda seed: near_singular(1e-5, seed),
    ],
)
@pytest.mark.parametrize("seed", range(4))
def test_on_two_levels_it_is_the_lexicographic_optimum(make, form, seed):
    problem = make(seed)
    assert error(solve(problem, "reverse_priority", form=form).x, truth(problem).x) < (
        1e3 * EPS * reference.condition(problem)
    )


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("seed", range(5))
def test_on_three_conflicting_levels_it_is_not_lexicographic(form, seed):
    problem = over_constrained(seed, rows=(3, 3, 7))
    x, optimum = solve(problem, "reverse_priority", form=form).x, truth(problem).x
    miss = [np.linalg.norm(level.A @ x - level.lower) for level in problem.levels]
    best = [np.linalg.norm(level.A @ optimum - level.lower) for level in problem.levels]
    assert miss[0] < 1e-13  # the first level is exact ...
    assert best[1] < 1e-13
    assert miss[1] > 0.05  # ... the second one, which could be met, is not, ...
    assert miss[2] < best[2]  # ... for the sake of the third
    assert error(x, reference.reverse_priority(problem)) < 1e3 * EPS * reference.condition(problem)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("seed", range(3))
def test_three_independent_levels_are_all_met(form, seed):
    problem = independent(seed, rows=(2, 2, 2))
    assert error(solve(problem, "reverse_priority", form=form).x, truth(problem).x) < 1e3 * EPS * reference.condition(
        problem
    )


def test_30_and_32_are_the_recursion():
    problem = independent(5)
    J1, J2 = (level.A for level in problem.levels)
    b1, b2 = (level.lower for level in problem.levels)
    pinv = np.linalg.pinv
    x2 = pinv(J2) @ b2
    P = np.eye(7) - pinv(J2) @ J2  # (31), independent tasks
    T = pinv(np.vstack([J1, J2]))[:, :3]
    by_30 = x2 + pinv(J1 @ P) @ (b1 - J1 @ x2)
    by_32 = x2 + T @ pinv(J1 @ T) @ (b1 - J1 @ x2)
    for form in FORMS:
        x = solve(problem, "reverse_priority", form=form).x
        np.testing.assert_allclose(x, by_30, atol=1e-12)
        np.testing.assert_allclose(x, by_32, atol=1e-12)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("rows", [(3, 3), (3, 3, 7)])
@pytest.mark.parametrize("exponent", range(0, 17, 2))
def test_level_1_stays_at_rounding_error_at_every_condition(exponent, rows, form):
    for seed in range(3):
        problem = near_singular(10.0**-exponent, seed, rows=rows)
        x = solve(problem, "reverse_priority", form=form).x
        A, b = problem.levels[0].A, problem.levels[0].lower
        assert np.linalg.norm(A @ x - b) <= 1e2 * EPS * np.linalg.norm(A, 2) * np.linalg.norm(x)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "damping", [ConstantDamping(0.2), VariableDamping(0.5, 0.2), Truncation(0.1), ManipulabilityDamping(1.0, 0.2)]
)
@pytest.mark.parametrize("exponent", [2, 6, 10, 14])
def test_damping_t_k_alone_keeps_level_1_and_bounds_x(exponent, damping, form):
    problem = near_singular(10.0**-exponent, 2)
    solution = solve(problem, "reverse_priority", damping=damping, form=form)
    A = problem.levels[0].A
    assert solution.levels[0].residual <= 1e2 * EPS * np.linalg.norm(A, 2) * np.linalg.norm(solution.x)
    # The free answer is near J_2^+ b_2, whatever eps is: J_2 itself is well conditioned.
    assert np.linalg.norm(solution.x) < 60.0
    if 2 < exponent < 12:  # at 14 the rank rule cuts the direction
        assert np.linalg.norm(solve(problem, "reverse_priority").x) > 1e3


def test_damping_everywhere_spoils_level_1():
    problem = near_singular(1e-6, 2)
    everywhere = solve(problem, "reverse_priority", damping=ConstantDamping(0.2), damp="everywhere")
    assert everywhere.levels[0].residual > 1e-3


@pytest.mark.parametrize("form", FORMS)
def test_constant_damping_is_the_literal_damped_t_k(form):
    problem = over_constrained(3, rows=(2, 2, 5))
    factor = 0.3
    q = np.zeros(7)
    for k in (2, 1, 0):
        stacked = np.vstack([level.A for level in problem.levels[k:]])
        J_k, b_k = problem.levels[k].A, problem.levels[k].lower
        T = np.linalg.solve(stacked.T @ stacked + factor**2 * np.eye(7), stacked.T)[:, : len(J_k)]
        q = q + T @ np.linalg.pinv(J_k @ T, rcond=1e-12) @ (b_k - J_k @ q)
    x = solve(problem, "reverse_priority", damping=ConstantDamping(factor), form=form).x
    np.testing.assert_allclose(x, q, rtol=1e-10, atol=1e-12)


def test_truncation_is_the_literal_truncated_t_k():
    problem = over_constrained(4, rows=(3, 3))
    sigma = np.linalg.svd(problem.matrix, compute_uv=False)
    threshold = float((sigma[-1] + sigma[-2]) / 2)
    q = np.zeros(7)
    for k in (1, 0):
        U, s, Vt = np.linalg.svd(np.vstack([level.A for level in problem.levels[k:]]), full_matrices=False)
        kept = s > threshold
        J_k, b_k = problem.levels[k].A, problem.levels[k].lower
        T = (Vt[kept].T / s[kept] @ U[:, kept].T)[:, : len(J_k)]
        q = q + T @ np.linalg.pinv(J_k @ T, rcond=1e-12) @ (b_k - J_k @ q)
    x = solve(problem, "reverse_priority", damping=Truncation(threshold)).x
    np.testing.assert_allclose(x, q, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("damp", ["t_k", "everywhere"])
@pytest.mark.parametrize("form", FORMS)
def test_variable_damping_is_continuous_at_delta(form, damp):
    problem = over_constrained(6, rows=(3, 3))
    sigma = float(np.linalg.svd(problem.matrix, compute_uv=False)[-1])
    plain = solve(problem, "reverse_priority", form=form).x
    for delta in (sigma, sigma * (1 - 1e-12), sigma * (1 + 1e-12)):
        x = solve(problem, "reverse_priority", form=form, damp=damp, damping=VariableDamping(delta, 1.0)).x
        if damp == "t_k":
            np.testing.assert_allclose(x, plain, rtol=1e-8)
    before, after = (
        solve(problem, "reverse_priority", form=form, damp=damp, damping=VariableDamping(sigma * f, 1.0)).x
        for f in (1 - 1e-9, 1 + 1e-9)
    )
    np.testing.assert_allclose(before, after, rtol=1e-6)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "factors", [(2.0**498, 2.0**-498), (2.0**-498, 2.0**498), (2.0**-498, 2.0**-498), (1.0, 2.0**40)]
)
def test_two_levels_do_not_feel_their_scale(form, factors):
    for make in (independent, dependent, lambda seed: over_constrained(seed, rows=(6, 3))):
        problem = make(1)
        plain = solve(problem, "reverse_priority", form=form).x
        x = solve(scaled(problem, factors), "reverse_priority", form=form).x
        np.testing.assert_allclose(x, plain, rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize(
    "factors", [(1.0, 2.0**498, 2.0**-498), (2.0**-498, 2.0**-498, 2.0**498), (1.0, 2.0**10, 2.0**-6)]
)
def test_three_levels_share_by_their_scale_as_the_recursion_says(factors):
    for make in (lambda s: independent(s, rows=(2, 2, 2)), lambda s: over_constrained(s, rows=(3, 3, 7))):
        problem = scaled(make(2), factors)
        # In exact arithmetic factors of 2^60 and of 2^996 differ by less than the last digit of x.
        near = scaled(make(2), [max(min(f, 2.0**60), 2.0**-60) for f in factors])
        expected = reference.reverse_priority(near)
        assert error(solve(problem, "reverse_priority").x, expected) < 1e-10


def test_the_free_vector_is_where_the_recursion_starts():
    problem, zeta = independent(3, rows=(2, 2)), np.arange(7.0)
    np.testing.assert_allclose(
        solve(problem, "reverse_priority", secondary=zeta).x, reference.reverse_priority(problem, zeta), rtol=1e-12
    )


def test_a_large_lower_answer_that_level_1_cancels_leaves_level_1_exact():
    # Level 2 alone would ask for 1e9 along a direction that level 1 holds at 1.
    J1, J2 = np.eye(3)[:1], np.array([[1e-9, 1.0, 0.0], [0.0, 1.0, 0.0]])
    problem = Problem([Level.equality(J1, [1.0]), Level.equality(J2, [1.0, 0.0])])
    x = solve(problem, "reverse_priority").x
    assert abs(x[0] - 1.0) < 4 * EPS
    np.testing.assert_allclose(x, truth(problem).x, atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(2, 9),
    rows=st.lists(st.integers(0, 5), min_size=1, max_size=4),
    form=st.sampled_from(FORMS),
)
def test_random_stacks_follow_the_recursion(seed, n, rows, form):
    rng = np.random.default_rng(seed)
    problem = Problem(
        [Level.equality(rng.integers(-3, 4, (m, n)).astype(float), rng.integers(-5, 6, m).astype(float)) for m in rows]
    )
    expected = reference.reverse_priority(problem)
    x = solve(problem, "reverse_priority", form=form).x
    assert np.abs(x - expected).max() < 1e5 * EPS * reference.condition(problem) * max(1.0, np.abs(expected).max())


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("damp", ["t_k", "everywhere"])
@pytest.mark.parametrize("damping", [NoDamping(), ConstantDamping(0.1), Truncation(0.1)])
@pytest.mark.parametrize("zero", [0, 1])
def test_a_level_of_zeros_asks_for_nothing(form, damp, damping, zero):
    matrices = [np.eye(3)[:2], np.eye(3)[1:]]
    matrices[zero] = np.zeros((2, 3))
    problem = Problem([Level.equality(A, [1.0, 2.0]) for A in matrices])
    alone = Problem([problem.levels[1 - zero]])
    settings = {"form": form, "damp": damp, "damping": damping}
    x = solve(problem, "reverse_priority", **settings).x
    np.testing.assert_allclose(x, solve(alone, "reverse_priority", **settings).x, atol=1e-12)


def test_unknown_form_and_place_are_named():
    with pytest.raises(UnknownNameError, match=r"form of reverse_priority named 'column'.*'columns'"):
        solve(independent(), "reverse_priority", form="column")
    with pytest.raises(UnknownNameError, match=r"Valid: everywhere, t_k"):
        solve(independent(), "reverse_priority", damp="nowhere")
