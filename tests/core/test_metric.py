"""A metric on the unknown: one change of variables for every solver, the truth and the certificate."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hqp_rp
from hqp_rp import ConstantDamping, Level, Problem, ProblemError, Status, certify, solve, solve_batch, truth
from hqp_rp.core.metric import in_metric, symmetric_root
from tests.problems import boxed, damped, independent, near_singular, two_sided
from tests.problems import in_metric as with_metric

EXACT = ("hierarchical_active_set", "null_space", "qp_cascade", "daqp")


def spd(rng, n=7, decades=3.0):
    Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
    W = (Q * np.logspace(0.0, decades, n)) @ Q.T
    return 0.5 * (W + W.T)


def dynamically_consistent(J, b, W, zeta):
    """zeta + W^-1 J^T (J W^-1 J^T)^-1 (b - J zeta): Khatib's inverse, the weighted least norm."""
    across = np.linalg.solve(W, J.T)
    return zeta + across @ np.linalg.solve(J @ across, b - J @ zeta)


def assert_rows_met(problem, x, expected, zeta):
    """What a tolerance on rows allows, which the metric magnifies in x."""
    L = np.linalg.cholesky(problem.metric)  # DAQP is handed y = L^T x, and its rows are met in the size of that
    for level in problem.levels:
        size = np.linalg.norm(np.linalg.solve(L, level.A.T)) * np.linalg.norm(L.T @ x) + np.linalg.norm(level.lower)
        assert np.linalg.norm(level.A @ x - level.lower) <= 1e-6 * size
    far, near = ((y - zeta) @ problem.metric @ (y - zeta) for y in (x, expected))
    assert far <= (1.0 + 1e-3) * near


@given(seed=st.integers(0, 10_000), decades=st.floats(0.0, 5.0))
@settings(max_examples=30, deadline=None)
def test_the_answer_is_the_dynamically_consistent_inverse(seed, decades):
    rng = np.random.default_rng(seed)
    W, zeta = spd(rng, decades=decades), rng.standard_normal(7)
    plain = independent(seed)
    problem = Problem(plain.levels, metric=W)
    expected = dynamically_consistent(plain.matrix, plain.lower, W, zeta)
    size = 1e-10 * (1.0 + np.linalg.norm(expected)) * 10.0 ** (decades / 2)
    np.testing.assert_allclose(truth(problem, zeta).x, expected, atol=size)
    np.testing.assert_allclose(truth(problem, zeta, 1e-12).x, expected, atol=size)
    for name in (*EXACT, "pseudo_inverse", "reverse_priority", "saturation_null_space", "reverse_priority_unilateral"):
        found = solve(problem, name, secondary=zeta)
        if name == "daqp":
            assert_rows_met(problem, found.x, expected, zeta)
            continue
        np.testing.assert_allclose(found.x, expected, atol=size, err_msg=name)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    "make",
    [
        lambda s: two_sided(s, box=0.3),
        lambda s: boxed(independent(s), 0.3),
        lambda s: boxed(near_singular(1e-4, s), 0.5),
    ],
)
def test_the_exact_truth_with_limits_is_certified_and_found(make, seed):
    problem = with_metric(make(seed), seed)
    known = truth(problem)
    if known.x is None:
        assert solve(problem, "hierarchical_active_set").status is Status.INFEASIBLE
        return
    assert certify(problem, known.x).ok
    found = solve(problem, "hierarchical_active_set")
    assert found.status is Status.SOLVED
    np.testing.assert_allclose(found.x, known.x, atol=1e-9 * (1.0 + np.linalg.norm(known.x)))
    plain = truth(Problem(problem.levels, problem.hard)).x
    if np.linalg.norm(plain - known.x) > 1e-6:
        verdict = certify(problem, plain)
        assert not verdict.ok
        assert verdict.fault == "least norm"


@pytest.mark.parametrize("factor", [1e-8, 1.0, 1e8])
def test_a_factor_of_the_metric_changes_nothing(factor):
    problem = with_metric(independent(2, rows=(3, 2)), 5)
    scaled = Problem(problem.levels, metric=factor * problem.metric)
    for name in EXACT:
        atol = 1e-5 if name == "daqp" else 1e-9  # DAQP softens rows in the scale of its unknown
        np.testing.assert_allclose(solve(scaled, name).x, solve(problem, name).x, rtol=1e-8, atol=atol, err_msg=name)


def test_a_metric_of_a_large_condition_is_solved_and_certified():
    problem = with_metric(independent(3, rows=(3, 2)), 1, condition=1e12)
    found = solve(problem, "hierarchical_active_set")
    assert found.status is Status.SOLVED
    np.testing.assert_allclose(found.x, truth(problem).x, rtol=1e-6)
    assert certify(problem, found.x).ok


