"""Levels of many problems factored together: as one by one, rank-deficient problems among them."""

import numpy as np
import pytest

from hqp_rp.compare.stress.levels import level_errors, level_scales
from hqp_rp.core.certificate import certify
from hqp_rp.core.distance import orthogonal_cascade
from hqp_rp.core.problem import Level, Problem
from hqp_rp.core.solver import RANK_TOLERANCE

SHAPES = [(7, (3, 3, 7)), (7, (3, 3)), (4, (2, 1, 4)), (6, (2, 8)), (5, (0, 2, 3)), (3, (3, 2, 1))]


def problems(n, rows, count=24, seed=0):
    """Every third problem repeats a row of an earlier level, and every sixth has a level of zeros."""
    rng = np.random.default_rng(seed)
    made = []
    for i in range(count):
        blocks = [rng.standard_normal((m, n)) for m in rows]
        filled = [k for k, m in enumerate(rows) if m]
        if i % 3 == 0:
            blocks[filled[1]][0] = blocks[filled[0]][0]
        if i % 6 == 1:
            blocks[filled[0]][:] = 0.0
        made.append(Problem([Level.equality(A, rng.standard_normal(len(A))) for A in blocks]))
    return made


@pytest.mark.parametrize(("n", "rows"), SHAPES)
def test_many_are_judged_as_one(n, rows):
    every = problems(n, rows)
    scales, x, error = level_scales(every)
    for i, problem in enumerate(every):
        with np.errstate(all="ignore"):
            expected, estimate = orthogonal_cascade(problem, np.zeros(n), RANK_TOLERANCE)
        np.testing.assert_allclose(x[i], expected, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(error[i], estimate, rtol=1e-9)
        alone, _, _ = level_scales([problem])
        for one, scale in zip(alone, scales, strict=True):
            for name in ("noise", "size", "target", "sigma"):
                np.testing.assert_allclose(getattr(one, name)[0], getattr(scale, name)[i], rtol=1e-9, atol=1e-15)
            P, P_alone = (found @ found.T for found in (scale.range[i], one.range[0]))
            np.testing.assert_allclose(P, P_alone, atol=1e-12)


@pytest.mark.parametrize(("n", "rows"), SHAPES)
def test_the_range_is_that_of_the_level_beside_the_ones_before(n, rows):
    every = problems(n, rows, seed=1)
    scales, _, _ = level_scales(every)
    for i, problem in enumerate(every):
        above = np.zeros((0, n))
        for level, scale in zip(problem.levels, scales, strict=True):
            free = np.eye(n) - np.linalg.pinv(above, rcond=1e-10) @ above
            U, sigma, _ = np.linalg.svd(level.A @ free, full_matrices=False)
            U = U[:, sigma > 1e-10 * np.linalg.norm(level.A)]
            P = U @ U.T
            np.testing.assert_allclose(scale.range[i] @ scale.range[i].T, P, atol=1e-8)
            above = np.vstack([above, level.A])


@pytest.mark.parametrize(("n", "rows"), SHAPES)
def test_errors_agree_with_the_certificate(n, rows):
    every = problems(n, rows, seed=2)
    scales, x, _ = level_scales(every)
    assert np.nanmax(level_errors(every, scales, x)) < 1e-12
    rng = np.random.default_rng(3)
    x = x + 0.1 * rng.standard_normal(x.shape)
    x[5] = np.nan
    errors = level_errors(every, scales, x)
    assert np.isnan(errors[5]).all()
    for i, problem in enumerate(every):
        if i == 5:
            continue
        for level, error in zip(certify(problem, x[i]).levels, errors[i], strict=True):
            proven = max(level.excess - level.uncertainty, 0.0)
            assert error == pytest.approx(proven / level.scale if proven else 0.0, rel=1e-3, abs=1e-9)
