"""What a study found, as data."""

from __future__ import annotations

import dataclasses
import pathlib

import polars as pl

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.statistics.passages import Design
from hqp_rp.compare.statistics.verdicts import Result


@dataclasses.dataclass(frozen=True)
class Statistics:
    """What a study found.

    Attributes:
        design, arms, contestants: what was run.
        rows: one for each contestant and path (see `trials.run_unit`).
        results: medians, intervals and verdicts of each contestant on each arm.
        folder: where the report was written, or None.
    """

    design: Design
    arms: tuple[str, ...]
    contestants: tuple[Contestant, ...]
    rows: pl.DataFrame
    results: tuple[Result, ...]
    folder: pathlib.Path | None = None
