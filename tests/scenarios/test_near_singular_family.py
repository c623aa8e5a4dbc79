"""The near-singular family: what it is made of, and what it shows of exact methods."""

import numpy as np
import pytest

from hqp_rp import SettingError, Singularity, Solver, diagnose, get_solver
from hqp_rp.scenarios.scenario import all_scenarios, get_scenario


def test_the_family_is_found_by_name():
    assert "near_singular_family" in all_scenarios()
    assert get_scenario("near_singular_family", per_decade=2).length() == 2 * 29


def test_same_seed_same_problems_and_other_seed_other_problems():
    family = get_scenario("near_singular_family", per_decade=1)
    first = [p.matrix.tobytes() for _, _, p in family.problems(3)]
    assert first == [p.matrix.tobytes() for _, _, p in family.problems(3)]
    assert first != [p.matrix.tobytes() for _, _, p in family.problems(4)]


@pytest.mark.parametrize("seed", range(3))
def test_eps_is_the_distance_to_an_algorithmic_singularity(seed):
    family = get_scenario("near_singular_family", per_decade=1)
    for case, eps, problem in family.problems(seed):
        reports = diagnose(problem, np.zeros(7))
        assert reports[0].sigma_min > 0.1
        if eps < 1e-2:
            assert 1e-3 * eps < reports[1].sigma_min < 10.0 * eps
        if eps > 1e-10:
            assert [r.singularity for r in reports[:2]] == [Singularity.NONE, Singularity.NONE]
        if eps < 1e-13:
            assert reports[1].singularity is Singularity.ALGORITHMIC
        assert problem.p == (2 if case == "two levels" else 3)


@pytest.mark.parametrize("name", ["null_space", "reverse_priority"])
def test_exact_methods_meet_both_levels_down_to_the_rank_rule(name):
    for step in get_scenario("near_singular_family", per_decade=1).steps(get_solver(name), seed=0):
        if step.case == "two levels" and step.parameter > 1e-9:
            size = np.linalg.norm(step.problem.matrix, 2) * np.linalg.norm(step.solution.x)
            assert all(level.residual < 1e-14 * size for level in step.solution.levels)


def test_a_warm_started_solver_is_reset_before_each_problem():
    class Counting(Solver):
        name = "counting"
        resets = 0

        def solve(self, problem, secondary=None):
            return get_solver("null_space").solve(problem)

        def reset(self):
            Counting.resets += 1

    family = get_scenario("near_singular_family", per_decade=1)
    assert len(list(family.steps(Counting(), seed=0))) == family.length() == Counting.resets


@pytest.mark.parametrize("wrong", [{"n": 6}, {"n": 7.0}, {"smallest": 0.0}, {"smallest": 2.0}, {"per_decade": 0}])
def test_wrong_settings_are_named(wrong):
    with pytest.raises(SettingError, match=next(iter(wrong))):
        get_scenario("near_singular_family", **wrong)
