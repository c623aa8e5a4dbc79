"""How often something holds: shares and medians over postures, bootstrap intervals, and what other thresholds would say."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number
from hqp_rp.core.problem import FloatArray

say = Sentences(__file__)

MOST, HALF = 0.95, 0.5
"""A criterion holds where at least this share of the runs meets it, and does not where less than half of them do."""
FACTOR = 3.0
"""Thresholds are tried this many times smaller and larger."""
RESAMPLES = 1000
_SEED = 0


@dataclasses.dataclass(frozen=True, slots=True)
class Outcome:
    """One criterion under one condition: a figure of each run, and the threshold that it must not pass.

    Attributes:
        label: the condition. runs: how many there are.
        passed: share of the runs within the threshold; low, high: its 95 % interval, postures drawn again with their runs.
        stricter, looser: the share at a threshold `FACTOR` times smaller and larger.
        median, median_low, median_high: of the figure, and its interval likewise.
    """

    label: str
    runs: int
    passed: float
    low: float
    high: float
    stricter: float
    looser: float
    median: float
    median_low: float
    median_high: float

    @property
    def holds(self) -> bool | None:
        """True, False, or None where it holds in some postures."""
        return _state(self.passed)

    @property
    def turns(self) -> tuple[str, ...]:
        """With which other threshold it would be ruled on otherwise: "smaller", "larger", both or none."""
        other = {"smaller": self.stricter, "larger": self.looser}
        return tuple(words for words, value in other.items() if _state(value) != self.holds)

    def figure(self, unit: str, scale: float = 1.0) -> str:
        """The median with its interval."""
        middle, low, high = (number(scale * v) for v in (self.median, self.median_low, self.median_high))
        return f"{middle} {unit} ({low} to {high})".replace("  ", " ")


def _state(passed: float) -> bool | None:
    return True if passed >= MOST else False if passed < HALF else None


def outcome(
    label: str,
    rows: pl.DataFrame,
    values: str | FloatArray,
    threshold: float,
    *,
    stricter: float | None = None,
    looser: float | None = None,
) -> Outcome:
    """The outcome of a figure over the runs in `rows`; a run without the figure does not meet any threshold.

    Args:
        label: the condition. rows: the runs, with their posture. values: a column, or a number for each row.
        threshold: the largest figure that meets the criterion.
        stricter, looser: the other thresholds; by default `FACTOR` times smaller and larger.
    """
    found = rows[values].cast(pl.Float64).fill_null(math.inf).to_numpy() if isinstance(values, str) else values
    found = np.where(np.isnan(found), np.inf, found)
    limits = (
        threshold,
        threshold / FACTOR if stricter is None else stricter,
        threshold * FACTOR if looser is None else looser,
    )
    within = [found <= limit for limit in limits]
    postures = rows["posture"].to_numpy()
    shares, medians = _resampled(found, within[0], postures)
    low, high = np.quantile(shares, (0.025, 0.975)).tolist()
    # Medians may be infinite: an interval between order statistics, not between interpolated ones.
    median_low, median_high = np.quantile(medians, (0.025, 0.975), method="nearest").tolist()
    passed, strict, loose = (float(met.mean()) for met in within)
    return Outcome(label, len(found), passed, low, high, strict, loose, _median(found), median_low, median_high)


def _median(values: FloatArray) -> float:
    ordered = np.sort(values)
    lower, upper = ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2]
    return float(lower if lower == upper else 0.5 * (lower + upper))


def _resampled(
    values: FloatArray, within: NDArray[np.bool_], postures: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray]:
    """Share and median of each resample of the postures, each with all its runs."""
    groups = [np.flatnonzero(postures == p) for p in np.unique(postures)]
    most = max(map(len, groups))
    padded = np.array([np.pad(group, (0, most - len(group)), constant_values=-1) for group in groups])
    drawn = np.random.default_rng(_SEED).integers(len(groups), size=(RESAMPLES, len(groups)))
    runs = padded[drawn].reshape(RESAMPLES, -1)
    counts = (runs >= 0).sum(axis=1)
    shares = np.where(runs >= 0, within[runs], False).sum(axis=1) / counts
    ordered = np.sort(np.where(runs >= 0, values[runs], np.nan), axis=1)  # nan comes last
    middle = [np.take_along_axis(ordered, k[:, None], axis=1)[:, 0] for k in ((counts - 1) // 2, counts // 2)]
    return shares, np.where(middle[0] == middle[1], middle[0], 0.5 * (middle[0] + middle[1]))


def summary(outcomes: Sequence[Outcome]) -> str:
    """Where it holds, where it does not, where some postures decide, and what hangs on the threshold, in sentences."""
    holds, partly, fails = ([o for o in outcomes if o.holds is state] for state in (True, None, False))
    turning = [o for o in outcomes if o.turns]
    parts = [say("holds_where", holds=holds, partly=partly, fails=fails)]
    if turning:
        parts.append(say("other_thresholds", turning=turning, factor=FACTOR))
    return " ".join(parts)
