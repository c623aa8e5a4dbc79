"""Gain and lag of made-up forces, and the distance of a made-up response from its ideal."""

from __future__ import annotations

import math

import numpy as np
import polars as pl
import pytest

from hqp_rp.compare.claims.response_figures import push_figures, tracking_figures
from hqp_rp.control._checks import TWIST_AXES

PERIOD = 0.002


def test_gain_and_lag_of_several_frequencies_at_once() -> None:
    known = {0.1: (0.9, 0.05), 0.5: (1.1, 0.03), 2.0: (0.5, 0.1)}
    time = PERIOD * np.arange(round(10.5 / PERIOD))
    at = time + PERIOD  # a row's force is that of the end of its period
    force = 30.0 + sum(4.0 * gain * np.sin(2.0 * math.pi * f * (at - lag)) for f, (gain, lag) in known.items())
    force[time < 0.2] = 0.0  # the transient is not looked at
    found = tracking_figures(time, force, tuple(known), 4.0)
    np.testing.assert_allclose(found, list(known.values()), rtol=1e-6)


def test_a_constant_force_and_a_ramp_have_no_gain() -> None:
    time = PERIOD * np.arange(round(40.0 / PERIOD))
    for force in (np.full(len(time), 33.0), np.linspace(30.0, 31.0, len(time))):
        ((gain, _),) = tracking_figures(time, force, (0.0507,), 5.0)
        assert gain < 0.1


def test_distance_from_the_ideal_by_axis() -> None:
    ideal = np.array([0.0, 1.0, 2.0])
    columns = {f"ideal {axis}": ideal for axis in TWIST_AXES} | {f"deviation {axis}": ideal for axis in TWIST_AXES}
    columns["deviation y"] = np.array([0.0, 1.5, 2.0])
    columns["deviation rz"] = np.array([0.0, 1.0, -2.0])
    found = push_figures(pl.DataFrame(columns))
    assert found["off x"] == 0.0
    assert found["off y"] == pytest.approx(0.25)
    assert found["translation"] == pytest.approx(0.25)
    assert found["rotation"] == pytest.approx(2.0)
    assert found["moved rz"] == pytest.approx(2.0)
