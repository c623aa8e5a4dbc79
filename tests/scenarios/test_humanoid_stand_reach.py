"""The standing humanoid: what the scenario promises of feet, limits and measures."""

import numpy as np
import pytest

from hqp_rp import SettingError, Status, certify, get_solver
from hqp_rp.scenarios.humanoid_stand_reach import HumanoidStandReach
from hqp_rp.scenarios.scenario import all_scenarios


@pytest.fixture(scope="module")
def run():
    """Every second control period of the whole motion."""
    scenario = HumanoidStandReach(period=0.008, substeps=8)
    return scenario, list(scenario.steps(get_solver("hierarchical_active_set"), 0))


def column(steps, name):
    return np.array([step.measured[name] for step in steps])


def test_it_stands_through_reach_push_and_step(run):
    scenario, steps = run
    assert len(steps) == scenario.length() == scenario.periods()
    assert {step.solution.status for step in steps} == {Status.SOLVED}
    assert column(steps, "holding").max() == 0.0
    assert column(steps, "height [m]").min() > 0.7
    assert column(steps, "slip [m]").max() < 0.01
    assert column(steps, "tilt [rad]").max() < 0.2
    assert column(steps, "torque violation [N m]").max() == 0.0
    assert column(steps, "largest torque [N m]").max() <= 100.0


def test_the_hand_reaches_as_far_as_balance_allows(run):
    _, steps = run
    time = np.array([step.parameter for step in steps])
    reaching = (time > 1.5) & (time < 2.0)
    assert 0.05 < column(steps, "hand error [m]")[reaching].min() < 0.32  # 0.55 m where a damping holds it back
    assert column(steps, "balance error [m]")[reaching].max() < 0.005


def test_answers_are_certified_those_of_a_blend_as_well(run):
    _, steps = run
    for step in [*steps[::40], *steps[540:600:10]]:
        assert certify(step.problem, step.solution.x).ok


def test_a_foot_is_lifted_and_set_down(run):
    _, steps = run
    levels = [step.problem.levels[0] for step in steps]
    open_ones = [not level.A[:6].any() for level in levels]
    assert 10 < sum(open_ones) < len(steps) // 3
    assert not open_ones[-1]


def test_seeds_turn_the_push():
    scenario = HumanoidStandReach(duration=1.0, period=0.01, substeps=10)
    solver, name = get_solver("hierarchical_active_set"), "hand error [m]"
    ends = [list(scenario.steps(solver, seed))[-1].measured[name] for seed in (0, 1, 1, 2)]
    assert ends[1] == ends[2]
    assert len(set(ends)) == 3


def test_closed_forms_refuse_and_the_quick_form_is_shorter():
    scenario = HumanoidStandReach()
    steps = list(scenario.steps(get_solver("null_space"), 0))
    assert [step.solution.status for step in steps] == [Status.REFUSED]
    assert scenario.quick().length() < 0.3 * scenario.length() + 1
    assert all_scenarios()["humanoid_stand_reach"] is HumanoidStandReach
    assert not HumanoidStandReach.by_default


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"friction": 0.0}, "friction of humanoid_stand_reach is 0.0"),
        ({"period": -1.0}, "> 0"),
        ({"substeps": 0}, "at least 1"),
        ({"push": np.nan}, "finite number"),
        ({"duration": 0.001}, "at least two periods"),
    ],
)
def test_settings_are_checked(settings, words):
    with pytest.raises(SettingError) as error:
        HumanoidStandReach(**settings)
    assert words in str(error.value)