@pytest.mark.parametrize("seed", range(4))
def test_damping_is_in_the_metric(seed):
    rng = np.random.default_rng(seed)
    W, J, b = spd(rng), rng.standard_normal((3, 7)), rng.standard_normal(3)
    problem = Problem([Level.equality(J, b, damping=ConstantDamping(0.3))], metric=W)
    expected = np.linalg.solve(J.T @ J + 0.09 * W, J.T @ b)
    for name in ("hierarchical_active_set", "null_space", "qp_cascade"):
        np.testing.assert_allclose(solve(problem, name).x, expected, atol=1e-9, err_msg=name)
    np.testing.assert_allclose(
        solve(Problem([Level.equality(J, b)], metric=W), "damped_least_squares", damping=ConstantDamping(0.3)).x,
        expected,
        atol=1e-10,
    )
    with_limits = with_metric(damped(two_sided(seed, box=0.3), 1), seed)
    found = solve(with_limits, "hierarchical_active_set")
    if found.status is Status.SOLVED:
        assert certify(with_limits, found.x).ok


def test_ranks_and_singular_values_are_those_of_the_metric():
    problem = with_metric(independent(0), 0)
    turned = in_metric(problem)
    levels = solve(problem, "null_space").levels
    assert levels[0].sigma_min == pytest.approx(
        np.linalg.svd(problem.levels[0].A @ turned.inverse, compute_uv=False)[-1]
    )
    np.testing.assert_allclose(turned.root.T @ turned.root, problem.metric, rtol=1e-12, atol=1e-9)
    root, inverse = symmetric_root(problem.metric)
    np.testing.assert_allclose(root @ root, problem.metric, atol=1e-9)
    np.testing.assert_allclose(root @ inverse, np.eye(7), atol=1e-10)


def test_batches_take_one_metric_or_one_each():
    rng = np.random.default_rng(0)
    A, b, zeta = rng.standard_normal((20, 5, 7)), rng.standard_normal((20, 5)), rng.standard_normal(7)
    each = np.stack([spd(rng) for _ in range(20)])
    for name in ("null_space", "reverse_priority", "hierarchical_active_set", "singularity_robust"):
        for metric in (each, each[3]):
            found = solve_batch(A, b, None, [0, 3, 5], solver=name, metric=metric, secondary=zeta)
            for i in range(20):
                W = metric if metric.ndim == 2 else metric[i]
                problem = Problem.from_stacked(A[i], b[i], b[i], np.array([0, 3, 5]), metric=W)
                np.testing.assert_allclose(found.x[i], solve(problem, name, secondary=zeta).x, atol=1e-8)


def test_files_and_pickles_keep_it(tmp_path):
    problem = with_metric(two_sided(1, box=0.2), 1)
    path = hqp_rp.save_problem(problem, tmp_path / "problem.npz")
    for copy in (hqp_rp.load_problem(path), pickle.loads(pickle.dumps(problem))):
        np.testing.assert_array_equal(copy.metric, problem.metric)
        np.testing.assert_array_equal(copy.matrix, problem.matrix)
    assert int(np.load(path)["version"]) == 3
    assert "with a metric" in repr(problem)
    assert not problem.metric.flags.writeable


@pytest.mark.parametrize(
    ("metric", "words"),
    [
        (np.eye(6), "shape (6, 6)"),
        (np.ones(3), "shape (3,)"),
        ([[1.0, 2.0]], "shape (1, 2)"),
        (np.diag([1, 1, 1, 1, 1, 1, 0.0]), "not positive definite"),
        (-np.eye(7), "smallest eigenvalue -1"),
        (np.diag([1, 1, 1, np.nan, 1, 1, 1]), "metric[3, 3] is nan"),
        (np.triu(np.ones((7, 7))), "not symmetric"),
        ("inertia", "'inertia'"),
    ],
)
def test_what_is_no_metric_is_refused(metric, words):
    with pytest.raises(ProblemError) as error:
        Problem(independent(0).levels, metric=metric)
    assert words in str(error.value)


def test_an_unchecked_metric_that_is_none_is_told():
    plain = independent(0)
    problem = Problem.from_stacked(
        plain.matrix, plain.lower, plain.upper, plain.offsets, metric=-np.eye(7), check=False
    )
    with pytest.raises(ProblemError, match="not positive definite"):
        solve(problem, "null_space")


def test_a_full_metric_beside_a_box_is_refused_by_saturation_alone():
    problem = with_metric(boxed(independent(0), 0.3), 0)
    assert solve(problem, "saturation_null_space").status is Status.REFUSED
    diagonal = Problem(problem.levels, problem.hard, metric=np.arange(1.0, 8.0))
    for variant in ("basic", "optimal"):
        assert solve(diagonal, "saturation_null_space", variant=variant).status is Status.SOLVED
    both = solve(problem, "damped_least_squares", weight=np.eye(7))
    assert both.status is Status.REFUSED
    with pytest.raises(ValueError, match="shape"):
        solve_batch(np.zeros((2, 3, 7)), np.zeros((2, 3)), None, [0, 3], solver="null_space", metric=np.eye(3))
