"""The incremental projector: its recursion from matrices, the bound on every step, and null-space priority beyond it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import Problem, SettingError, solve
from hqp_rp.solvers.incremental_projector import baerlocher_boulic, damping_factor
from tests.problems import independent, near_singular


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("largest", [0.1, 1.0, 50.0])
def test_it_is_the_recursion_with_projectors(seed: int, largest: float) -> None:
    problem = independent(seed, rows=(2, 3))
    J, b = [level.A for level in problem.levels], [level.lower for level in problem.levels]
    x = solve(problem, "incremental_projector", largest_step=largest).x
    np.testing.assert_allclose(x, baerlocher_boulic(J, b, largest), rtol=1e-8, atol=1e-10)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.floats(1e-9, 10.0), min_size=1, max_size=5),
    st.lists(st.floats(-5.0, 5.0), min_size=5, max_size=5),
    st.floats(1e-3, 100.0),
)
def test_the_damping_factor_bounds_every_step(values: list[float], error: list[float], largest: float) -> None:
    sigma, e = np.sort(values)[::-1], np.array(error[: len(values)])
    lam = damping_factor(float(sigma[-1]), float(np.linalg.norm(e)), largest)
    step = sigma / (sigma**2 + lam**2) * e
    assert np.linalg.norm(step) <= largest * (1.0 + 1e-9)
    if np.linalg.norm(e) <= sigma[-1] * largest * (1.0 - 1e-12):
        assert lam == 0.0


def test_the_damping_factor_is_continuous() -> None:
    lams = [damping_factor(s, 1.0, 2.0) for s in np.linspace(0.0, 1.0, 20001)]
    assert np.abs(np.diff(lams)).max() < 0.01
    assert lams[0] == 0.25
    assert lams[-1] == 0.0


@pytest.mark.parametrize("exponent", [1, 4, 8, 12])
def test_x_is_bounded_through_a_singularity_and_level_1_keeps_what_it_reached(exponent: int) -> None:
    problem = near_singular(10.0**-exponent, 2, rows=(3, 3, 7))
    x = solve(problem, "incremental_projector", largest_step=0.5).x
    assert np.linalg.norm(x) <= 1.5 * (1.0 + 1e-9)
    alone = solve(Problem(problem.levels[:1]), "incremental_projector", largest_step=0.5).x
    A = problem.levels[0].A
    np.testing.assert_allclose(A @ x, A @ alone, atol=1e-12)


def test_with_a_large_bound_it_is_null_space_priority() -> None:
    problem = near_singular(1e-4, 2, rows=(3, 3))
    exact = solve(problem, "null_space").x
    np.testing.assert_allclose(solve(problem, "incremental_projector", largest_step=1e9).x, exact, rtol=1e-8)


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf"), True, "1"])
def test_bad_settings(bad: object) -> None:
    with pytest.raises(SettingError, match=r"largest_step is .*; it must be a finite number > 0\."):
        solve(independent(0), "incremental_projector", largest_step=bad)
