"""A run against walls, step by step, and boiled down to one row of figures for each wall."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import polars as pl

from hqp_rp.core.diagnostics import norm
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.solution import Status
from hqp_rp.core.solver import Solver
from hqp_rp.scenarios._interaction import Case, Interaction

SETTLED = 0.05
"""The force has settled when it stays within this share of the desired one."""
_ROUNDING = 1e-9  # a hard row at its bound is shortened by a rounding error
LATE = 1.0 / 3.0
"""The last part of a case, in which "late" figures are taken."""


def case_steps(scenario: Interaction, case: Case, label: str, solver: Solver, seed: int = 0) -> pl.DataFrame:
    """One row for each step: scenario, case, contestant, seed, time (s), status, "level 1 miss", and what was measured.

    "level 1 miss" is |J_1 x - v_1| as solved, before the command is shortened, in the unit of the first level.
    """
    fresh = dataclasses.replace(solver)  # workspaces and warm starts of its own
    rows: list[dict[str, Any]] = []
    for step in scenario.run_case(case, scenario.contact_arm(case, seed), fresh, seed):
        x, first = step.solution.x, step.problem.levels[0]
        rows.append(
            {
                "scenario": type(scenario).name,
                "case": step.case,
                "contestant": label,
                "seed": seed,
                "time": step.parameter,
                "status": step.solution.status.name,
                "level 1 miss": None if x is None else norm(first.A @ x - first.lower),
                **step.measured,
            }
        )
    return pl.DataFrame(rows, infer_schema_length=None)


@dataclasses.dataclass(frozen=True, slots=True)
class ContactFigures:
    """What one run says about one wall. Forces in N; None where nothing was touched, or it never settled.

    Attributes:
        scenario, case, contestant, axis: which run and which wall.
        ended: "" or the status with which the solver failed before the end.
        rms, late_rms: root mean square of F_e - F_d, from the first contact on and in the last third.
        peak: largest F_e at any simulation step. overshoot: by how much it exceeds the largest F_d; 0 where it does not.
        settling: s, from the first contact until |F_e - F_d| stays within 5 % of F_d.
        contact: share of the simulation steps in contact, from the period after the first contact on.
        energy: J, work done on the wall.
        position: m, largest position error over the measured axes; None where there is no such task.
        orientation: rad, likewise. drift: m, likewise.
        commanded, measured: rad/s, largest |x| that was asked for and largest |dq/dt| that came of it.
        shortened: share of the periods in which the velocity limits shortened x.
        first_level: largest |J_1 x - v_1|, m/s.
        final: N, F_e - F_d at the end.
    """

    scenario: str
    case: str
    contestant: str
    axis: str
    ended: str
    rms: float | None
    late_rms: float
    peak: float
    overshoot: float
    settling: float | None
    contact: float | None
    energy: float
    position: float | None
    orientation: float | None
    drift: float | None
    commanded: float
    measured: float
    shortened: float
    first_level: float
    final: float


def contact_figures(steps: pl.DataFrame) -> list[ContactFigures]:
    """The figures of every run in `case_steps`' frame, in the order in which they were run."""
    keys = ("scenario", "case", "contestant")
    found = []
    for names, part in steps.group_by(*keys, maintain_order=True):
        for axis in ("x", "y"):
            label = f"force {axis} [N]"
            if label in part.columns and part[label].null_count() < part.height:
                found.append(_figures(dict(zip(keys, map(str, names), strict=True)), axis, part))
    return found


def _figures(which: dict[str, str], axis: str, part: pl.DataFrame) -> ContactFigures:
    force, desired = _column(part, f"force {axis} [N]"), _column(part, f"desired force {axis} [N]")
    peak, contact = _column(part, f"peak force {axis} [N]"), _column(part, f"contact {axis}")
    time, error = _column(part, "time"), force - desired
    touched = np.flatnonzero(contact > 0.0)
    first = int(touched[0]) if touched.size else None
    after = None if first is None else error[first:]
    late = error[len(error) - max(1, int(LATE * len(error))) :]
    failed = part.filter(~pl.col("status").is_in((Status.SOLVED.name, Status.INACCURATE.name)))["status"]
    return ContactFigures(
        **which,
        axis=axis,
        ended=str(failed[0]) if failed.len() else "",
        rms=None if after is None else _rms(after),
        late_rms=_rms(late),
        peak=float(peak.max()),
        overshoot=max(0.0, float(peak.max() - desired.max())),
        settling=None if first is None else _settling(time[first:], error[first:], SETTLED * np.abs(desired[first:])),
        contact=None if first is None else float(contact[min(first + 1, len(contact) - 1) :].mean()),
        energy=float(_column(part, f"energy {axis} [J]")[-1]),
        position=_largest(part, "position error"),
        orientation=_largest(part, "orientation error"),
        drift=_largest(part, "drift"),
        commanded=float(_column(part, "commanded speed [rad/s]").max()),
        measured=float(_column(part, "measured speed [rad/s]").max()),
        shortened=float((_column(part, "shortened to") < 1.0 - _ROUNDING).mean()),
        first_level=float(_column(part, "level 1 miss").max()),
        final=float(error[-1]),
    )


def _column(part: pl.DataFrame, name: str) -> FloatArray:
    return np.asarray(part[name].cast(pl.Float64).drop_nulls().to_numpy(), dtype=np.float64)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _largest(part: pl.DataFrame, start: str) -> float | None:
    names = [name for name in part.columns if name.startswith(start) and part[name].null_count() < part.height]
    return max((float(np.abs(_column(part, name)).max()) for name in names), default=None)


def _settling(time: FloatArray, error: FloatArray, band: FloatArray) -> float | None:
    outside = np.flatnonzero(np.abs(error) > band)
    if not outside.size:
        return 0.0
    last = int(outside[-1])
    return None if last + 1 == len(time) else float(time[last + 1] - time[0])
