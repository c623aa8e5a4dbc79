"""Selectively damped least squares: the published update, its bound, and what it gives up."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import Level, Problem, SettingError, solve
from hqp_rp.solvers.selectively_damped import buss_kim
from tests.problems import independent, near_singular


def clamp(w: np.ndarray, most: float) -> np.ndarray:
    largest = np.abs(w).max()
    return w * (most / largest) if largest > most else w


def by_the_book(J: np.ndarray, e: np.ndarray, gamma_max: float) -> np.ndarray:
    """Buss and Kim 2005, one singular value after the other."""
    U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
    total = np.zeros(J.shape[1])
    for i in range(len(sigma)):
        N = np.linalg.norm(U[:, i])
        M = sum(abs(Vt[i, j]) * np.linalg.norm(J[:, j]) for j in range(J.shape[1])) / sigma[i]
        total += clamp(Vt[i] * (U[:, i] @ e) / sigma[i], min(1.0, N / M) * gamma_max)
    return clamp(total, gamma_max)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("gamma_max", [0.1, 0.8, 100.0])
def test_one_level_is_the_published_update(seed: int, gamma_max: float) -> None:
    rng = np.random.default_rng(seed)
    J, e = rng.normal(size=(3, 7)), rng.normal(size=3)
    expected = by_the_book(J, e, gamma_max)
    np.testing.assert_allclose(buss_kim(J, e, gamma_max), expected, rtol=1e-12)
    x = solve(Problem([Level.equality(J, e)]), "selectively_damped", gamma_max=gamma_max).x
    np.testing.assert_allclose(x, expected, rtol=1e-12)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.floats(-14.0, 0.0), st.floats(0.01, 10.0))
def test_no_component_passes_gamma_max_for_each_level(seed: int, exponent: float, gamma_max: float) -> None:
    problem = near_singular(10.0**exponent, seed % 100, rows=(3, 3, 7))
    x = solve(problem, "selectively_damped", gamma_max=gamma_max).x
    assert x is not None
    assert np.abs(x).max() <= 3.0 * gamma_max * (1.0 + 1e-12)


def test_small_targets_are_met_in_order() -> None:
    problem = independent(3, rows=(3, 3))
    small = Problem([Level.equality(level.A, 1e-4 * level.lower) for level in problem.levels])
    solution = solve(small, "selectively_damped")
    np.testing.assert_allclose(solution.x, solve(small, "null_space").x, rtol=1e-9)


def test_a_level_never_disturbs_those_above_it() -> None:
    problem = near_singular(1e-5, 1, rows=(3, 3, 7))
    alone = solve(Problem(problem.levels[:1]), "selectively_damped").x
    x = solve(problem, "selectively_damped").x
    A = problem.levels[0].A
    np.testing.assert_allclose(A @ x, A @ alone, atol=1e-12)


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf"), True, "1"])
def test_bad_settings(bad: object) -> None:
    with pytest.raises(SettingError, match=r"gamma_max is .*; it must be a finite number > 0\."):
        solve(independent(0), "selectively_damped", gamma_max=bad)
