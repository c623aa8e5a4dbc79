"""A whole study without a simulation: every trial of the plan with figures made up, which a test may change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import polars as pl

from hqp_rp.compare.claims.experiments import BODE, SINE, Places, trials
from hqp_rp.compare.claims.trials import Trial, settings_of
from hqp_rp.robot.arms import sawyer
from hqp_rp.scenarios._interaction import REGULAR, SINGULAR, Place
from hqp_rp.scenarios.sawyer_force_tracking import AS_PRINTED
from hqp_rp.scenarios.sawyer_hybrid_wipe import SawyerHybridWipe

GOOD: dict[str, Any] = {
    "whole": True,
    "rms": 2.0,
    "late_rms": 0.1,
    "peak": 31.0,
    "overshoot": 1.0,
    "contact": 1.0,
    "position": 1e-3,
    "orientation": 1e-2,
    "commanded": 0.5,
    "first_level": 1e-15,
    "translation": 0.01,
    "rotation": 0.01,
    **{f"off {axis}": 0.01 for axis in ("x", "y", "z", "rx", "ry", "rz")},
    **{f"gain {k}": 1.0 for k in range(len(BODE))},
    **{f"lag {k}": 0.001 for k in range(len(BODE))},
}
"""What every run comes to; reverse priority is better, see `made_up`."""


def places(count: int) -> Places:
    """Places that nobody searched for: the same posture `count` times."""
    q, turned = np.array(sawyer().neutral), np.full(7, 0.1)
    regular = [Place(REGULAR, q, direction=np.array((0.0, 1.0))) for _ in range(count)]
    beside = [Place(SINGULAR, q, turned, np.array((0.0, 1.0)), 0.1) for _ in range(count)]
    center, direction, axis = SawyerHybridWipe().arm().neutral, turned, np.array((0.0, 0.0, 1.0))
    through = [Place(SINGULAR, np.array(center), direction, axis) for _ in range(count)]
    return Places(regular, beside, through, beside)


Change = Callable[[dict[str, Any]], dict[str, Any]]


def made_up(*changes: Change, quick: bool = False, count: int = 20) -> pl.DataFrame:
    """A row for every trial. Reverse priority, damped or not, has 0.8 of the force error of the others and overshoots less
    with more damping; each change gets a row's settings and returns what is otherwise in it."""
    return pl.DataFrame(
        [_row(trial, changes) for trial in trials(places(count), quick=quick)], infer_schema_length=None
    )


def _row(trial: Trial, changes: Sequence[Change]) -> dict[str, Any]:
    row = settings_of(trial) | GOOD
    row["frequency 0"] = SINE if trial.experiment.startswith("tracking sin") else AS_PRINTED
    if not row["method"].startswith("reverse"):
        row["rms"] = 2.5
    if trial.experiment == "B_d":
        row["overshoot"] = 0.5
    for change in changes:
        row |= change(row)
    return row
