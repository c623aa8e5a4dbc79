"""Distance to the optimum: right, and honest about the reference it took."""

import math

import numpy as np
import pytest

from hqp_rp import Level, Problem, ProblemError, SettingError, distance, truth
from hqp_rp.core.distance import RESOLUTION, orthogonal_cascade, relative_distance
from hqp_rp.core.solver import RANK_TOLERANCE
from tests.problems import badly_scaled, boxed, conditioned, equality_cases, independent, near_singular


@pytest.mark.parametrize(("name", "problem"), equality_cases(2))
def test_references_agree(name: str, problem: Problem) -> None:
    answer = truth(problem).x
    assert answer is not None
    for x in (answer, answer + 0.01, np.zeros(problem.n)):
        cheap, dear = distance(problem, x), distance(problem, x, reference="truth")
        expected = np.linalg.norm(x - answer) / (1 + np.linalg.norm(answer))
        assert dear.value == pytest.approx(expected, rel=1e-12)
        assert abs(cheap.value - dear.value) <= cheap.error + dear.error
        assert dear.reference == "exact rational arithmetic" or "-bit arithmetic" in dear.reference


def test_error_estimate_of_double_precision_is_an_upper_bound() -> None:
    taken = 0
    for seed in range(30):
        for problem in (
            independent(seed),
            conditioned(10.0 ** (seed / 5), seed),
            near_singular(10.0 ** (-seed / 5), seed),
        ):
            x, error = orthogonal_cascade(problem, np.zeros(7), RANK_TOLERANCE)
            exact = truth(problem).x
            assert exact is not None
            assert relative_distance(x, exact) <= error
            taken += error <= RESOLUTION
    assert taken > 20  # it does serve where it should


def test_double_precision_where_it_serves_and_truth_elsewhere() -> None:
    assert distance(independent(0), np.zeros(7)).reference == "double precision"
    assert distance(badly_scaled(0), np.zeros(7)).reference == "double precision"
    assert "-bit arithmetic" in distance(near_singular(1e-9), np.zeros(7)).reference
    assert distance(boxed(independent(0), 0.1), np.zeros(7)).reference == "exact rational active set"
    assert distance(independent(0), np.zeros(7), reference="truth").reference == "exact rational arithmetic"


def test_ambiguous_problems_are_marked() -> None:
    found = distance(near_singular(3e-13), np.zeros(7))
    assert found.ambiguous
    assert not distance(near_singular(1e-6), np.zeros(7)).ambiguous


def test_secondary_and_given_truth() -> None:
    problem, secondary = independent(0), np.ones(7)
    known = truth(problem, secondary)
    assert known.x is not None
    assert distance(problem, known.x, secondary).value < 1e-14
    assert distance(problem, known.x, reference=known).value == 0.0
    assert distance(problem, known.x).value > 0.1


def test_infeasible_has_no_distance() -> None:
    problem = Problem([Level.equality([[1.0]], [0.0])], hard=Level([[1.0], [1.0]], [2, -np.inf], [np.inf, 1]))
    assert math.isnan(distance(problem, [0.0]).value)


def test_misuse() -> None:
    with pytest.raises(SettingError, match=r"reference is 'best'; give \"auto\", \"truth\" or a Truth"):
        distance(independent(0), np.zeros(7), reference="best")
    with pytest.raises(ProblemError, match="x must be 7 finite numbers"):
        distance(independent(0), np.zeros(8))
