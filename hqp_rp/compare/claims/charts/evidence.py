"""Every chart of the report, section by section."""

from __future__ import annotations

from hqp_rp.compare.claims.charts.curves import Curves
from hqp_rp.compare.claims.charts.levels import three_levels
from hqp_rp.compare.claims.charts.near import conflict_curves, corner_curves, shortened_or_told, sweep, wipe_curves
from hqp_rp.compare.claims.charts.response import bode, push_curves, push_dots, tilted_curves, tracking_curves
from hqp_rp.compare.claims.charts.wall import delay_map, servo_map, wall_curves
from hqp_rp.compare.claims.experiments import (
    CONFLICT,
    DELAY_MAP,
    LIMITED_CONFLICT,
    LIMITED_CORNER,
    NEAR,
    PUSH,
    SERVO_MAP,
    STIFF_SERVO,
    SWEEP_OF_SINES,
    WIPE,
)
from hqp_rp.compare.claims.judges.study import Study
from hqp_rp.compare.figures.chart import Chart
from hqp_rp.scenarios._interaction import DAMPED, PAPER


def evidence(study: Study, curves: Curves) -> dict[str, list[Chart]]:
    """Title of a section -> its charts; those whose experiments were not run are left out."""
    has = study.has
    found: dict[str, list[Chart]] = {
        "Pushed": [push_curves(curves), *([push_dots(study)] if has(PUSH) else [])],
        "Tracking": [tracking_curves(curves), bode(study)] if has(SWEEP_OF_SINES) else [],
        "At the wall": [wall_curves(curves)],
        "Beside singularities": [corner_curves(curves), wipe_curves(curves), conflict_curves(curves)],
        "Three levels": [tilted_curves(curves), *([three_levels(study)] if has(WIPE, CONFLICT) else [])],
    }
    if has(SERVO_MAP, DELAY_MAP):
        found["At the wall"] += [
            servo_map(study),
            delay_map(study, STIFF_SERVO, PAPER),
            delay_map(study, STIFF_SERVO, DAMPED),
            delay_map(study, 1.0, PAPER),
        ]
    if has(*NEAR):
        found["Beside singularities"] += [sweep(study, name) for name in NEAR]
    if has(LIMITED_CORNER, LIMITED_CONFLICT):
        found["Beside singularities"].append(shortened_or_told(study))
    return {title: charts for title, charts in found.items() if charts}
