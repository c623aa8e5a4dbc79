"""The generators of tests.problems are what their names say, in exact arithmetic."""

import numpy as np
import pytest

from hqp_rp.core.truth_exact import stacked_ranks
from tests.problems import (
    badly_scaled,
    conditioned,
    dependent,
    equality_cases,
    independent,
    near_singular,
    rank_deficient,
    two_sided,
)


def ranks(problem: object) -> tuple[int, ...]:
    return stacked_ranks([level.A for level in problem.levels], problem.n)  # type: ignore[attr-defined]


@pytest.mark.parametrize("seed", range(10))
def test_ranks(seed: int) -> None:
    assert ranks(independent(seed)) == (3, 3)
    for shared in (0, 1, 2, 3):
        assert ranks(dependent(seed, shared=shared)) == (3, 3 - shared)
    deficient = rank_deficient(seed)
    assert [ranks(type(deficient)([level]))[0] for level in deficient.levels] == [2, 2]
    assert ranks(near_singular(1e-14, seed)) == (3, 3)


def test_same_seed_same_problem() -> None:
    for (name, a), (_, b) in zip(equality_cases(2), equality_cases(2), strict=True):
        assert a.matrix.tobytes() == b.matrix.tobytes(), name
        assert a.lower.tobytes() == b.lower.tobytes(), name


def test_distances_and_scales() -> None:
    for eps in (1e-3, 1e-9):
        A1, A2 = (level.A for level in near_singular(eps, 1).levels)
        Z = np.linalg.svd(A1)[2][3:].T
        sigma = np.linalg.svd(A2 @ Z, compute_uv=False)
        assert 0.05 * eps < sigma[-1] <= sigma[0] < 10 * eps
    for level in conditioned(1e6).levels:
        sigma = np.linalg.svd(level.A, compute_uv=False)
        assert sigma[0] / sigma[-1] == pytest.approx(1e6, rel=1e-9)
    big, small = (np.abs(level.A).max() for level in badly_scaled().levels)
    assert big > 1e149
    assert small < 1e-149


def test_two_sided_has_every_kind_of_row() -> None:
    problem = two_sided(0, rows=(40,))
    low, high = np.isfinite(problem.lower), np.isfinite(problem.upper)
    assert (problem.lower == problem.upper).any()
    assert (low & high & (problem.lower < problem.upper)).any()
    assert (low & ~high).any()
    assert (~low & high).any()
