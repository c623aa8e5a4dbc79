"""The push: its ideal is the law's exact response, stiff servos come near it, and near the default ones rotation does not."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import get_solver
from hqp_rp.control.admittance import AdmittanceLaw
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.scenarios._interaction import PAPER, Place
from hqp_rp.scenarios.sawyer_push_response import SawyerPushResponse
from hqp_rp.scenarios.scenario import Step, all_scenarios


def run(scenario: SawyerPushResponse, seed: int = 0) -> list[Step]:
    case = scenario.cases()[0]
    return list(scenario.run_case(case, scenario.contact_arm(case, seed), get_solver("reverse_priority"), seed))


def column(steps: list[Step], name: str) -> FloatArray:
    return np.array([step.measured[name] for step in steps])


def test_it_is_found_by_name() -> None:
    assert all_scenarios()["sawyer_push_response"] is SawyerPushResponse
    assert not SawyerPushResponse.by_default


def test_the_ideal_is_the_closed_form_of_a_critically_damped_law() -> None:
    """e(t) = F / K (1 - (1 + w t) exp(-w t)), w = sqrt(K / M), while the push lasts."""
    scenario = SawyerPushResponse(duration=1.0)
    gains = scenario.gains(scenario.cases()[0], "")
    ideal = scenario.ideal(AdmittanceLaw(6, gains.M_d, gains.B_d, gains.K_d))
    t = scenario.period * np.arange(len(ideal))
    half = len(t) // 2
    w = np.sqrt(gains.K_d / gains.M_d)
    push = scenario.push(0.0)
    expected = push / gains.K_d * (1.0 - (1.0 + np.outer(t, w)) * np.exp(-np.outer(t, w)))
    np.testing.assert_allclose(ideal[: half + 1], expected[: half + 1], atol=1e-12)
    assert (scenario.push(0.6) == 0.0).all()


@pytest.mark.parametrize("first", ["x", "rotation"])
@pytest.mark.parametrize("travel", [0.0, 0.1])
def test_stiff_servos_follow_the_ideal_whatever_is_first(first: str, travel: float) -> None:
    steps = run(SawyerPushResponse(duration=0.6, servo=100.0, first=first, travel=travel))
    for axis in ("x", "y", "z"):
        deviation, ideal = column(steps, f"deviation {axis}"), column(steps, f"ideal {axis}")
        assert np.abs(ideal).max() > 5e-3
        assert np.abs(deviation - ideal).max() < 0.02 * np.abs(ideal).max() + 0.01 * travel


def test_default_servos_yield_in_rotation() -> None:
    steps = run(SawyerPushResponse(duration=0.6))
    off = np.abs(column(steps, "deviation rz") - column(steps, "ideal rz")).max()
    assert off > np.abs(column(steps, "ideal rz")).max()


def test_another_place_is_another_start() -> None:
    scenario = SawyerPushResponse(duration=0.01)
    place = Place("regular", np.full(7, 0.3), np.full(7, 1.0), None, 0.1)
    case = scenario.case_at(PAPER, place)
    np.testing.assert_allclose(case.q, 0.4)
    np.testing.assert_allclose(scenario.contact_arm(case).robot.data.qpos, 0.4)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"first": "y"}, r"first of sawyer_push_response is 'y'; it must be one of x, rotation"),
        ({"travel": -0.1}, r"travel of sawyer_push_response is -0\.1"),
        ({"servo": 0.0}, r"servo of sawyer_push_response is 0\.0; it must be a finite number > 0"),
        ({"delay": -1.0}, r"delay of sawyer_push_response is -1\.0"),
        ({"hard_limits": 1}, r"hard_limits of sawyer_push_response is 1; it must be True or False"),
        ({"recovery": -1.0}, r"recovery of sawyer_push_response is -1\.0"),
    ],
)
def test_settings_out_of_range_are_refused(settings: dict[str, object], message: str) -> None:
    with pytest.raises(SettingError, match=message):
        SawyerPushResponse(**settings)  # type: ignore[arg-type]
