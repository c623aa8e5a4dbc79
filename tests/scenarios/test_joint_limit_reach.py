"""The reach beyond the joint limits: what is out of reach, who pays, and the way back of a start outside."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp.core.solution import Status
from hqp_rp.core.solver import get_solver
from hqp_rp.scenarios.joint_limit_reach import JointLimitReach
from tests.scenarios.crossings import by_case, measured, run


def test_the_target_is_out_of_reach_within_the_limits_and_comes_back() -> None:
    scenario = JointLimitReach().quick()
    steps = by_case(run(scenario, get_solver("hierarchical_active_set")))["hard limits"]
    error = measured(steps, "tool position error [m]")
    middle = slice(round(0.4 * len(steps)), round(0.5 * len(steps)))
    assert error[middle].min() > 0.3
    # At rest there, the hard rows hold the tool: level 1 asks for more and gets nothing.
    assert np.ptp(error[middle]) < 0.01
    assert error[-1] < 0.01
    assert measured(steps, "position limit violation [rad]").max() < 1e-9


def test_every_seed_but_0_starts_outside_and_comes_back_within_velocity_and_acceleration_limits() -> None:
    scenario = JointLimitReach(outside=0.2)
    for seed in (1, 2, 3):
        scene = scenario.scene(seed)
        beyond = np.maximum(scene.robot.lower - scene.start, scene.start - scene.robot.upper)
        assert beyond.max() == pytest.approx(0.2)
        assert (beyond > 0.0).sum() == 1
        steps = by_case(run(scenario, get_solver("hierarchical_active_set"), seed))["hard limits"]
        outside = measured(steps, "position limit violation [rad]")
        assert 0.0 < outside[0] < 0.2
        assert (np.diff(outside) <= 1e-12).all()
        assert outside[25:].max() < 1e-9  # half a second
    scene = scenario.scene(0)
    np.testing.assert_array_equal(scene.start, scene.robot.neutral)


def test_weights_trade_the_limits_and_strict_priority_does_not() -> None:
    scenario = JointLimitReach().quick()
    broken = {}
    for name in ("weighted", "hierarchical_active_set"):
        steps = by_case(run(scenario, get_solver(name)))["limits first"]
        broken[name] = measured(steps, "acceleration limit violation [rad/s^2]").max()
    assert broken["hierarchical_active_set"] < 1e-9
    assert 1e-6 < broken["weighted"] < 0.1


@pytest.mark.parametrize("variant", ["basic", "optimal"])
def test_saturation_keeps_every_limit_and_comes_back_to_the_target(variant: str) -> None:
    scenario = JointLimitReach().quick()
    for seed in (0, 1):
        steps = by_case(run(scenario, get_solver("saturation_null_space", variant=variant), seed))["hard limits"]
        assert {step.solution.status.name for step in steps} == {"SOLVED"}
        for name in ("position limit violation added [rad]", "velocity limit violation [rad/s]"):
            assert measured(steps, name).max() < 1e-9
        assert measured(steps, "acceleration limit violation [rad/s^2]").max() < 1e-7
        assert measured(steps, "tool position error [m]")[-1] < 0.02


def test_where_many_limits_meet_in_one_point_quadprog_still_has_an_answer() -> None:
    # Rounding makes quadprog call some of these QPs inconsistent; without an answer the tool would stop for a period.
    steps = by_case(run(JointLimitReach(), get_solver("qp_cascade", backend="quadprog")))["hard limits"]
    assert all(step.solution.status is Status.SOLVED for step in steps)
    reference = get_solver("hierarchical_active_set")
    for step in steps:
        np.testing.assert_allclose(step.solution.x, reference.solve(step.problem).x, atol=1e-8)
