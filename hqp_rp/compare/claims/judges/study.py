"""The rows of all trials, by what they are, and what a judge finds in them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import polars as pl

from hqp_rp.compare.claims.algebra import Theorem
from hqp_rp.compare.claims.outcomes import Outcome
from hqp_rp.core.problem import FloatArray
from hqp_rp.scenarios._interaction import DAMPED

NOTHING = 30.0
"""N: the force error of a tool that never touches."""


@dataclasses.dataclass(frozen=True, slots=True)
class Found:
    """What a judge found: outcomes that decide, the number, what to add to the summary; what algebra says, a word it forces."""

    outcomes: Sequence[Outcome]
    number: str
    words: str = ""
    theorem: Theorem | None = None
    counterexample: str = ""
    word: str = ""


class Study:
    """The rows of all trials, by what they are."""

    def __init__(self, rows: pl.DataFrame) -> None:
        self.rows = rows

    def has(self, *experiments: str) -> bool:
        """Whether all of these were run."""
        return set(experiments) <= set(self.rows["experiment"].unique().to_list())

    def pick(self, experiment: str, method: str = "", damping: float | None = None, **columns: object) -> pl.DataFrame:
        """The runs of an experiment, of one method and damping, with these values in these columns, by posture."""
        found = self.rows.filter(pl.col("experiment") == experiment)
        if method:
            found = found.filter(pl.col("method") == method)
        if damping is not None:
            found = found.filter(pl.col("damping") == damping)
        for name, value in columns.items():
            found = found.filter(pl.col(name) == value)
        return found.sort("posture", "seed")

    def dampings(self, experiment: str, method: str, gains: str = DAMPED) -> list[float]:
        """The dampings with which a method was run, from the smallest."""
        return sorted(self.pick(experiment, method, gains=gains)["damping"].unique().to_list())

    def best(self, experiment: str, method: str, gains: str = DAMPED) -> pl.DataFrame:
        """The runs with the damping whose median RMS force error from the first contact on is smallest."""
        candidates = [
            self.pick(experiment, method, damping, gains=gains)
            for damping in self.dampings(experiment, method, gains=gains)
        ]
        return min(candidates, key=lambda found: float(np.median(force_error(found))))


def force_error(rows: pl.DataFrame) -> FloatArray:
    """N, of each run: RMS of F_e - F_d from the first contact on; `NOTHING` where nothing was touched."""
    return np.asarray(rows["rms"].cast(pl.Float64).fill_null(NOTHING).to_numpy(), dtype=np.float64)


def without_near(experiment: str) -> str:
    """The name of an experiment for a place that says by itself that a singularity is near."""
    return experiment.replace(", near", "")


def median_peak(rows: pl.DataFrame) -> float:
    """N, the median over the runs of the largest contact force."""
    return float(np.median(rows["peak"].to_numpy()))
