"""Two arms and a box: the hold, the path and the internal force."""

import numpy as np
import pytest

from hqp_rp import SettingError, Status, certify, get_solver
from hqp_rp.scenarios.dual_arm_carry import DualArmCarry
from hqp_rp.scenarios.scenario import all_scenarios


@pytest.fixture(scope="module")
def steps():
    return list(DualArmCarry().steps(get_solver("hierarchical_active_set"), 0))


def column(steps, name):
    return np.array([step.measured.get(name, np.nan) for step in steps])


def test_the_box_is_held_and_follows_its_path(steps):
    assert {step.solution.status for step in steps} == {Status.SOLVED}
    assert column(steps, "slip [m]").max() < 1e-3
    assert column(steps, "friction used").max() < 1.0
    assert column(steps, "torque violation [N m]").max() == 0.0
    time = np.array([step.parameter for step in steps])
    before = time < 3.1
    assert column(steps, "box position error [m]")[before].max() < 2e-3
    assert column(steps, "box orientation error [rad]")[before].max() < 2e-3
    assert column(steps, "box position error [m]").max() > 2e-3  # the push
    assert column(steps, "box position error [m]")[-1] < 2e-3


def test_the_squeeze_is_what_was_asked_for_and_what_mujoco_measures(steps):
    time = np.array([step.parameter for step in steps])
    for begin, end, force in ((1.0, 2.5, 40.0), (3.8, 4.0, 60.0)):
        inside = (time > begin) & (time < end)
        assert np.abs(column(steps, "squeeze measured [N]")[inside] - force).max() < 1.0
        assert column(steps, "squeeze error [N]")[inside].max() < 2.0


def test_answers_are_certified(steps):
    for step in steps[::50]:
        assert certify(step.problem, step.solution.x).ok


def test_a_slippery_box_is_not_carried_by_the_same_squeeze():
    """The verdict can fail: friction that the squeeze cannot hold the weight with."""
    slippery = list(DualArmCarry(friction=0.2, duration=2.0).steps(get_solver("hierarchical_active_set"), 0))
    assert column(slippery, "squeeze error [N]")[-1] > 10.0 or column(slippery, "slip [m]").max() > 0.01


def test_it_is_registered_and_checks_its_settings():
    assert all_scenarios()["dual_arm_carry"] is DualArmCarry
    assert DualArmCarry().quick().length() <= DualArmCarry().length() // 2 + 1
    assert [s.solution.status for s in DualArmCarry().steps(get_solver("null_space"), 0)] == [Status.REFUSED]
    for bad in ({"mass": 0.0}, {"push": np.inf}, {"substeps": 1.5}, {"duration": 1e-4}):
        with pytest.raises(SettingError):
            DualArmCarry(**bad)
