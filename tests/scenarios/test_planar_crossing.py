"""The planar crossing against what geometry says of a four-link chain."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from hqp_rp.core.diagnostics import Singularity
from hqp_rp.scenarios.planar_crossing import PlanarCrossing
from tests.scenarios.crossings import nominal

LENGTH = 0.4


def shortfall(scenario: PlanarCrossing) -> np.ndarray:
    """(N + 1,) m: by how much links 1, 3, 4 in line fail to reach from the turned link 2 to the tool; > 0: out of reach."""
    path = scenario.path()
    second = LENGTH * path.rotation[:, :2, 0]
    return np.asarray(np.linalg.norm(path.position[:, :2] - second, axis=1) - 3.0 * LENGTH)


def test_the_path_goes_through_an_algorithmic_singularity_and_out_again() -> None:
    scenario = PlanarCrossing()
    spectra = nominal(scenario)
    middle = scenario.periods() // 2
    first, second = spectra[middle]
    assert (first.own_rank, second.own_rank, second.rank) == (2, 1, 0)
    assert second.singularity is Singularity.ALGORITHMIC
    assert second.sigma_min < 1e-14
    for k, (tool, link) in enumerate(spectra):
        assert tool.singularity is Singularity.NONE
        assert tool.sigma_min > 0.2
        assert link.own_rank == 1
        assert (link.singularity is Singularity.NONE) == (k != middle)
    sigma = np.array([link.sigma_min for _, link in spectra])
    assert (np.diff(sigma[: middle + 1]) < 0.0).all()
    assert (np.diff(sigma[middle:]) > 0.0).all()
    assert sigma[0] > 0.1
    assert sigma[-1] > 0.1
    # It falls and rises in proportion to the time left and gone.
    assert sigma[middle - 10] / 10 == pytest.approx(sigma[middle - 1], rel=0.05)
    assert sigma[middle + 10] / 10 == pytest.approx(sigma[middle + 1], rel=0.05)


def test_links_1_3_and_4_are_in_line_at_the_crossing() -> None:
    angles = np.cumsum(PlanarCrossing().crossing()[0])
    np.testing.assert_allclose(angles[[0, 2, 3]], angles[0], atol=1e-15)
    assert abs(np.sin(angles[1] - angles[0])) > 0.9


def test_without_demand_the_path_touches_the_edge_of_what_can_be_reached_once() -> None:
    scenario = PlanarCrossing(demand=0.0)
    miss = shortfall(scenario)
    middle = scenario.periods() // 2
    assert abs(miss[middle]) < 1e-12
    assert (np.delete(miss, middle) < 0.0).all()


def test_the_demand_goes_beyond_the_edge_and_comes_back() -> None:
    scenario = PlanarCrossing()
    miss = shortfall(scenario)
    beyond = np.flatnonzero(miss > 0.0)
    assert scenario.periods() // 2 in beyond
    assert np.array_equal(beyond, np.arange(beyond[0], beyond[-1] + 1))
    assert 0.1 * scenario.periods() < len(beyond) < 0.5 * scenario.periods()
    # To first order the shortfall is L sin(turn) per rad of demand.
    np.testing.assert_allclose(miss[scenario.periods() // 2], LENGTH * np.sin(1.2) * scenario.demand, rtol=0.05)


def test_turning_the_axis_round_asks_for_what_can_be_reached() -> None:
    class Back(PlanarCrossing):
        def crossing(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            center, direction, axis = super().crossing()
            return center, direction, -axis

    assert shortfall(Back())[1:-1].max() < 0.0


def test_quick_asks_the_same_on_longer_periods() -> None:
    scenario = PlanarCrossing(demand=0.02, posture_gain=50.0)
    quick = scenario.quick()
    assert quick.period == pytest.approx(4.0 * scenario.period)
    assert quick.period / quick.substeps == pytest.approx(scenario.period / scenario.substeps)
    assert dataclasses.replace(quick, period=scenario.period, substeps=scenario.substeps) == scenario
    np.testing.assert_allclose(quick.path().q, scenario.path().q[::4], atol=1e-12)
    assert PlanarCrossing(position_gain=400.0).quick().position_gain == pytest.approx(100.0)
