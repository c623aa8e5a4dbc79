"""What holds for every crossing: the references, the closed loop, and what happens to solvers that fail."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import hqp_rp
from hqp_rp.core.errors import SettingError
from hqp_rp.core.solution import Status
from hqp_rp.robot.mujoco_robot import MujocoRobot
from hqp_rp.scenarios._crossing import Crossing
from hqp_rp.scenarios.planar_crossing import PlanarCrossing
from hqp_rp.scenarios.sawyer_crossing import SawyerCrossing
from hqp_rp.scenarios.scenario import all_scenarios
from tests.scenarios.crossings import Constant, SometimesNothing, by_case, measured, nominal, run, same

CROSSINGS = [PlanarCrossing(), SawyerCrossing()]
every_crossing = pytest.mark.parametrize("crossing", CROSSINGS, ids=lambda crossing: crossing.name)


@every_crossing
def test_it_is_found_by_its_name_and_says_what_it_asks(crossing: Crossing) -> None:
    assert all_scenarios()[crossing.name] is type(crossing)
    assert crossing.question.endswith("?")
    assert crossing.cannot_tell


@every_crossing
def test_rates_of_the_references_are_their_derivatives(crossing: Crossing) -> None:
    fine = dataclasses.replace(crossing, period=1e-4)
    path = fine.path(seed=3)
    middle = slice(1, -1)

    def derivative(values: np.ndarray) -> np.ndarray:
        return np.asarray((values[2:] - values[:-2]) / (2.0 * fine.period))

    np.testing.assert_allclose(derivative(path.q), path.qd[middle], atol=1e-6)
    np.testing.assert_allclose(derivative(path.position), path.velocity[middle], atol=1e-6)
    spin = derivative(path.rotation) @ path.rotation[middle].transpose(0, 2, 1)
    turning = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    # The window of the demand begins and ends with a jump of its second derivative.
    np.testing.assert_allclose(turning, path.angular_velocity[middle], atol=2e-4)


@every_crossing
def test_references_are_the_robots_own_poses_but_for_the_demand(crossing: Crossing) -> None:
    path, robot, axis = crossing.path(), MujocoRobot.from_arm(crossing.arm()), crossing.crossing()[2]
    tool, frame = (task.frame for task in crossing.tasks())
    assert path.demand.max() == pytest.approx(crossing.demand)
    assert path.demand[0] == path.demand[-1] == 0.0
    for k in range(0, crossing.periods() + 1, 40):
        robot.update(path.q[k])
        np.testing.assert_allclose(path.position[k], robot.pose(tool)[1], atol=1e-12)
        beyond = path.rotation[k] @ robot.pose(frame)[0].T
        np.testing.assert_allclose(beyond @ axis, axis, atol=1e-12)
        assert np.trace(beyond) == pytest.approx(1.0 + 2.0 * np.cos(path.demand[k]), abs=1e-12)


@every_crossing
def test_the_path_stays_within_the_limits_of_the_arm(crossing: Crossing) -> None:
    arm = crossing.arm()
    for seed in range(3):
        path = crossing.path(seed)
        assert (path.q > np.array(arm.lower)).all()
        assert (path.q < np.array(arm.upper)).all()
        assert (np.abs(path.qd) < np.array(arm.velocity_limit)).all()


@every_crossing
def test_seed_0_crosses_the_singularity_and_other_seeds_pass_beside_it(crossing: Crossing) -> None:
    middle = crossing.periods() // 2
    np.testing.assert_allclose(crossing.path(0).q[middle], crossing.crossing()[0], atol=1e-15)
    for seed in (1, 2):
        smallest = min(spectra[1].sigma_min for spectra in nominal(crossing, seed))
        assert 1e-5 < smallest < 10.0 * crossing.spread
        assert not np.array_equal(crossing.path(seed).q, crossing.path(seed + 1).q)
        assert np.array_equal(crossing.path(seed).q, crossing.path(seed).q)


@every_crossing
@pytest.mark.parametrize("seed", [0, 1])
def test_the_same_seed_gives_the_same_run(crossing: Crossing, seed: int) -> None:
    solver = hqp_rp.get_solver("null_space", damping=hqp_rp.ConstantDamping(0.05))
    first = run(crossing.quick(), solver, seed)
    assert same(first, run(crossing.quick(), solver, seed))
    assert not same(first, run(crossing.quick(), solver, seed + 1))


@every_crossing
def test_every_solver_is_asked_the_same_first_problem(crossing: Crossing) -> None:
    first, second = (run(crossing.quick(), Constant(value=value), 1) for value in (0.0, 1.0))
    for case, steps in by_case(first).items():
        other = by_case(second)[case]
        assert np.array_equal(steps[0].problem.matrix, other[0].problem.matrix)
        assert np.array_equal(steps[0].problem.lower, other[0].problem.lower)
        assert not np.array_equal(steps[1].problem.matrix, other[1].problem.matrix)


@every_crossing
def test_a_run_has_the_announced_length_cases_and_levels(crossing: Crossing) -> None:
    for scenario in (crossing, crossing.quick()):
        steps = run(scenario, Constant())
        assert len(steps) == scenario.length()
        cases = by_case(steps)
        assert {case: group[0].problem.p for case, group in cases.items()} == {"three levels": 3, "two levels": 2}
        for group in cases.values():
            times = [step.parameter for step in group]
            np.testing.assert_allclose(times, scenario.period * np.arange(scenario.periods()), atol=1e-12)
    assert crossing.quick().length() < crossing.length() / 3


@pytest.mark.parametrize(("duration", "period"), [(1.0, 0.003), (0.7, 0.0025), (0.004, 0.002), (0.0101, 0.002)])
def test_a_control_step_falls_on_the_middle_of_the_path(duration: float, period: float) -> None:
    scenario = PlanarCrossing(duration=duration, period=period, position_gain=1.0, orientation_gain=1.0)
    path = scenario.path()
    assert scenario.periods() % 2 == 0
    assert abs(path.time[-1] - duration) <= period
    np.testing.assert_allclose(path.q[scenario.periods() // 2], scenario.crossing()[0], atol=1e-15)


@every_crossing
def test_a_refusal_is_yielded_once_and_ends_the_run(crossing: Crossing) -> None:
    steps = run(crossing, Constant(value=None, status=Status.REFUSED))
    assert [step.solution.status for step in steps] == [Status.REFUSED]


@every_crossing
@pytest.mark.parametrize("value", [None, float("nan")])
def test_without_an_answer_the_arm_holds_still(crossing: Crossing, value: float | None) -> None:
    steps = run(crossing.quick(), Constant(value=value, status=Status.NOT_FINITE))
    assert len(steps) == crossing.quick().length()
    assert measured(steps, "measured speed [rad/s]").max() < 1e-9
    for group in by_case(steps).values():
        np.testing.assert_allclose(group[-1].problem.matrix, group[0].problem.matrix, atol=1e-9)


@every_crossing
def test_a_solver_that_fails_now_and_then_goes_on_from_where_the_arm_is(crossing: Crossing) -> None:
    steps = run(crossing.quick(), SometimesNothing())
    assert len(steps) == crossing.quick().length()
    for group in by_case(steps).values():
        # Counted anew in each case: the solver is reset before it.
        missing = [step.solution.x is None for step in group]
        assert missing == [k % 7 == 6 for k in range(len(group))]
        # It works six periods of seven, and its feedback makes up for the seventh.
        assert measured(group, "position error [m]").max() < 0.05


@every_crossing
def test_rates_and_errors_are_those_of_the_references(crossing: Crossing) -> None:
    """On an arm that holds still, so that both can be written down."""
    scenario = dataclasses.replace(crossing.quick(), demand=0.0)
    path, arm = scenario.path(), scenario.arm()
    tool, frame = (task.frame for task in scenario.tasks())
    start, rows = arm.pose(path.q[0], tool)[1], len(scenario.tasks()[0].axes)
    turn = arm.pose(path.q[0], frame)[0]
    for k, step in enumerate(by_case(run(scenario, Constant()))["three levels"]):
        position, _, posture = step.problem.levels
        rate = path.velocity[k] + scenario.position_gain * (path.position[k] - start)
        np.testing.assert_allclose(position.lower, rate[:rows], atol=1e-8)
        np.testing.assert_allclose(
            posture.lower, path.qd[k] + scenario.posture_gain * (path.q[k] - path.q[0]), atol=1e-8
        )
        away = path.rotation[k + 1] @ turn.T
        assert step.measured == {
            "position error [m]": pytest.approx(np.linalg.norm(path.position[k + 1] - start), abs=1e-9),
            "orientation error [rad]": pytest.approx(np.arccos(0.5 * (np.trace(away) - 1.0)), abs=1e-6),
            "posture error [rad]": pytest.approx(np.linalg.norm(path.q[k + 1] - path.q[0]), abs=1e-9),
            "commanded speed [rad/s]": 0.0,
            "measured speed [rad/s]": pytest.approx(0.0, abs=1e-9),
            "servo error [rad/s]": pytest.approx(0.0, abs=1e-9),
            "saturated joints": 0.0,
        }


@every_crossing
def test_servos_follow_a_steady_command(crossing: Crossing) -> None:
    steps = by_case(run(crossing, Constant(value=0.3)))["two levels"]
    assert measured(steps, "servo error [rad/s]")[len(steps) // 4 :].max() < 0.01 * 0.3
    assert measured(steps, "saturated joints").max() == 0


@every_crossing
def test_servos_saturate_at_the_velocity_limits(crossing: Crossing) -> None:
    limit = np.linalg.norm(crossing.arm().velocity_limit)
    for value in (1e3, -1e300):
        steps = run(dataclasses.replace(crossing, duration=0.2), Constant(value=value))
        speed = measured(steps, "measured speed [rad/s]")
        assert 0.95 * limit < speed.max() < 1.02 * limit
        assert measured(steps, "saturated joints").min() == crossing.arm().n
        asked = np.sqrt(crossing.arm().n) * abs(value)
        np.testing.assert_allclose(measured(steps, "commanded speed [rad/s]"), asked, rtol=1e-12)


@every_crossing
@pytest.mark.parametrize("name", sorted(hqp_rp.all_solvers()))
def test_every_solver_gets_through_with_finite_figures(crossing: Crossing, name: str) -> None:
    for step in run(crossing.quick(), hqp_rp.get_solver(name)):
        assert step.solution.status is not Status.REFUSED
        assert np.isfinite(list(step.measured.values())).all()
        assert np.isfinite(step.problem.matrix).all()
        assert np.isfinite(step.problem.lower).all()


@every_crossing
def test_solvers_part_at_the_crossing(crossing: Crossing) -> None:
    """Two levels: what is exact keeps both and asks for ever more; what damps gives up the second, not the first."""
    exact, damped = (
        by_case(run(crossing, hqp_rp.get_solver("null_space", damping=damping)))["two levels"]
        for damping in (hqp_rp.NoDamping(), hqp_rp.ConstantDamping(0.05))
    )
    middle = slice(crossing.periods() // 3, 2 * crossing.periods() // 3)
    ends = [*range(crossing.periods() // 6), *range(-crossing.periods() // 8, 0)]
    speed, calm = (measured(steps, "commanded speed [rad/s]") for steps in (exact, damped))
    assert speed[middle].max() > 10.0 * calm[middle].max()
    assert speed[ends].max() < 2.0 * calm.max()
    assert max(np.abs(step.solution.levels[1].residual) for step in exact) < 1e-6
    assert max(np.abs(step.solution.levels[1].residual) for step in damped) > 0.1
    for steps in (exact, damped):
        smallest = min(step.solution.levels[1].sigma_min for step in steps)
        assert smallest < 0.02
        assert steps[0].solution.levels[1].sigma_min > 10.0 * smallest
        assert steps[-1].solution.levels[1].sigma_min > 10.0 * smallest


@pytest.mark.parametrize(
    ("setting", "value", "text"),
    [
        ("duration", 0.0, "duration of planar_crossing is 0.0; it must be a finite number > 0"),
        ("period", float("nan"), "period of planar_crossing is nan"),
        ("demand", -0.1, "demand of planar_crossing is -0.1; it must be a finite number >= 0"),
        ("window", 1.5, r"window of planar_crossing is 1.5; it must be a finite number in \(0, 1\]"),
        (
            "position_gain",
            401.0,
            r"position_gain of planar_crossing is 401.0; it must .* \[0, 1 / period\] = \[0, 400\]",
        ),
        ("substeps", 0, "substeps of planar_crossing is 0; it must be an integer of at least 1"),
        ("duration", 0.004, "needs at least two periods"),
        ("reach", "far", "reach of planar_crossing is 'far'"),
    ],
)
def test_settings_out_of_range_are_named(setting: str, value: Any, text: str) -> None:
    with pytest.raises(SettingError, match=text):
        PlanarCrossing(**{setting: value})
