"""DAQP's hierarchical mode against the truth and the certificate; its status against what was proven of the hard rows."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import Level, Problem, SettingError, Status, certify, truth
from hqp_rp.solvers.daqp import Daqp
from tests.hard_problems import KINDS, box_problem, hard_violation, polytope_problem
from tests.problems import boxed, equality_cases, near_singular, over_constrained, scaled, two_sided

SEEDS = range(8)
NEAR_SINGULAR = "near-singular"  # the softening of DAQP's rows shows there: an honest INACCURATE
CASES = [(name, problem) for name, problem in equality_cases(3) if NEAR_SINGULAR not in name]


@pytest.mark.parametrize(("name", "problem"), CASES, ids=[name for name, _ in CASES])
def test_equality_levels_are_solved(name: str, problem: Problem) -> None:
    solver = Daqp()
    for secondary in (None, np.linspace(-1.0, 2.0, problem.n)):
        solution = solver.solve(problem, secondary)
        right = truth(problem, secondary)
        assert solution.status is Status.SOLVED, solution.message
        assert np.linalg.norm(solution.x - right.x) <= 1e-5 * (1.0 + np.linalg.norm(right.x))


@pytest.mark.parametrize(
    "make", [two_sided, lambda s: two_sided(s, box=0.3), lambda s: boxed(over_constrained(s), 0.3)]
)
def test_two_sided_and_hard_rows_are_solved(make) -> None:
    solver = Daqp()
    for seed in SEEDS:
        problem = make(seed)
        solution = solver.solve(problem)
        assert solution.status is Status.SOLVED, solution.message
        np.testing.assert_allclose(solution.x, truth(problem).x, atol=1e-7)


def test_rows_of_different_length_weigh_as_they_are_given() -> None:
    # DAQP alone would weigh both rows alike and answer 1.5; the level's own least squares is (100 * 1 + 1 * 2) / 101.
    level = Level.equality([[10.0], [1.0]], [10.0, 2.0])
    np.testing.assert_allclose(Daqp().solve(Problem([level])).x, [102.0 / 101.0], atol=1e-6)


def test_scaling_a_level_changes_nothing() -> None:
    problem = two_sided(3)
    x = Daqp().solve(problem).x
    solution = Daqp().solve(scaled(problem, (2.0**400, 2.0**-400, 1.0)))
    assert solution.status is Status.SOLVED
    np.testing.assert_allclose(solution.x, x, atol=1e-12)


def test_where_the_softening_shows_it_is_not_called_solved() -> None:
    statuses = set()
    for eps in (1e-2, 1e-3, 1e-4, 1e-6):
        problem = near_singular(eps)
        solution = Daqp().solve(problem)
        statuses.add(solution.status)
        assert solution.status.ok == certify(problem, solution.x, tolerance=1e-6).ok
        if solution.status is Status.INACCURATE:
            assert "'level 2' is at fault" in solution.message
    assert statuses == {Status.SOLVED, Status.INACCURATE}


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(KINDS), st.sampled_from([box_problem, polytope_problem]))
def test_never_a_wrong_verdict(seed: int, kind: str, make) -> None:
    problem = make(seed, kind, two_sided=True)
    solution = Daqp().solve(problem)
    if kind == "infeasible":
        assert solution.status in (Status.INFEASIBLE, Status.INACCURATE)
        return
    assert solution.status is not Status.INFEASIBLE, solution.message
    if solution.status is Status.SOLVED:
        assert hard_violation(problem, solution.x) <= 1e-6
        assert certify(problem, solution.x, tolerance=1e-6).ok


def test_most_random_problems_get_their_verdict() -> None:
    solver = Daqp()
    counts = dict.fromkeys(KINDS, 0)
    for seed in range(60):
        for kind in KINDS:
            expected = Status.INFEASIBLE if kind == "infeasible" else Status.SOLVED
            for make in (box_problem, polytope_problem):
                counts[kind] += solver.solve(make(seed, kind, two_sided=True)).status is expected
    assert counts["wide"] >= 114, counts
    assert counts["barely"] >= 108, counts
    assert counts["infeasible"] >= 117, counts


def test_hard_rows_in_conflict_are_named() -> None:
    hard = Level([[1, 0], [0, 1], [1, 0]], [1, -5, -np.inf], [np.inf, 5, 0])
    solution = Daqp().solve(Problem([Level.equality(np.eye(2), [3.0, 4.0])], hard))
    assert solution.status is Status.INFEASIBLE
    assert solution.x is None
    assert "Hard rows 0, 2 contradict each other" in solution.message
    zero = Daqp().solve(Problem([Level.equality(np.eye(2), [3.0, 4.0])], Level([[0, 0]], 1, 2)))
    assert zero.status is Status.INFEASIBLE
    assert "Hard row 0 is a row of zeros" in zero.message


def test_an_iteration_limit_is_a_status() -> None:
    solution = Daqp(max_iterations=2).solve(two_sided(1, box=0.2))
    assert not solution.status.ok
    assert solution.message


def test_what_is_kept_changes_no_digit_and_is_no_setting() -> None:
    solver = Daqp()
    for seed in SEEDS:
        problem = two_sided(seed, box=0.3)
        np.testing.assert_array_equal(solver.solve(problem).x, Daqp().solve(problem).x)
    assert solver == Daqp()
    assert repr(solver) == repr(Daqp())
    assert pickle.loads(pickle.dumps(solver)) == solver
    solver.reset()
    assert not solver._models.kept


def test_settings_out_of_range() -> None:
    for settings_, text in (
        ({"accept": 0.0}, "accept is 0"),
        ({"accept": 2.0}, "accept is 2"),
        ({"rho": -1.0}, "rho is -1"),
        ({"primal_tol": "x"}, "primal_tol is 'x'"),
        ({"max_iterations": 0}, "max_iterations is 0"),
    ):
        with pytest.raises(SettingError, match=text):
            Daqp(**settings_)
    assert Daqp(accept=1e-4).tolerance == 1e-4
