"""What a comparison found, as plain data."""

from __future__ import annotations

import dataclasses
import pathlib

import polars as pl

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.limits.cases import LimitCase
from hqp_rp.compare.measure.cases import Case
from hqp_rp.scenarios.scenario import Scenario


@dataclasses.dataclass(frozen=True, slots=True)
class ComparisonResult:
    """What a comparison found.

    Attributes:
        scenarios, contestants, seeds: what was run.
        steps: one row for each step (x, status, distance from the optimum, solve time in s).
        levels: one row for each step and level (residual, excess, rank, sigma_min, kind of singularity).
        measured: one row for each step and figure that only the scenario could measure.
        runs: one row for each run (largest and median distance, total variation, shares of each status, times).
        cases: one entry for each case of each scenario: what the report's sentences are made of.
        limits: the same for the cases of scenarios that measure violations of limits.
        left_out: for each scenario that needs an absent optional package, a sentence that says so and the remedy.
        folder: where the report was written, or None.
    """

    scenarios: tuple[Scenario, ...]
    contestants: tuple[Contestant, ...]
    seeds: int
    steps: pl.DataFrame
    levels: pl.DataFrame
    measured: pl.DataFrame
    runs: pl.DataFrame
    cases: tuple[Case, ...]
    limits: tuple[LimitCase, ...] = ()
    left_out: tuple[str, ...] = ()
    folder: pathlib.Path | None = None

    @property
    def without_limits(self) -> tuple[Case, ...]:
        """The cases of scenarios that measure no violation of limits."""
        with_limits = {type(case.case.scenario) for case in self.limits}
        return tuple(case for case in self.cases if type(case.scenario) not in with_limits)
