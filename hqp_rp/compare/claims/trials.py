"""One run of one experiment as a row of figures, and many of them over all cores, kept so that a stopped study goes on."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl

from hqp_rp.compare.claims.contact_figures import case_steps, contact_figures
from hqp_rp.compare.claims.methods import Method
from hqp_rp.compare.claims.response_figures import push_figures, tracking_figures
from hqp_rp.compare.machine import usable_cores
from hqp_rp.compare.run_folder import RunFolder, digest
from hqp_rp.compare.workers import in_processes, progress_bar
from hqp_rp.scenarios._interaction import Interaction, Place
from hqp_rp.scenarios.sawyer_force_tracking import SawyerForceTracking
from hqp_rp.scenarios.sawyer_push_response import SawyerPushResponse

_BLOCK = 10_000  # control periods in one block: some seconds
_ERRORS = ("rms", "late_rms", "overshoot", "position", "translation", "rotation")
_SETTINGS = (
    "servo",
    "stiffness",
    "delay",
    "noise",
    "friction",
    "damping_ratio",
    "hard_limits",
    "first",
    "travel",
    "metric",
)


@dataclasses.dataclass(frozen=True)
class Trial:
    """One run.

    Attributes:
        experiment: which. scenario: with every setting that the experiment varies. gains: `PAPER` or `DAMPED`.
        place: where it starts; posture: its number. method: who solves. seed: of noise and offset; 0 for none.
    """

    experiment: str
    scenario: Interaction
    gains: str
    place: Place
    posture: int
    method: Method
    seed: int

    @property
    def key(self) -> str:
        """Words that stand for the run."""
        place = [None if a is None else a.tolist() for a in (self.place.q, self.place.approach, self.place.direction)]
        parts = (self.scenario, self.gains, place, self.place.distance, self.method, self.seed)
        return f"{self.experiment} {self.posture} {parts!r}"

    @property
    def length(self) -> int:
        """Control periods."""
        return self.scenario.periods()

    def steps(self) -> pl.DataFrame:
        """One row for each control period; see `case_steps`."""
        case = self.scenario.case_at(self.gains, self.place)
        return case_steps(self.scenario, case, self.method.label, self.method.solver, self.seed)


def settings_of(trial: Trial) -> dict[str, Any]:
    """What a run was, column by column; a recovery of -1 is none."""
    scenario = trial.scenario
    found: dict[str, Any] = {
        "experiment": trial.experiment,
        "scenario": type(scenario).name,
        "gains": trial.gains,
        "place": trial.place.name,
        "posture": trial.posture,
        "seed": trial.seed,
        "method": trial.method.label,
        "damping": trial.method.damping,
        "recovery": -1.0 if scenario.recovery is None else scenario.recovery,
    }
    return found | {name: getattr(scenario, name) for name in _SETTINGS if hasattr(scenario, name)}


def row(trial: Trial, steps: pl.DataFrame) -> dict[str, Any]:
    """What the run was and what it came to; figures of the wall across x, and of y as "... y".

    A run that its solver ended before the end is as far off as can be: infinitely.
    """
    found = _figures(trial, steps)
    return found if found["whole"] else found | {name: math.inf for name in _ERRORS if found.get(name) is not None}


def _figures(trial: Trial, steps: pl.DataFrame) -> dict[str, Any]:
    scenario = trial.scenario
    found = settings_of(trial) | {"whole": steps.height == scenario.periods()}
    if isinstance(scenario, SawyerPushResponse):
        found |= push_figures(steps)
        found["commanded"] = float(np.max(steps["commanded speed [rad/s]"].to_numpy()))
        return found
    for figures in contact_figures(steps):
        own = dataclasses.asdict(figures)
        end = "" if figures.axis == "x" else f" {figures.axis}"
        found |= {
            f"{name}{end}": value
            for name, value in own.items()
            if name not in ("scenario", "case", "contestant", "axis", "ended")
        }
    if isinstance(scenario, SawyerForceTracking):
        time, force = steps["time"].to_numpy(), steps["force x [N]"].to_numpy()
        if (time[-1] - time[0]) * min(scenario.frequencies) > 1.0:
            fitted = tracking_figures(time, force, scenario.frequencies, scenario.amplitude)
            for k, (frequency, (gain, lag)) in enumerate(zip(scenario.frequencies, fitted, strict=True)):
                found |= {f"frequency {k}": frequency, f"gain {k}": gain, f"lag {k}": lag}
    return found


def run_trials(
    trials: Sequence[Trial], folder: RunFolder, *, made_with: str = "", workers: int | None, progress: bool
) -> pl.DataFrame:
    """A row for each trial, in their order; blocks of them are kept in `folder` as soon as they are finished.

    Blocks that were kept with another `made_with`, versions for instance, are made anew.
    """
    ordered = sorted(range(len(trials)), key=lambda i: -trials[i].length)  # long ones first: no core waits at the end
    blocks: list[list[Trial]] = []
    room = 0
    for i in ordered:
        if trials[i].length > room:
            blocks.append([])
            room = max(_BLOCK, trials[i].length)
        blocks[-1].append(trials[i])
        room -= trials[i].length
    keys = [digest(made_with, *(trial.key for trial in block)) for block in blocks]
    left = [i for i, key in enumerate(keys) if not folder.has(key)]
    lengths = [sum(trial.length for trial in block) for block in blocks]
    with progress_bar(progress, sum(lengths), sum(lengths) - sum(lengths[i] for i in left), "periods") as advance:
        processes = min(workers or usable_cores(), max(len(left), 1))
        for done, frame in in_processes(_block, [blocks[i] for i in left], processes):
            i = left[done]
            folder.save(keys[i], frame)
            advance(lengths[i], blocks[i][0].experiment)
    frames = [folder.load([key]) for key in keys]
    together = pl.concat(frames, how="diagonal_relaxed")
    place = pl.Series(np.argsort(ordered, kind="stable"))
    return together.select(pl.all().gather(place))


def _block(block: Sequence[Trial]) -> pl.DataFrame:
    return pl.DataFrame([row(trial, trial.steps()) for trial in block], infer_schema_length=None)
