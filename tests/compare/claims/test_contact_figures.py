"""Figures of a contact from made-up forces whose figures are known, and from a short run."""

from __future__ import annotations

import math

import numpy as np
import polars as pl
import pytest

from hqp_rp import get_solver
from hqp_rp.compare.claims.contact_figures import case_steps, contact_figures
from hqp_rp.scenarios.sawyer_force_tracking import SawyerForceTracking


def made_up(force: list[float], contact: list[float] | None = None, **columns: list[float]) -> pl.DataFrame:
    n = len(force)
    share = contact or [1.0 if value > 0.0 else 0.0 for value in force]
    return pl.DataFrame(
        {
            "scenario": ["s"] * n,
            "case": ["c"] * n,
            "contestant": ["k"] * n,
            "seed": [0] * n,
            "time": [0.1 * i for i in range(n)],
            "status": ["SOLVED"] * n,
            "level 1 miss": [0.0] * n,
            "force x [N]": force,
            "desired force x [N]": [10.0] * n,
            "peak force x [N]": [1.5 * value for value in force],
            "contact x": share,
            "energy x [J]": [float(i) for i in range(n)],
            "commanded speed [rad/s]": [2.0] * n,
            "measured speed [rad/s]": [1.0] * n,
            "shortened to": [1.0] * (n - 1) + [0.5],
        }
        | columns
    )


def test_known_figures() -> None:
    (f,) = contact_figures(made_up([0.0, 0.0, 12.0, 8.0, 10.4, 10.0]))
    errors = np.array([2.0, -2.0, 0.4, 0.0])
    assert f.rms == pytest.approx(math.sqrt(np.mean(errors**2)))
    assert f.late_rms == pytest.approx(math.sqrt(np.mean(errors[-2:] ** 2)))
    assert (f.peak, f.overshoot) == (pytest.approx(18.0), pytest.approx(8.0))
    assert f.settling == pytest.approx(0.2)  # from 0.2 s on, within 0.5 N from 0.4 s on
    assert f.contact == 1.0
    assert f.energy == 5.0
    assert f.shortened == pytest.approx(1.0 / 6.0)
    assert (f.commanded, f.measured, f.final) == (2.0, 1.0, 0.0)
    assert (f.position, f.orientation, f.drift, f.ended) == (None, None, None, "")


def test_what_never_settles_or_never_touches_has_no_such_figure() -> None:
    (f,) = contact_figures(made_up([10.0, 10.0, 11.0]))
    assert f.settling is None
    (f,) = contact_figures(made_up([0.0, 0.0, 0.0]))
    assert (f.rms, f.settling, f.contact) == (None, None, None)
    assert f.late_rms == pytest.approx(10.0)
    (f,) = contact_figures(made_up([10.0, 10.1, 9.9]))
    assert f.settling == 0.0


def test_bounces_count_in_the_share_of_contact_and_position_errors_take_the_worst_axis() -> None:
    steps = made_up(
        [0.0, 4.0, 0.0, 4.0, 4.0],
        [0.0, 0.2, 0.0, 0.5, 1.0],
        **{"position error y [m]": [0.0, -0.3, 0.0, 0.0, 0.1], "position error z [m]": [0.2, 0.0, 0.0, 0.0, 0.0]},
    )
    (f,) = contact_figures(steps)
    assert f.contact == pytest.approx(0.5)
    assert f.position == pytest.approx(0.3)
    failed = steps.with_columns(pl.Series("status", ["SOLVED"] * 4 + ["NOT_FINITE"]))
    assert contact_figures(failed)[0].ended == "NOT_FINITE"


def test_a_run_gives_one_row_for_each_wall() -> None:
    scenario = SawyerForceTracking(duration=0.02)
    case = scenario.cases()[1]
    steps = case_steps(scenario, case, "null space", get_solver("null_space"))
    figures = contact_figures(steps)
    assert [(f.axis, f.case, f.contestant) for f in figures] == [(axis, case.name, "null space") for axis in "xy"]
    assert all(f.first_level < 1e-9 for f in figures)
    assert all(f.drift is not None and f.position is None for f in figures)
