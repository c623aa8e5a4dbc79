"""The study: every passage of every arm over worker processes, resumed where it stopped, and its report."""

from __future__ import annotations

import dataclasses
import os
import tempfile
from collections.abc import Sequence
from typing import Any

import polars as pl

from hqp_rp.compare.contestants import Contestant, choose_contestants, default_contestants
from hqp_rp.compare.machine import usable_cores, versions
from hqp_rp.compare.report.write import FILES, write_report
from hqp_rp.compare.run_folder import RunFolder
from hqp_rp.compare.statistics.arms import ARMS, arm_named
from hqp_rp.compare.statistics.passages import Design, places
from hqp_rp.compare.statistics.record import Statistics
from hqp_rp.compare.statistics.report import statistics_report
from hqp_rp.compare.statistics.trials import Unit, run_unit
from hqp_rp.compare.statistics.verdicts import results
from hqp_rp.compare.workers import in_processes, progress_bar
from hqp_rp.core.errors import SettingError
from hqp_rp.core.solver import Solver

QUICK = Design(configurations=3, paths=3, samples=41)


def statistics(
    design: Design | None = None,
    *,
    arms: Sequence[str] | None = None,
    solvers: Sequence[str | Solver | Contestant] | None = None,
    output: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    workers: int | None = None,
    progress: bool = False,
) -> Statistics:
    """Drive arms along many paths through their algorithmic singularities, with every solver, and say what holds.

    A study that was stopped goes on where it stopped when it is started again with the same output folder.

    Args:
        design: how many configurations and paths; None means 20 configurations and 20 paths through each, for every arm.
        arms: names of `arms.ARMS`; None means all. solvers: as in `compare`; None means every one that differs from others
            on a stack without limits.
        output: folder for the report; None writes none. overwrite: replace another run's report there.
        workers: processes; None means one for each usable core. progress: show a progress bar on standard error.

    Raises:
        SettingError, UnknownNameError, FileError: a wrong input, before any work starts; a design that asks for more
            singular configurations than are found.
    """
    design = Design() if design is None else design
    if not isinstance(design, Design):
        raise SettingError(f"design is a {type(design).__name__}; give a Design, or None.")
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise SettingError(f"workers is {workers!r}; it must be an integer of at least 1, or None.")
    if isinstance(arms, str) or (arms is not None and not arms):
        raise SettingError(f"arms is {arms!r}; give a list of names, or None for all of them.")
    names = tuple(arm_named(name).name for name in (arms if arms is not None else [arm.name for arm in ARMS]))
    if len(set(names)) < len(names):
        raise SettingError(f"arms is {list(names)!r}; give each arm once.")
    if solvers is None:
        contestants = default_contestants(limits=False, torques=False, transitions=False)
    else:
        contestants = choose_contestants(solvers)
    for name in names:
        places(name, design.configurations, design.seed)  # a design that cannot be met is told before any work
    units = [Unit(design, name, index, contestants) for name in names for index in range(design.configurations)]
    run = _description(design, names, contestants)
    labels = [contestant.label for contestant in contestants]
    if output is None:
        with tempfile.TemporaryDirectory(prefix="hqp_rp-") as place:
            rows = _run(units, RunFolder(place, run), workers, progress)
        return Statistics(design, names, contestants, rows, results(rows, labels, design.seed))
    folder = RunFolder(output, run, files=FILES, overwrite=overwrite)
    rows = _run(units, folder, workers, progress)
    study = Statistics(design, names, contestants, rows, results(rows, labels, design.seed), folder.path)
    write_report(statistics_report(study), folder.path)
    return study


def _description(design: Design, arms: Sequence[str], contestants: Sequence[Contestant]) -> dict[str, Any]:
    return {
        "kind": "statistics",
        "design": dataclasses.asdict(design),
        "arms": list(arms),
        "contestants": {contestant.label: repr(contestant.solver) for contestant in contestants},
        "versions": versions(),
    }


def _run(units: Sequence[Unit], folder: RunFolder, workers: int | None, progress: bool) -> pl.DataFrame:
    left = [unit for unit in units if not folder.has(unit.key)]
    with progress_bar(progress, len(units), len(units) - len(left), "configurations") as advance:
        advance(0, "solving")
        for index, frame in in_processes(run_unit, left, min(workers or usable_cores(), max(len(left), 1))):
            folder.save(left[index].key, frame)
            advance(1, arm_named(left[index].arm).title)
    return folder.load([unit.key for unit in units])
