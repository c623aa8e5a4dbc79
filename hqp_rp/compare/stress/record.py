"""What a stress test found, as plain data."""

from __future__ import annotations

import dataclasses
import pathlib

import polars as pl

from hqp_rp.compare.run_folder import PARTS
from hqp_rp.compare.stress.infeasible import Infeasibility
from hqp_rp.compare.stress.plan import Plan
from hqp_rp.compare.stress.summary import Summary
from hqp_rp.control.singularities import SingularConfiguration
from hqp_rp.core.errors import FileError


@dataclasses.dataclass(frozen=True, eq=False)
class StressResult:
    """What a stress test found.

    Attributes:
        plan: what was run. levels: names of the levels.
        catalogue: the whole atlas; `plan.places` are those that a path leads to.
        left_out: solvers that refuse the stack, with their sentence.
        summary: counts, histograms and extremes over all rows.
        held_at_rest: a sentence where limits leave a robot at rest next to no speed; see `Scene.held_at_rest`.
        infeasible: what contradicts what where samples are infeasible; None where none is.
        folder: where the rows lie, one Parquet part for each chunk; None when nothing was kept.
    """

    plan: Plan
    levels: tuple[str, ...]
    catalogue: tuple[SingularConfiguration, ...]
    left_out: tuple[tuple[str, str], ...]
    summary: Summary
    infeasible: Infeasibility | None = None
    held_at_rest: str = ""
    folder: pathlib.Path | None = None

    def rows(self) -> pl.LazyFrame:
        """Every row, read from the folder when collected. Raises `FileError` where nothing was kept."""
        if self.folder is None:
            raise FileError("The rows were not kept: give an output folder.")
        return pl.scan_parquet(self.folder / PARTS / "chunk-*.parquet")
