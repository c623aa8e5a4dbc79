"""Scenarios x contestants x seeds, each unit in a worker process, finished units kept so that a stopped run goes on."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import polars as pl

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.machine import usable_cores, versions
from hqp_rp.compare.measure.metrics import judged_rows, part_frame
from hqp_rp.compare.run_folder import RunFolder, digest
from hqp_rp.compare.workers import in_processes, progress_bar, warm_up
from hqp_rp.core.errors import SettingError
from hqp_rp.scenarios.scenario import Scenario


@dataclasses.dataclass(frozen=True, slots=True)
class Unit:
    """One run: a scenario with one contestant and one seed."""

    scenario: Scenario
    contestant: Contestant
    seed: int

    @property
    def key(self) -> str:
        """The digest of what the unit is: settings of both sides, seed, versions."""
        names = (type(self.scenario).name, repr(self.scenario), self.contestant.label, repr(self.contestant.solver))
        return digest(*names, str(self.seed), repr(sorted(versions().items())))


def units_of(scenarios: Sequence[Scenario], contestants: Sequence[Contestant], seeds: int) -> list[Unit]:
    """Every unit, the ones of one scenario and seed together, so that they share the truth of equal problems."""
    if isinstance(seeds, bool) or not isinstance(seeds, int) or seeds < 1:
        raise SettingError(f"seeds is {seeds!r}; it must be an integer of at least 1.")
    return [
        Unit(scenario, contestant, seed)
        for scenario in scenarios
        for seed in range(seeds)
        for contestant in contestants
    ]


def description(scenarios: Sequence[Scenario], contestants: Sequence[Contestant], seeds: int) -> dict[str, Any]:
    """What a run is, for the manifest of its folder: two runs are the same when this is equal."""
    return {
        "kind": "compare",
        "scenarios": {type(scenario).name: repr(scenario) for scenario in scenarios},
        "contestants": {contestant.label: repr(contestant.solver) for contestant in contestants},
        "seeds": seeds,
        "versions": versions(),
    }


def run_units(units: Sequence[Unit], folder: RunFolder, *, workers: int | None, progress: bool) -> None:
    """Run every unit that `folder` does not hold yet, over worker processes.

    Args:
        units: what to run.
        folder: where each finished unit is kept at once, so that nothing finished is ever lost.
        workers: number of processes; None means as many as there are usable cores. 1 runs in this process.
        progress: show a progress bar with the time left on standard error.
    """
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise SettingError(f"workers is {workers!r}; it must be an integer of at least 1, or None.")
    left = [unit for unit in units if not folder.has(unit.key)]
    weights = {id(unit): max(unit.scenario.length(), 1) for unit in units}
    total = sum(weights.values())
    done = total - sum(weights[id(unit)] for unit in left)
    with progress_bar(progress, total, done) as advance:
        if not left:
            return
        advance(0, "solving")
        for index, frame in in_processes(_warm, left, min(workers or usable_cores(), len(left))):
            unit = left[index]
            folder.save(unit.key, frame)
            advance(weights[id(unit)], f"{type(unit.scenario).name}: {unit.contestant.label}")


def _warm(unit: Unit) -> pl.DataFrame:
    warm_up([unit.contestant.solver])
    return run_unit(unit)


def run_unit(unit: Unit) -> pl.DataFrame:
    """The judged steps of one run, as `metrics.SCHEMA`."""
    solver = dataclasses.replace(unit.contestant.solver)  # workspaces and warm starts of its own
    steps = unit.scenario.steps(solver, unit.seed)
    return part_frame(
        judged_rows(
            steps,
            solver,
            scenario=type(unit.scenario).name,
            contestant=unit.contestant.label,
            seed=unit.seed,
        )
    )
