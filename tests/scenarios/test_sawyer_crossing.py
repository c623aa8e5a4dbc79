"""The Sawyer crossing: what its singular configuration is, and that the path goes through it."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp.core.diagnostics import Singularity
from hqp_rp.core.errors import SettingError
from hqp_rp.robot.arms import sawyer
from hqp_rp.scenarios.sawyer_crossing import SawyerCrossing, find_crossing
from tests.scenarios.crossings import nominal


def test_the_search_remakes_the_stored_constants() -> None:
    place = find_crossing()
    singular, direction, axis = SawyerCrossing().crossing()
    np.testing.assert_allclose(place.q, singular, atol=1e-7)
    np.testing.assert_allclose(place.approach * np.sign(place.approach @ direction), direction, atol=1e-6)
    np.testing.assert_allclose(place.task_direction, axis, atol=1e-6)
    assert place.kind is Singularity.ALGORITHMIC
    assert place.is_edge
    assert place.own_sigma > 0.7
    assert place.earlier_sigma > 0.13
    with pytest.raises(SettingError, match=r"starts is 1, margin is 3\.0"):
        find_crossing(starts=1, margin=3.0)


def test_the_configuration_is_an_algorithmic_and_no_kinematic_singularity() -> None:
    """From the arm's own closed-form kinematics, by ranks alone: rank 3 and rank 3 make rank 5 (equation (12))."""
    jacobian = sawyer().jacobian(SawyerCrossing().crossing()[0])
    position, orientation, both = (np.linalg.svd(J, compute_uv=False) for J in (jacobian[:3], jacobian[3:], jacobian))
    assert position[-1] > 0.1 * position[0]
    assert orientation[-1] > 0.5 * orientation[0]
    assert both[4] > 0.05 * both[0]
    assert both[5] < 1e-14 * both[0]


def test_the_path_goes_through_the_singularity_and_out_again() -> None:
    scenario = SawyerCrossing()
    spectra = nominal(scenario)
    middle = scenario.periods() // 2
    for k, (position, orientation) in enumerate(spectra):
        assert position.singularity is Singularity.NONE
        assert position.sigma_min > 0.1
        assert orientation.own_rank == 3
        assert (orientation.singularity is Singularity.NONE) == (k != middle)
    assert spectra[middle][1].singularity is Singularity.ALGORITHMIC
    sigma = np.array([orientation.sigma_min for _, orientation in spectra])
    assert sigma[middle] < 1e-12
    assert (np.diff(sigma[: middle + 1]) < 0.0).all()
    assert (np.diff(sigma[middle:]) > 0.0).all()
    assert sigma[0] > 0.3
    assert sigma[-1] > 0.3
    assert sigma[middle - 10] / 10 == pytest.approx(sigma[middle - 1], rel=0.05)
    assert sigma[middle + 10] / 10 == pytest.approx(sigma[middle + 1], rel=0.05)


def test_the_tool_can_be_turned_no_further_about_the_lost_axis() -> None:
    """A long search for more turn, tool held where it is, on Newton steps from many postures near by."""
    arm, (singular, _, axis) = sawyer(), SawyerCrossing().crossing()
    rotation, position = arm.pose(singular)
    rng = np.random.default_rng(0)
    across = np.linalg.svd(axis[None])[2][1:]
    best = -np.inf
    for q in singular + rng.normal(scale=0.15, size=(60, 7)):
        for _ in range(30):
            now, p = arm.pose(q)
            beyond = now @ rotation.T
            turn = 0.5 * np.array(
                [beyond[2, 1] - beyond[1, 2], beyond[0, 2] - beyond[2, 0], beyond[1, 0] - beyond[0, 1]]
            )
            J = arm.jacobian(q)
            held = np.vstack([J[:3], across @ J[3:]])
            miss = np.concatenate([p - position, across @ turn])
            q = q - np.linalg.pinv(held) @ miss
        if np.linalg.norm(miss) < 1e-10:
            best = max(best, float(axis @ turn))
    assert -0.02 < best < 1e-9
