"""From rows of paths to medians, intervals and verdicts, and what a verdict hangs on."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from hqp_rp.compare.statistics.settings import FACTOR, FACTORS
from hqp_rp.compare.statistics.trials import FARS
from hqp_rp.core.problem import FloatArray, IntArray

KEPT_FIRST = 1e-6
"""Level 1 is kept on a path where it never misses more than this share of what it asks for."""
KEPT_SECOND = 1e-3
"""The same of level 2, far from the singularity: near it no bounded method can."""
BOUNDED = 10.0
"""||x|| is bounded on a path where it never exceeds this many times the largest optimum far from the singularity."""
QUORUM = 0.95
"""A verdict is yes where it holds on at least this share of the paths, no where it holds on at most 1 - `QUORUM`."""
RESAMPLES = 1000
COVERAGE = 0.95

YES, PARTLY, NO = "yes", "partly", "no"
SETTING, CONFIGURATIONS = "its own setting", "configurations"
QUESTIONS = ("keeps level 1", "keeps level 2", "stays bounded")
QUANTITIES = ("error_1", "error_2_far", "error_3_far", "growth", "jump", "time")


@dataclasses.dataclass(frozen=True, slots=True)
class Spread:
    """One quantity over the paths: median, its interval (`COVERAGE`, bootstrap over configurations), 5 and 95 % quantile."""

    median: float
    low: float
    high: float
    q05: float
    q95: float


@dataclasses.dataclass(frozen=True, slots=True)
class Verdict:
    """The answer to one of `QUESTIONS` for one contestant on one arm.

    Attributes:
        word: `YES`, `PARTLY` or `NO`. share: of the paths on which it holds.
        hangs_on: what would change the word: names of thresholds that were moved up or down by `FACTOR`, `SETTING` where the
            method's own number was, and `CONFIGURATIONS` where more than 1 - `COVERAGE` of random resamples of them do.
    """

    word: str
    share: float
    hangs_on: tuple[str, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Result:
    """What one contestant did on one arm.

    Attributes:
        spreads: by `QUANTITIES`. verdicts: by `QUESTIONS`. answered: share of the samples with an x.
        elsewhere: factor of its setting -> the words by `QUESTIONS`; empty for a method without a setting.
    """

    arm: str
    contestant: str
    spreads: dict[str, Spread]
    verdicts: dict[str, Verdict]
    answered: float
    elsewhere: dict[float, dict[str, str]]

    def word(self, question: str, factor: float = 1.0) -> str:
        """The answer at that factor of the setting; that of the contestant itself where it has none."""
        return self.elsewhere.get(factor, {}).get(question, self.verdicts[question].word)


def results(rows: pl.DataFrame, contestants: Sequence[str], seed: int = 0) -> tuple[Result, ...]:
    """Every contestant on every arm of `rows` (see `trials.run_unit`), in their order."""
    found = []
    for arm in rows["arm"].unique(maintain_order=True):
        own = rows.filter(pl.col("arm") == arm)
        for label in contestants:
            frame = own.filter(pl.col("contestant") == label).sort("place", "path")
            if frame.height:
                found.append(_result(arm, label, frame, np.random.default_rng(seed)))
    return tuple(found)


def _result(arm: str, label: str, frame: pl.DataFrame, rng: np.random.Generator) -> Result:
    count = frame["place"].n_unique()
    drawn = rng.integers(0, count, (RESAMPLES, count))
    others = {
        factor: _verdicts(part, count, drawn)
        for factor in FACTORS
        if factor != 1.0 and (part := frame.filter(pl.col("setting") == factor)).height
    }
    frame = frame.filter(pl.col("setting") == 1.0)
    spreads = {name: spread(frame[name].to_numpy().reshape(count, -1), drawn) for name in QUANTITIES}
    verdicts = _verdicts(frame, count, drawn)
    elsewhere = {factor: {q: other[q].word for q in QUESTIONS} for factor, other in others.items()}
    for question, verdict in verdicts.items():
        if any(words[question] != verdict.word for words in elsewhere.values()):
            verdicts[question] = dataclasses.replace(verdict, hangs_on=(SETTING, *verdict.hangs_on))
    return Result(arm, label, spreads, verdicts, float(frame["answered"].mean()), elsewhere)  # type: ignore[arg-type]


def spread(values: FloatArray, drawn: IntArray) -> Spread:
    """`values` (C, P) of C configurations and P paths; `drawn` (R, C) resampled configurations."""
    if np.isnan(values).any():
        return Spread(*([float("nan")] * 5))
    medians = np.median(values[drawn].reshape(len(drawn), -1), axis=1)
    rest = 50.0 * (1.0 - COVERAGE)
    # Of sorted values as they are: between two infinite ones nothing can be interpolated.
    low, high = np.percentile(medians, [rest, 100.0 - rest], method="nearest")
    q05, middle, q95 = np.percentile(values, [5.0, 50.0, 95.0], method="nearest")
    return Spread(float(middle), float(low), float(high), float(q05), float(q95))


def word_of(share: float) -> str:
    """The word for the share of paths on which something holds."""
    return YES if share >= QUORUM else NO if share <= 1.0 - QUORUM else PARTLY


def _verdicts(frame: pl.DataFrame, count: int, drawn: IntArray) -> dict[str, Verdict]:
    first, growths = frame["error_1"].to_numpy(), {name: frame[f"growth{name}"].to_numpy() for name in FARS}
    seconds = {name: frame[f"error_2_far{name}"].to_numpy() for name in FARS}
    factors = (1.0 / FACTOR, FACTOR)
    moved_far = [name for name in FARS if name]
    cases: dict[str, tuple[NDArray[np.bool_], dict[str, list[NDArray[np.bool_]]]]] = {
        QUESTIONS[0]: (first <= KEPT_FIRST, {"the level-1 tolerance": [first <= f * KEPT_FIRST for f in factors]}),
        QUESTIONS[1]: (
            seconds[""] <= KEPT_SECOND,
            {
                "the level-2 tolerance": [seconds[""] <= f * KEPT_SECOND for f in factors],
                "what counts as far": [seconds[name] <= KEPT_SECOND for name in moved_far],
            },
        ),
        QUESTIONS[2]: (
            growths[""] <= BOUNDED,
            {
                "the bound on ||x||": [growths[""] <= f * BOUNDED for f in factors],
                "what counts as far": [growths[name] <= BOUNDED for name in moved_far],
            },
        ),
    }
    found = {}
    for question, (holds, moved) in cases.items():
        word = word_of(float(holds.mean()))
        hangs = [name for name, others in moved.items() if any(word_of(float(o.mean())) != word for o in others)]
        shares = holds.reshape(count, -1).mean(axis=1)[drawn].mean(axis=1)
        if np.mean([word_of(share) != word for share in shares]) > 1.0 - COVERAGE:
            hangs.append(CONFIGURATIONS)
        found[question] = Verdict(word, float(holds.mean()), tuple(hangs))
    return found
