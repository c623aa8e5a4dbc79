"""One hybrid level at a tilted wall: force across, path along, and friction that the spring yields to."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import get_solver
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.scenarios.sawyer_force_tracking import SawyerForceTracking
from hqp_rp.scenarios.sawyer_hybrid_wipe import SawyerHybridWipe
from hqp_rp.scenarios.sawyer_tilted_wipe import SawyerTiltedWipe
from hqp_rp.scenarios.scenario import Step


def run(scenario: SawyerTiltedWipe) -> list[Step]:
    case = scenario.cases()[0]
    return list(scenario.run_case(case, scenario.contact_arm(case), get_solver("reverse_priority"), 0))


def column(steps: list[Step], name: str) -> FloatArray:
    return np.array([step.measured[name] for step in steps])


def test_the_selection_is_a_projector_along_the_wall_and_not_diagonal() -> None:
    scenario = SawyerTiltedWipe()
    case = scenario.cases()[0]
    press = scenario.experiment(case, scenario.contact_arm(case).robot).stack.levels[0][0]
    S = press.selection  # type: ignore[union-attr]
    n = np.array((np.cos(0.6), np.sin(0.6), 0.0))
    np.testing.assert_allclose(S, np.eye(3) - np.outer(n, n), atol=1e-15)
    assert abs(S[0, 1]) > 0.1
    np.testing.assert_allclose(press.force, 30.0 * n)  # type: ignore[union-attr]


def test_it_presses_and_follows_and_friction_costs_what_the_spring_says() -> None:
    free, rubbed = (run(SawyerTiltedWipe(duration=2.0, friction=mu, substeps=4)) for mu in (0.0, 0.3))
    for steps in (free, rubbed):
        assert np.abs(column(steps, "force x [N]")[-300:] - 30.0).max() < 0.5
    assert np.abs(column(free, "position error along [m]")).max() < 2e-3
    off = np.abs(column(rubbed, "position error along [m]")).max()
    assert off == pytest.approx(0.3 * 30.0 / 375.0, rel=0.1)  # F / K_d, K_d = B_d^2 / (4 M_d)


def test_hard_limits_reach_the_problem_and_nothing_is_shortened() -> None:
    scenario = SawyerHybridWipe(duration=0.02, hard_limits=True)
    case = scenario.cases()[1]
    steps = list(scenario.run_case(case, scenario.contact_arm(case), get_solver("hierarchical_active_set"), 0))
    assert all(step.problem.hard is not None for step in steps)
    assert all(step.measured["shortened to"] > 1.0 - 1e-9 for step in steps)


def test_several_frequencies_are_added() -> None:
    scenario = SawyerForceTracking(duration=0.02, frequencies=(0.5, 2.0), amplitude=3.0)
    t = 0.3
    assert scenario.desired(t) == pytest.approx(30.0 + 3.0 * (np.sin(np.pi * t) + np.sin(4.0 * np.pi * t)))
    for wrong in ((), (0.0,), (-1.0,)):
        with pytest.raises(SettingError, match="frequencies of sawyer_force_tracking"):
            SawyerForceTracking(frequencies=wrong)
