"""Batches: the same answers as one by one, whatever the shape, the solver and the number of threads."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import (
    ConstantDamping,
    HqpError,
    Level,
    ManipulabilityDamping,
    NumericalFiltering,
    Problem,
    ProblemError,
    SettingError,
    Status,
    Truncation,
    certify,
    get_solver,
    solve,
    solve_batch,
)

FORMS = [
    ("null_space", {}),
    ("null_space", {"variant": "projector"}),
    ("null_space", {"damping": ConstantDamping(0.1)}),
    ("reverse_priority", {}),
    ("reverse_priority", {"form": "projector"}),
    ("reverse_priority", {"damping": ConstantDamping(0.1), "damp": "everywhere"}),
    ("reverse_priority", {"damping": Truncation(0.1), "form": "projector", "damp": "everywhere"}),
    ("singularity_robust", {}),
    ("null_space", {"damping": ManipulabilityDamping(5.0, 0.3)}),
    ("singularity_robust", {"damping": NumericalFiltering(1.0, 0.3)}),
    ("pseudo_inverse", {}),
    ("hierarchical_active_set", {}),
]


def draw(seed, count, rows, n):
    rng = np.random.default_rng(seed)
    M = sum(rows)
    return rng.standard_normal((count, M, n)), rng.standard_normal((count, M)), np.concatenate(([0], np.cumsum(rows)))


def one(A, b, offsets):
    return Problem.from_stacked(A, b, b, offsets)


@pytest.mark.parametrize(("name", "kwargs"), FORMS)
@pytest.mark.parametrize("rows", [(3, 3), (3, 3, 7)])
def test_a_batch_is_its_problems(name, kwargs, rows):
    A, b, offsets = draw(1, 19, rows, 7)  # two groups of eight, and a rest
    A[4, 3] = A[4, 0]  # dependent levels: not proven full rank side by side
    answer = solve_batch(A, b, None, offsets, solver=name, threads=2, **kwargs)
    solver = get_solver(name, **kwargs)
    assert len(answer) == 19
    for i in range(19):
        single = solver.solve(one(A[i], b[i], offsets))
        assert answer.status(i) is single.status
        np.testing.assert_allclose(answer.x[i], single.x, rtol=1e-7, atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 9),
    rows=st.lists(st.integers(0, 6), min_size=1, max_size=4),
    integers=st.booleans(),
)
def test_side_by_side_answers_are_certified(seed, n, rows, integers):
    A, b, offsets = draw(seed, 8, rows, n)
    if integers:
        A, b = np.round(A), np.round(b)
    answer = solve_batch(A, b, None, offsets, solver="null_space", threads=1)
    assert answer.solved.all()
    for i in range(8):
        certificate = certify(one(A[i], b[i], offsets), answer.x[i])
        assert certificate.ok, certificate.sentence


@pytest.mark.parametrize("scale", [1e-150, 1e150])
def test_scales_play_no_part_side_by_side(scale):
    A, b, offsets = draw(2, 8, (3, 3), 7)
    factor = 2.0 ** np.round(np.log2(scale))
    scaled_A, scaled_b = A.copy(), b.copy()
    scaled_A[:, :3] *= factor
    scaled_b[:, :3] *= factor
    scaled = solve_batch(scaled_A, scaled_b, None, offsets, solver="null_space")
    np.testing.assert_array_equal(scaled.x, solve_batch(A, b, None, offsets, solver="null_space").x)


def test_free_vectors_for_all_or_one_each():
    A, b, offsets = draw(3, 11, (2, 2), 7)
    rng = np.random.default_rng(0)
    each = rng.standard_normal((11, 7))
    for name in ("null_space", "reverse_priority"):
        own = solve_batch(A, b, None, offsets, solver=name, secondary=each, threads=3)
        shared = solve_batch(A, b, None, offsets, solver=name, secondary=each[0])
        for i in range(11):
            problem = one(A[i], b[i], offsets)
            np.testing.assert_allclose(own.x[i], solve(problem, name, secondary=each[i]).x, atol=1e-11)
            np.testing.assert_allclose(shared.x[i], solve(problem, name, secondary=each[0]).x, atol=1e-11)


def test_two_sided_rows_go_to_a_solver_that_takes_them():
    A, b, offsets = draw(4, 6, (3, 4), 7)
    answer = solve_batch(A, b - 0.3, b + 0.3, offsets, solver="hierarchical_active_set", threads=2)
    assert answer.solved.all()
    for i in range(6):
        levels = [Level(A[i, s], b[i, s] - 0.3, b[i, s] + 0.3) for s in (slice(0, 3), slice(3, 7))]
        assert certify(Problem(levels), answer.x[i]).ok
    refused = solve_batch(A, b - 0.3, b + 0.3, offsets, solver="null_space")
    assert refused.status(0) is Status.REFUSED
    assert np.isnan(refused.x).all()


def test_an_empty_batch_is_legal():
    answer = solve_batch(np.zeros((0, 3, 7)), np.zeros((0, 3)), None, [0, 3], solver="null_space")
    assert answer.x.shape == (0, 7)
    assert len(answer) == 0


def test_the_problem_that_overflows_is_the_only_one_without_an_answer():
    A, b, offsets = draw(5, 9, (2, 2), 4)
    A[3, :2] *= 1e-250
    b[3, :2] = 1e200
    answer = solve_batch(A, b, None, offsets, solver="null_space")
    assert answer.status(3) is Status.NOT_FINITE
    assert np.isnan(answer.x[3]).all()
    assert answer.solved.sum() == 8


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"A": np.zeros((3, 7))}, r"A has shape \(3, 7\)"),
        ({"lower": np.zeros((2, 2))}, r"lower has shape \(2, 2\)"),
        ({"offsets": [0, 2]}, "must rise from 0"),
        ({"A": np.where(np.arange(42).reshape(2, 3, 7) == 30, np.nan, 1.0)}, r"A\[1, 1, 2\] is nan"),
        ({"upper": np.full((2, 3), -1.0)}, "lower must not exceed upper"),
        ({"secondary": np.zeros(3)}, r"secondary has shape \(1, 3\)"),
    ],
)
def test_wrong_arrays_are_named(change, message):
    arguments = {"A": np.ones((2, 3, 7)), "lower": np.zeros((2, 3)), "upper": None, "offsets": [0, 3], **change}
    with pytest.raises(ProblemError, match=message):
        solve_batch(
            arguments["A"],
            arguments["lower"],
            arguments["upper"],
            arguments["offsets"],
            solver="null_space",
            secondary=change.get("secondary"),
        )


def test_wrong_settings_are_named():
    A, b, offsets = draw(0, 2, (1,), 2)
    with pytest.raises(SettingError, match="threads is 0"):
        solve_batch(A, b, None, offsets, solver="null_space", threads=0)
    with pytest.raises(HqpError, match="no solver named 'nul_space'"):
        solve_batch(A, b, None, offsets, solver="nul_space")
