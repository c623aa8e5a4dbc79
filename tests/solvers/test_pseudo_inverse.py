"""The pseudo-inverse (4)-(5) against exact arithmetic."""

import numpy as np
import pytest

from hqp_rp import Level, Problem, Truncation, solve, truth
from tests import reference
from tests.problems import EQUALITY_CASES

EPS = np.finfo(float).eps


@pytest.mark.parametrize("name", [name for name in EQUALITY_CASES if "scaled" not in name])
@pytest.mark.parametrize("free", [False, True])
def test_it_is_5_on_all_rows_at_once(name, free):
    for seed in range(3):
        problem = EQUALITY_CASES[name](seed)
        zeta = np.linspace(-1, 1, problem.n) if free else None
        sigma = np.linalg.svd(problem.matrix, compute_uv=False)
        condition = sigma[0] / sigma[sigma > 1e-12 * sigma[0]][-1]
        x = solve(problem, "pseudo_inverse", secondary=zeta).x
        expected = reference.pseudo_inverse(problem, zeta)
        # Least squares with a residual feel the square of the condition.
        assert np.abs(x - expected).max() < 1e2 * EPS * condition**2 * max(1.0, np.abs(expected).max())


def test_one_level_is_the_lexicographic_optimum():
    rng = np.random.default_rng(0)
    for m, n in ((2, 5), (5, 5), (8, 5)):
        problem = Problem([Level.equality(rng.standard_normal((m, n)), rng.standard_normal(m))])
        np.testing.assert_allclose(solve(problem, "pseudo_inverse").x, truth(problem).x, rtol=1e-11)


def test_levels_keep_no_order():
    problem = EQUALITY_CASES["6+3+7"](0)
    turned = Problem(problem.levels[::-1])
    np.testing.assert_allclose(solve(problem, "pseudo_inverse").x, solve(turned, "pseudo_inverse").x, atol=1e-12)


def test_truncation_drops_small_singular_values():
    A = np.diag([1.0, 0.1, 0.01])
    problem = Problem([Level.equality(A, np.ones(3))])
    np.testing.assert_allclose(solve(problem, "pseudo_inverse", damping=Truncation(0.05)).x, [1.0, 10.0, 0.0])
