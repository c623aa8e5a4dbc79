"""The comparison itself: run what is missing, measure, and write the report."""

from __future__ import annotations

import dataclasses
import os
import tempfile
from collections.abc import Sequence

from hqp_rp.compare.comparison.findings import answer_of_comparison
from hqp_rp.compare.comparison.record import ComparisonResult
from hqp_rp.compare.comparison.report import comparison_report
from hqp_rp.compare.contestants import Contestant, choose_contestants, default_contestants
from hqp_rp.compare.limits.cases import limit_cases, limit_scenarios
from hqp_rp.compare.machine import usable_cores
from hqp_rp.compare.measure.cases import cases
from hqp_rp.compare.measure.metrics import levels_frame, measured_frame, runs_frame, steps_frame
from hqp_rp.compare.measure.units import Unit, description, run_units, units_of
from hqp_rp.compare.report.report import Report
from hqp_rp.compare.report.write import FILES, write_report
from hqp_rp.compare.run_folder import RunFolder, write_parquet
from hqp_rp.core.errors import MissingExtraError, SettingError
from hqp_rp.core.solver import Solver
from hqp_rp.scenarios.scenario import Scenario, all_scenarios, get_scenario

SEEDS = 3
QUICK_SEEDS = 1


class Comparison(ComparisonResult):
    """What a comparison found, and what it says: see `ComparisonResult` for its attributes."""

    __slots__ = ()

    @property
    def answer(self) -> tuple[str, ...]:
        """The answer in a few sentences: first on singularities, then on limits, where scenarios of that kind were run."""
        return answer_of_comparison(self)

    def report(self) -> Report:
        """The report as data."""
        return comparison_report(self)


def compare(
    scenarios: Sequence[str | Scenario] | None = None,
    solvers: Sequence[str | Solver | Contestant] | None = None,
    *,
    seeds: int | None = None,
    output: str | os.PathLike[str] | None = None,
    quick: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
    progress: bool = False,
) -> Comparison:
    """Run every scenario with every contestant and every seed, judge each step, and write the report.

    A run that was stopped goes on where it stopped when it is started again with the same output folder. Solve times are
    taken while as many processes run as there are cores: ratios between solvers of one run are meant, not absolute times.

    Args:
        scenarios: names or `Scenario`s; None means every scenario that is meant for it (`Scenario.by_default`) and whose
            optional packages are here.
        solvers: names (all variants of that solver), `name:key=value,key=value`, `Solver`s or `Contestant`s; None means the
            default line-up.
        seeds: how many seeds, 0 ... seeds - 1; None means 3, with `quick` 1.
        output: folder for report.html, report.md, figures and Parquet files; None writes nothing.
        quick: the scenarios' own quick versions, for a first look.
        overwrite: replace the report of another run in `output`.
        workers: processes; None means one for each usable core.
        progress: show a progress bar on standard error.

    Raises:
        UnknownNameError, SettingError: a scenario, solver or setting that does not exist or is not allowed.
        MissingExtraError: the only scenario, or every one of them, needs an optional package that is absent; where others
            remain, they are run, and the report says what was left out.
        FileError: `output` holds another run's report or foreign files, or cannot be written.
    """
    chosen, left_out = _scenarios(scenarios, quick)
    only_default = all(type(scenario).by_default for scenario in chosen)
    torques = any(scenario.commands_torques for scenario in chosen)
    line_up = default_contestants(limits=not only_default, torques=torques, transitions=False)
    contestants = line_up if solvers is None else choose_contestants(solvers)
    count = (QUICK_SEEDS if quick else SEEDS) if seeds is None else seeds
    units = units_of(chosen, contestants, count)
    run = description(chosen, contestants, count)
    if output is None:
        with tempfile.TemporaryDirectory(prefix="hqp_rp-") as temporary:
            found = _measured(units, RunFolder(temporary, run), workers, progress, chosen, contestants, count)
            return dataclasses.replace(found, left_out=left_out)
    folder = RunFolder(output, run, files=FILES, overwrite=overwrite)
    found = _measured(units, folder, workers, progress, chosen, contestants, count)
    found = dataclasses.replace(found, left_out=left_out, folder=folder.path)
    results = folder.path / "results"
    results.mkdir(exist_ok=True)
    for name in ("steps", "levels", "measured", "runs"):
        write_parquet(getattr(found, name), results / f"{name}.parquet")
    write_report(found.report(), folder.path, workers=workers or usable_cores())
    return found


def _measured(
    units: Sequence[Unit],
    folder: RunFolder,
    workers: int | None,
    progress: bool,
    scenarios: tuple[Scenario, ...],
    contestants: tuple[Contestant, ...],
    seeds: int,
) -> Comparison:
    run_units(units, folder, workers=workers, progress=progress)
    parts = folder.load(unit.key for unit in units)
    steps, levels, measured = steps_frame(parts), levels_frame(parts), measured_frame(parts)
    with_limits = [scenario for scenario in scenarios if type(scenario).name in limit_scenarios(measured)]
    limits = [limit_cases(scenario, contestants, steps, levels, measured) for scenario in with_limits]
    return Comparison(
        scenarios=scenarios,
        contestants=contestants,
        seeds=seeds,
        steps=steps,
        levels=levels,
        measured=measured,
        runs=runs_frame(steps),
        cases=tuple(case for scenario in scenarios for case in cases(scenario, contestants, steps, levels)),
        limits=tuple(case for found in limits for case in found),
    )


def _by_default() -> list[str]:
    return [name for name, kind in all_scenarios().items() if kind.by_default]


def _scenarios(scenarios: Sequence[str | Scenario] | None, quick: bool) -> tuple[tuple[Scenario, ...], tuple[str, ...]]:
    """The scenarios, and a sentence for each that lacks an optional package; one alone that lacks it is an error."""
    if isinstance(scenarios, str | Scenario):
        raise SettingError(f"scenarios is {scenarios!r}; give a list of scenario names or Scenarios, or None for all.")
    if scenarios is not None and not len(scenarios):
        raise SettingError("scenarios is an empty list; give scenario names or Scenarios, or None for all of them.")
    found: dict[str, Scenario] = {}
    left_out = []
    for item in _by_default() if scenarios is None else scenarios:
        scenario = get_scenario(item)
        name = type(scenario).name
        if name in found and repr(found[name]) != repr(scenario):
            raise SettingError(f"The scenario {name!r} is given twice with different settings; run them one by one.")
        try:
            scenario.check()
        except MissingExtraError as error:
            if scenarios is not None and len(scenarios) == 1:
                raise
            left_out.append(f"{name} was left out: {error}")
            continue
        found[name] = scenario
    if not found:
        raise MissingExtraError(" ".join(left_out))
    return tuple(scenario.quick() if quick else scenario for scenario in found.values()), tuple(left_out)
