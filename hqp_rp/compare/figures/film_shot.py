"""What a film is made of: shots, and what a simulated one recorded."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from hqp_rp.compare.contestants import Contestant
from hqp_rp.core.errors import HqpError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.solution import Status
from hqp_rp.scenarios._interaction import Case, Interaction


@dataclasses.dataclass(frozen=True, slots=True)
class Shot:
    """One run in a film: a case of a scenario with a contestant; `title` says what to see, else the contestant's label."""

    scenario: Interaction
    case: Case
    contestant: Contestant
    seed: int = 0
    title: str = ""


@dataclasses.dataclass(frozen=True, slots=True)
class Run:
    """What a shot recorded: time (k,) s, q (k, n) rad, and force and desired force (k,) N for the axis of each wall."""

    shot: Shot
    time: FloatArray
    q: FloatArray
    force: Mapping[str, FloatArray]
    desired: Mapping[str, FloatArray]
    complete: bool
    """Whether it came to the end of the case; no solver failed."""

    def at(self, time: float) -> int:
        """The step that ends at a time, s, or the last."""
        return min(max(round(time / self.shot.scenario.period) - 1, 0), len(self.time) - 1)


def record(shot: Shot) -> Run:
    """Simulate a shot; `HqpError` when it has no step to show."""
    scenario, case = shot.scenario, shot.case
    contact = scenario.contact_arm(case, shot.seed)
    solver = dataclasses.replace(shot.contestant.solver)
    time, q, measured, refused = [], [], [], False
    for step in scenario.run_case(case, contact, solver, shot.seed):
        time.append(step.parameter + scenario.period)
        q.append(np.array(contact.robot.data.qpos))
        measured.append(step.measured)
        refused = step.solution.status is Status.REFUSED
        if refused:
            break
    if not measured:
        raise HqpError(f"{shot.contestant.label} ends {scenario.name}, {case.name}, before its first step: no film.")
    axes = [name.split()[2] for name in measured[0] if name.startswith("desired force")]
    force, desired = (
        {axis: np.array([float(m[f"{what} {axis} [N]"]) for m in measured]) for axis in axes}
        for what in ("force", "desired force")
    )
    return Run(shot, np.array(time), np.array(q), force, desired, len(time) == scenario.periods() and not refused)


def telling(runs: Sequence[Run], period: float, end: float) -> float:
    """s: when the forces differ most."""

    def spread(time: float) -> float:
        steps = [(run, run.at(time)) for run in runs]
        largest = 0.0
        for axis in runs[0].force:
            values = [run.force[axis][k] for run, k in steps if axis in run.force]
            if len(values) == 1:
                values.append(runs[0].desired[axis][steps[0][1]])
            largest = max(largest, float(max(values) - min(values)))
        return largest

    times: list[float] = np.arange(period, end + 0.5 * period, period).tolist()
    return max(times, key=spread)
