"""The truth where rounding of the coefficients decides which inequality rows bind, and its start from a guess."""

import numpy as np
import pytest

from hqp_rp import Level, Problem, ProblemError, certify, distance, truth
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.truth import truths
from hqp_rp.core.truth_inequality import searched_in_double_precision
from tests.problems import boxed, dependent_up_to_rounding, independent, near_singular, two_sided


def blind_joint(rounding: float) -> Problem:
    """A target out of reach within limits, by rows that see the last unknown only by `rounding`; then a second level."""
    first = np.array([[1.0, 0.5, 0.0, rounding], [0.0, 1.0, 0.5, -rounding]])
    second = np.array([[0.0, 0.0, 0.0, 1.0]])
    return Problem(
        [Level.equality(first, [5.0, 1.0]), Level.equality(second, [0.25])], hard=Level(np.eye(4), -1.0, 1.0)
    )


def test_rounding_holds_an_unknown_at_its_limit_in_exact_arithmetic_only() -> None:
    problem = blind_joint(1e-17)
    exact, rule, clean = truth(problem), truth(problem, rank_rule=RANK_TOLERANCE), truth(blind_joint(0.0))
    assert exact.x is not None
    assert rule.x is not None
    assert clean.x is not None
    assert abs(exact.x[3]) == 1.0
    assert rule.x[3] == pytest.approx(0.25, abs=1e-15)  # level 2 has it
    np.testing.assert_allclose(rule.x, clean.x, atol=1e-15)
    assert exact.ambiguous
    assert rule.ambiguous
    assert "Some rows are all but zero in the freedom that is left to them (below 1e-12 ||A_k||" in exact.reason
    assert rule.reason == exact.reason
    assert rule.residuals[1] == pytest.approx(0.0, abs=1e-15)
    assert exact.residuals[1] > 0.7
    assert "rank tolerance" in rule.method or rule.method == "exact rational arithmetic"
    assert certify(problem, rule.x).ok
    assert not certify(problem, exact.x).ok
    assert not truth(blind_joint(0.0)).ambiguous
    assert not truth(blind_joint(1e-6)).ambiguous


def test_the_distance_is_to_the_rule_s_answer() -> None:
    problem = blind_joint(1e-17)
    right = truth(problem, rank_rule=RANK_TOLERANCE).x
    assert right is not None
    for x in (right, np.zeros(4)):  # the point that is judged is also the guess: it decides nothing
        found = distance(problem, x)
        assert found.value == pytest.approx(np.linalg.norm(x - right) / (1 + np.linalg.norm(right)), abs=1e-14)
        assert found.ambiguous


@pytest.mark.parametrize("seed", range(12))
def test_levels_dependent_up_to_rounding(seed: int) -> None:
    problem = dependent_up_to_rounding(seed, box=0.5 if seed % 2 else None)
    exact, rule = truths(problem, None, RANK_TOLERANCE)
    answer = exact if rule is None else rule
    assert answer.x is not None
    verdict = certify(problem, answer.x)
    assert verdict.ok, verdict.sentence
    assert (rule is not None) <= exact.ambiguous
    assert exact.x is not None
    if np.linalg.norm(exact.x - answer.x) > 1e-8:
        assert exact.ambiguous
    again = truth(problem, rank_rule=RANK_TOLERANCE, start=answer.x)
    np.testing.assert_allclose(again.x, answer.x, atol=1e-12)


def test_some_of_them_have_two_answers() -> None:
    apart = 0
    for seed in range(12):
        exact, rule = truths(dependent_up_to_rounding(seed), None, RANK_TOLERANCE)
        assert exact.x is not None
        if rule is not None and rule.x is not None:
            apart += np.linalg.norm(exact.x - rule.x) > 1e-3
    assert apart > 0


def test_ranks_are_those_of_the_rule_that_was_asked_for() -> None:
    problem = boxed(near_singular(1e-14), 1e16)
    exact, rule = truth(problem), truth(problem, rank_rule=RANK_TOLERANCE)
    assert exact.ranks == (3, 3)
    assert rule.ranks == (3, 0)
    wide = truth(near_singular(1e-14), rank_rule=RANK_TOLERANCE)
    np.testing.assert_allclose(rule.x, wide.x, rtol=1e-14)  # type: ignore[arg-type]
    np.testing.assert_allclose(rule.residuals, wide.residuals, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("seed", range(6))
def test_clear_problems_have_one_answer(seed: int) -> None:
    problem = two_sided(seed, 6, (2, 3, 6), band=1.0, box=0.3 if seed % 2 else None)
    exact, rule = truths(problem, None, RANK_TOLERANCE)
    assert rule is None
    assert not exact.ambiguous
    np.testing.assert_array_equal(truth(problem, rank_rule=RANK_TOLERANCE).x, exact.x)


@pytest.mark.parametrize("seed", range(4))
def test_a_start_changes_nothing_but_the_way(seed: int) -> None:
    problem = two_sided(seed, 6, (2, 3, 6), band=1.0, box=0.3)
    secondary = np.linspace(-1.0, 1.0, 6)
    right = truth(problem, secondary)
    assert right.x is not None
    rng = np.random.default_rng(seed)
    for start in (right.x, np.zeros(6), 1e6 * rng.standard_normal(6), np.full(6, 1e300)):
        found = truth(problem, secondary, start=start)
        np.testing.assert_array_equal(found.x, right.x)
        np.testing.assert_array_equal(found.residuals, right.residuals)
        assert (found.ranks, found.method, found.ambiguous) == (right.ranks, right.method, right.ambiguous)


def test_forty_unknowns_from_a_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """From a start on the right rows nothing is searched: no cell is visited, whatever the size."""
    from hqp_rp.core import truth_active_set

    problem = two_sided(1, 40, (12, 12, 40), band=1.0, box=0.5)
    start = searched_in_double_precision(problem, np.zeros(40), RANK_TOLERANCE)
    assert start is not None
    visited: list[object] = []
    monkeypatch.setattr(truth_active_set.Region, "_minimize_cell", lambda self, level, u: visited.append(u))
    found = truth(problem, start=start)
    assert found.x is not None
    np.testing.assert_allclose(found.x, start, atol=1e-10)
    assert not visited


def test_an_infeasible_problem_with_a_start() -> None:
    hard = Level([[1.0, 0.0], [1.0, 0.0]], [2.0, -np.inf], [np.inf, 1.0])
    answer = truth(Problem([Level.equality([[1.0, 0.0]], [0.0])], hard=hard), rank_rule=1e-12, start=[2.0, 0.0])
    assert answer.x is None
    assert not answer.ambiguous


def test_misuse() -> None:
    with pytest.raises(ProblemError, match="start must be 7 finite numbers"):
        truth(boxed(independent(0), 1.0), start=np.zeros(3))
    with pytest.raises(ProblemError, match="start must be 7 finite numbers"):
        truth(independent(0), start=np.full(7, np.nan))
