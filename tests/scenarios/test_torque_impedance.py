"""The torque loop of the force scenarios: the law is what the arm does, and who stays passive."""

import itertools

import numpy as np
import pytest

import hqp_rp
from hqp_rp import SettingError, Status, get_solver
from hqp_rp.control import TorqueStack
from hqp_rp.scenarios._interaction import PAPER, REGULAR, Place
from hqp_rp.scenarios.sawyer_force_tracking import SawyerForceTracking
from hqp_rp.scenarios.sawyer_push_response import SawyerPushResponse
from hqp_rp.scenarios.sawyer_torque_impedance import SawyerTorqueImpedance
from hqp_rp.scenarios.scenario import all_scenarios, get_scenario

SHORT = {"duration": 0.6, "push_force": 20.0}


def regular(scenario, solver, seed=0, **settings):
    case = scenario.cases()[0]
    return list(scenario.run_case(case, scenario.contact_arm(case, seed), get_solver(solver, **settings), seed))


def worst(steps, axes=("x", "y", "z")):
    return max(
        abs(step.measured[f"deviation {axis}"] - step.measured[f"ideal {axis}"]) for step in steps for axis in axes
    )


def test_it_is_registered_and_no_part_of_the_main_comparison():
    assert all_scenarios()["sawyer_torque_impedance"] is SawyerTorqueImpedance
    assert not SawyerTorqueImpedance.by_default
    assert [case.name for case in SawyerTorqueImpedance().cases()] == [f"{PAPER}, {REGULAR}", f"{PAPER}, near singular"]


@pytest.mark.parametrize("metric", ["inertia", "none"])
@pytest.mark.parametrize("solver", ["null_space", "reverse_priority", "operational_space", "hierarchical_active_set"])
def test_the_tool_is_the_law_to_the_period(solver, metric):
    """Inverse dynamics told the wrench: what is left is the sampling, of first order in the period."""
    coarse, fine = (
        worst(regular(SawyerTorqueImpedance(**SHORT, metric=metric, period=period, substeps=substeps), solver))
        for period, substeps in ((0.002, 4), (0.001, 2))
    )
    assert fine < 2e-4
    assert 1.5 < coarse / fine < 2.5


def test_rotation_comes_to_the_law_with_the_period_alone():
    """An inertia of 80 kg m^2 is thousands of times that of the wrist: what is compensated late counts as much more."""
    turning = [
        worst(regular(SawyerTorqueImpedance(duration=1.0, period=period, substeps=2), "null_space"), ("rx", "ry", "rz"))
        for period in (0.002, 0.0005)
    ]
    assert turning[1] < 0.5 * turning[0]


def test_the_velocity_loop_lags_where_the_torque_loop_does_not():
    lagging = SawyerPushResponse(**SHORT)
    direct = SawyerPushResponse(**SHORT, inner_loop="torque")
    assert worst(regular(lagging, "null_space")) > 10.0 * worst(regular(direct, "null_space"))


def test_without_the_wrench_the_arm_keeps_its_own_inertia():
    """What `applied` is for: the same stack that is not told of the push does not move as the law."""
    scenario = SawyerTorqueImpedance(**SHORT)
    told = worst(regular(scenario, "null_space"))
    plain = TorqueStack.problem

    def deaf(self, robot, dt, v, a=None, *, applied=None):
        return plain(self, robot, dt, v, a, applied=None)

    TorqueStack.problem = deaf
    try:
        assert worst(regular(scenario, "null_space")) > 20.0 * told
    finally:
        TorqueStack.problem = plain


def test_exact_priority_is_passive_and_projected_torques_need_not_be():
    gained = {}
    for solver, settings in (
        ("null_space", {}),
        ("operational_space", {}),
        ("null_space_torque", {"consistency": "static"}),
    ):
        steps = regular(SawyerTorqueImpedance(duration=1.5), solver, **settings)
        gained[solver] = max(step.measured["energy gained [J]"] for step in steps)
        assert all(np.isfinite(step.measured["energy [J]"]) for step in steps)
    assert gained["null_space"] < 1e-3 * max(step.measured["energy [J]"] for step in steps)
    assert gained["operational_space"] == pytest.approx(gained["null_space"], abs=1e-9)
    assert gained["null_space_torque"] > 10.0 * gained["null_space"] + 1e-3


def test_work_of_the_push_bounds_the_energy():
    steps = regular(SawyerTorqueImpedance(**SHORT), "null_space")
    for step in steps:
        assert step.measured["energy [J]"] <= step.measured["work [J]"] + 1e-2


@pytest.mark.parametrize("solver", ["null_space", "reverse_priority"])
def test_a_force_is_tracked_by_torques_too(solver):
    scenario = SawyerForceTracking(duration=1.2, inner_loop="torque")
    case = next(case for case in scenario.cases() if case.name == "well damped, regular")
    steps = list(scenario.run_case(case, scenario.contact_arm(case), get_solver(solver), 0))
    late = steps[len(steps) // 2 :]
    missing = [abs(step.measured["force x [N]"] - step.measured["desired force x [N]"]) for step in late]
    assert np.median(missing) < 1.0
    assert all(step.solution.status is Status.SOLVED for step in steps)


def test_another_posture_and_a_noisy_reading():
    scenario = SawyerTorqueImpedance(duration=0.3)
    case = scenario.case_at(PAPER, Place(REGULAR, np.array(scenario.arm().neutral) + 0.2))
    one, same, other = (
        list(scenario.run_case(case, scenario.contact_arm(case, seed), get_solver("null_space"), seed))
        for seed in (1, 1, 2)
    )
    assert [s.measured["deviation x"] for s in one] == [s.measured["deviation x"] for s in same]
    assert one[-1].measured["deviation x"] != other[-1].measured["deviation x"]


def test_a_solver_that_refuses_ends_it():
    scenario = SawyerTorqueImpedance(duration=0.02)

    class Refusing(hqp_rp.Solver):
        name, summary, source = "refusing", "", ""

        def refuses(self, problem):
            return "No."

        def solve(self, problem, secondary=None):
            return hqp_rp.Solution(problem, None, Status.REFUSED, message="No.")

    steps = list(itertools.islice(scenario.steps(Refusing(), 0), 5))
    assert [step.solution.status for step in steps] == [Status.REFUSED]


def test_settings_are_checked():
    with pytest.raises(SettingError, match="it must be torque"):
        SawyerTorqueImpedance(inner_loop="velocity")
    with pytest.raises(SettingError, match="one of velocity, torque"):
        SawyerPushResponse(inner_loop="position")
    with pytest.raises(SettingError, match="one of none, inertia"):
        get_scenario("sawyer_torque_impedance", metric="mass")
