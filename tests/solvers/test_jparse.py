"""J-PARSE: the published composition of matrices, continuity, the bound, and levels that do not leak."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import Level, Problem, SettingError, solve
from hqp_rp.solvers.jparse import jparse_inverse
from tests.problems import independent, near_singular


def with_values(sigma: list[float], seed: int, n: int = 6) -> np.ndarray:
    rng = np.random.default_rng(seed)
    U = np.linalg.qr(rng.normal(size=(len(sigma), len(sigma))))[0]
    V = np.linalg.qr(rng.normal(size=(n, n)))[0]
    return U @ np.diag(sigma) @ V[: len(sigma)]


@pytest.mark.parametrize("smallest", [0.5, 0.19, 1e-3, 1e-9])
@pytest.mark.parametrize("gain", [0.0, 0.5, 1.0])
def test_one_level_is_the_published_formula(smallest: float, gain: float) -> None:
    J, b = with_values([2.0, 1.0, smallest], 2), np.array([1.0, -2.0, 0.5])
    x = solve(Problem([Level.equality(J, b)]), "jparse", gamma=0.1, gain=gain).x
    np.testing.assert_allclose(x, jparse_inverse(J, 0.1, gain) @ b, rtol=1e-9, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 1000), st.floats(1e-12, 1.0), st.floats(0.02, 0.9))
def test_the_answer_of_a_level_is_bounded(seed: int, smallest: float, gamma: float) -> None:
    J, b = with_values([1.0, 0.5, smallest], seed), np.random.default_rng(seed).normal(size=3)
    x = solve(Problem([Level.equality(J, b)]), "jparse", gamma=gamma).x
    assert x is not None
    assert np.linalg.norm(x) <= np.linalg.norm(b) / gamma * (1.0 + 1e-9)


def test_it_is_continuous_with_gain_one_and_jumps_without() -> None:
    def answers(gain: float) -> np.ndarray:
        b = np.ones(3)
        values = np.linspace(0.05, 0.15, 2001)
        return np.array(
            [solve(Problem([Level.equality(with_values([1.0, 0.5, s], 1), b)]), "jparse", gain=gain).x for s in values]
        )

    smooth = np.linalg.norm(np.diff(answers(1.0), axis=0), axis=1)
    stopped = np.linalg.norm(np.diff(answers(0.0), axis=0), axis=1)
    assert smooth.max() < 0.02
    assert stopped.max() > 1.0


def test_far_from_singularities_it_is_null_space_priority() -> None:
    problem = independent(3, rows=(3, 3))
    np.testing.assert_allclose(
        solve(problem, "jparse", gamma=1e-6).x, solve(problem, "null_space").x, rtol=1e-9, atol=1e-12
    )


def test_a_level_of_which_little_is_left_stays_small_and_none_leaks() -> None:
    problem = near_singular(1e-7, 1, rows=(3, 3, 7))
    x = solve(problem, "jparse").x
    alone = solve(Problem(problem.levels[:1]), "jparse").x
    A = problem.levels[0].A
    np.testing.assert_allclose(A @ x, A @ alone, atol=1e-12)
    exact = solve(problem, "null_space").x
    assert np.linalg.norm(x) < 100.0 < np.linalg.norm(exact)


@pytest.mark.parametrize("bad", [0.0, 1.0, -0.1, float("nan"), True, "1"])
def test_bad_settings(bad: object) -> None:
    with pytest.raises(SettingError, match=r"gamma is .*; it must be a number > 0 and below 1\."):
        solve(independent(0), "jparse", gamma=bad)
    if bad not in (0.0, 1.0):
        with pytest.raises(SettingError, match=r"gain is .*; it must be a finite number >= 0\."):
            solve(independent(0), "jparse", gain=bad)
