"""What a stress test found, gathered part by part in arrays whose size does not grow with the samples."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np
import polars as pl
from numpy.typing import NDArray

from hqp_rp.compare.measure.cases import PARTING
from hqp_rp.compare.stress.judge import REFERENCES, RESOLVED
from hqp_rp.compare.stress.plan import APPROACH, KINDS, PER_DECADE, STEPS, Plan
from hqp_rp.compare.stress.rows import STATUSES
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.solution import Status

LOWEST, HIGHEST, FINE = -18, 20, 8
"""Values are counted in bins of 1/8 decade from 1e-18 to 1e20; what is beyond counts in the outermost bins."""
BINS = (HIGHEST - LOWEST) * FINE

RATIO_DECADES, RATIO_FINE = 16, 16
RATIOS = RATIO_DECADES * RATIO_FINE + 1
"""Ratios of a performance profile are counted in bins of 1/16 decade from 1 to 1e16; the last bin is beyond, or no answer."""

_KEPT = 64  # infeasible samples of each part whose number is kept

FAR_OFF, LARGE, JUMPING = "far off", "large", "jump"
WORST = {
    FAR_OFF: "farthest from the optimum",
    LARGE: "largest answer beside the optimum's size",
    JUMPING: "largest jump",
}
"""What makes a case the worst one: key -> words."""


@dataclasses.dataclass(frozen=True, slots=True)
class Worst:
    """One worst case: the criterion (a key of `WORST`), the contestant, its figure, and which sample it is."""

    criterion: str
    contestant: str
    value: float
    sample: int


@dataclasses.dataclass(frozen=True, slots=True)
class Case:
    """The singularities of one level and kind: name of the level, name of the kind, how many there are in the atlas."""

    level: int
    name: str
    kind: str
    places: int

    @property
    def title(self) -> str:
        """Level and kind, in words."""
        return f"{self.name}, {self.kind.lower()}"


class Summary:
    """Counts, histograms and extremes over all rows. K contestants, p levels, S bins of sigma on the paths.

    Attributes:
        labels, levels: names of contestants and levels. cases: the kinds of singularities that paths led to.
        quantities: what is counted along the paths: error_1 ... error_p, distance, x_norm, lipschitz.
        along: for each case (quantities, K, S, BINS) counts.
        optimum: (cases, S, BINS) counts of ||x*|| where it is known.
        jumps, steps: (cases, K, S) how many jumps, among how many steps where that is known.
        status: (K, kinds, statuses) counts. time, distance: (K, BINS) and (K, kinds, BINS) counts.
        worst_distance: (K, kinds), worst_error: (K, kinds, p): the largest value, 0 where there is none.
        worst_norm: (K, kinds) the largest ||x||, nan where there is no answer.
        infeasible: samples that some contestant ended with `INFEASIBLE`; some_infeasible: numbers of some of them.
        right: (K, kinds) answers within `PARTING` of the optimum; judged: (kinds,) samples whose optimum is known for sure.
        ambiguous: (kinds,) samples whose rank is a matter of opinion. references: how many samples were judged how.
        profile, time_profile: (K, RATIOS) Dolan and More's ratios of distance, and of time to a right answer.
    """

    def __init__(self, plan: Plan, levels: tuple[str, ...]) -> None:
        self.labels = tuple(contestant.label for contestant in plan.contestants)
        self.levels = levels
        self._case_of, self.cases = _cases(plan)
        self.quantities = (*(f"error_{k + 1}" for k in range(len(levels))), "distance", "x_norm", "lipschitz")
        K, p = len(self.labels), len(levels)
        self.along = [np.zeros((len(self.quantities), K, STEPS, BINS), dtype=np.int32) for _ in self.cases]
        self.optimum = np.zeros((len(self.cases), STEPS, BINS), dtype=np.int64)
        self.jumps = np.zeros((len(self.cases), K, STEPS), dtype=np.int64)
        self.steps = np.zeros((len(self.cases), K, STEPS), dtype=np.int64)
        self.status = np.zeros((K, len(KINDS), len(STATUSES)), dtype=np.int64)
        self.time = np.zeros((K, BINS), dtype=np.int64)
        self.distance = np.zeros((K, len(KINDS), BINS), dtype=np.int64)
        self.worst_distance = np.zeros((K, len(KINDS)))
        self.worst_norm = np.full((K, len(KINDS)), np.nan)
        self.infeasible = 0
        self.some_infeasible: list[int] = []
        self.worst_error = np.zeros((K, len(KINDS), p))
        self.right = np.zeros((K, len(KINDS)), dtype=np.int64)
        self.judged = np.zeros(len(KINDS), dtype=np.int64)
        self.ambiguous = np.zeros(len(KINDS), dtype=np.int64)
        self.references = dict.fromkeys(REFERENCES, 0)
        self.profile = np.zeros((K, RATIOS), dtype=np.int64)
        self.time_profile = np.zeros((K, RATIOS), dtype=np.int64)
        self._worst: dict[tuple[str, str], Worst] = {}
        self.samples = 0

    def add(self, rows: pl.DataFrame) -> None:
        """Count the rows of one part, as `chunk_rows` makes them."""
        K = len(self.labels)
        part = _Part(rows, K)
        kind = KINDS.index(rows["kind"][0])
        self.samples += part.count
        status = part.array("status_code").astype(np.int64)
        for k in range(K):
            self.status[k, kind] += np.bincount(status[k], minlength=len(STATUSES))
        infeasible = np.flatnonzero((status == STATUSES.index(Status.INFEASIBLE.name)).any(axis=0))
        self.infeasible += len(infeasible)
        numbers = part.array("sample")[0].astype(np.int64)[infeasible]
        self.some_infeasible += numbers[:: max(1, len(numbers) // _KEPT)].tolist()
        distance, clear = part.array("distance"), ~part.array("ambiguous").astype(bool)
        self.ambiguous[kind] += int((~clear[0]).sum())
        for name, count in rows[: part.count].group_by("reference").len().iter_rows():
            self.references[name] += count
        known = clear & (part.array("optimum_norm") >= 0.0)
        self.judged[kind] += int(known[0].sum())
        self.right[:, kind] += (known & (distance <= PARTING)).sum(axis=1)
        self._count(self.time, part.array("time"))
        self._count(self.distance[:, kind], np.where(known, distance, np.nan))
        _raise_to(self.worst_distance[:, kind], np.where(known, distance, np.nan))
        _raise_to(self.worst_norm[:, kind], part.array("x_norm"))
        for level in range(len(self.levels)):
            _raise_to(self.worst_error[:, kind, level], np.where(clear, part.array(f"error_{level + 1}"), np.nan))
        self._profiles(part, distance, known)
        self._worst_cases(part, distance, known)
        if rows["kind"][0] == APPROACH:
            self._paths(part, clear)

    def _paths(self, part: _Part, clear: NDArray[np.bool_]) -> None:
        case = np.array([self._case_of[int(place)] for place in part.array("place")[0]])
        bins = sigma_bins(part.array("sigma")[0])
        jump, known = part.array("jump_code") == 1, part.array("jump_code") >= 0
        for c in range(len(self.cases)):
            own = case == c
            if not own.any():
                continue
            sizes = part.array("optimum_norm")[0]
            sized = own & clear[0] & np.isfinite(sizes)
            np.add.at(self.optimum[c], (bins[sized], value_bins(sizes[sized])), 1)
            for k in range(len(self.labels)):
                self.jumps[c, k] += np.bincount(bins[own], weights=jump[k, own], minlength=STEPS).astype(np.int64)
                self.steps[c, k] += np.bincount(bins[own], weights=known[k, own], minlength=STEPS).astype(np.int64)
                for i, name in enumerate(self.quantities):
                    values = part.array(name)[k]
                    counted = own & np.isfinite(values)
                    if name == "distance" or name.startswith("error"):
                        counted &= clear[k]
                    np.add.at(self.along[c][i, k], (bins[counted], value_bins(values[counted])), 1)

    def _profiles(self, part: _Part, distance: FloatArray, known: NDArray[np.bool_]) -> None:
        judged = known[0]
        apart = np.where(np.isfinite(distance), np.maximum(distance, RESOLVED), np.inf)[:, judged]
        time = np.where(distance <= PARTING, part.array("time"), np.inf)[:, judged]
        for counts, measure in ((self.profile, apart), (self.time_profile, time)):
            best = measure.min(axis=0)
            with np.errstate(invalid="ignore"):
                decades = np.where(np.isfinite(measure), np.log10(measure / best), np.inf)
            bins = np.minimum(np.ceil(np.nan_to_num(decades, posinf=1e9) * RATIO_FINE - 1e-9), RATIOS - 1).astype(
                np.int64
            )
            for k in range(len(self.labels)):
                counts[k] += np.bincount(bins[k], minlength=RATIOS)

    def _worst_cases(self, part: _Part, distance: FloatArray, known: NDArray[np.bool_]) -> None:
        number = part.array("sample")[0].astype(np.int64)
        size, optimum = part.array("x_norm"), part.array("optimum_norm")
        figures = {
            FAR_OFF: np.where(known, distance, np.nan),
            LARGE: np.where(known, size / (1.0 + optimum), np.nan),
            JUMPING: np.where(part.array("jump_code") == 1, part.array("lipschitz"), np.nan),
        }
        for criterion, values in figures.items():
            for k, label in enumerate(self.labels):
                if not np.isfinite(values[k]).any():
                    continue
                i = int(np.nanargmax(values[k]))
                found = Worst(criterion, label, float(values[k, i]), int(number[i]))
                before = self._worst.get((criterion, label))
                # Of equal ones the first, whatever the order in which parts come.
                if before is None or (found.value, -found.sample) > (before.value, -before.sample):
                    self._worst[criterion, label] = found

    @property
    def worst(self) -> tuple[Worst, ...]:
        """The worst case of each criterion and contestant, where there is one."""
        keys = [(criterion, label) for label in self.labels for criterion in WORST]
        return tuple(self._worst[found] for found in keys if found in self._worst)

    def _count(self, counts: NDArray[np.int64], values: FloatArray) -> None:
        for k in range(len(self.labels)):
            counts[k] += np.bincount(value_bins(values[k][np.isfinite(values[k])]), minlength=BINS)

    def solved(self, k: int) -> float:
        """Share of the samples that contestant k ended with `SOLVED`."""
        return float(self.status[k, :, STATUSES.index(Status.SOLVED.name)].sum() / max(self.samples, 1))


class _Part:
    """The rows of one part as arrays (K, C)."""

    def __init__(self, rows: pl.DataFrame, contestants: int) -> None:
        self.count = rows.height // contestants
        codes = pl.col("jump").cast(pl.Int8).fill_null(-1).alias("jump_code")
        self._rows = rows.with_columns(codes, pl.col("status").to_physical().alias("status_code"))
        self._shape = (contestants, self.count)

    def array(self, name: str) -> FloatArray:
        """A column, nulls as nan."""
        return self._rows[name].cast(pl.Float64).to_numpy().reshape(self._shape)


def summarize(plan: Plan, levels: tuple[str, ...], parts: Iterable[pl.DataFrame]) -> Summary:
    """The summary of all parts, read one at a time."""
    summary = Summary(plan, levels)
    for rows in parts:
        summary.add(rows)
    return summary


def sigma_bins(sigma: FloatArray) -> NDArray[np.int64]:
    """Which quarter of a decade each sigma is nearest to, counted from 1e-1."""
    bins = np.rint((-np.log10(sigma) - 1.0) * PER_DECADE).astype(np.int64)
    return np.asarray(np.clip(bins, 0, STEPS - 1))


def sigma_of_bins() -> FloatArray:
    """(S,) the sigma that each bin stands for."""
    return np.asarray(10.0 ** (-1.0 - np.arange(STEPS) / PER_DECADE))


def value_bins(values: FloatArray) -> NDArray[np.int64]:
    """Which bin each value >= 0 falls into."""
    with np.errstate(divide="ignore"):
        bins = np.floor((np.log10(values) - LOWEST) * FINE)
    return np.asarray(np.clip(bins, 0, BINS - 1).astype(np.int64))


def quantile(counts: NDArray[np.integer], share: float) -> FloatArray:
    """The value at this quantile of histograms (..., BINS), to half a bin; nan where nothing was counted."""
    total = counts.sum(axis=-1)
    rank = np.cumsum(counts, axis=-1) >= np.maximum(np.ceil(share * total), 1)[..., None]
    value = 10.0 ** (LOWEST + (rank.argmax(axis=-1) + 0.5) / FINE)
    value = np.where(rank.argmax(axis=-1) == 0, 0.0, value)
    return np.where(total > 0, value, np.nan)


def largest(counts: NDArray[np.integer]) -> float:
    """The largest value of histograms (..., BINS), to half a bin; nan where nothing was counted."""
    found = np.flatnonzero(counts.reshape(-1, BINS).any(axis=0))
    if not found.size:
        return float("nan")
    return 0.0 if found[-1] == 0 else float(10.0 ** (LOWEST + (found[-1] + 0.5) / FINE))


def _raise_to(highest: FloatArray, values: FloatArray) -> None:
    """highest (K,) <- the largest finite value of values (K, C), where there is one and it is larger."""
    largest_of_part = np.where(np.isfinite(values), values, -np.inf).max(axis=1)
    np.fmax(highest, np.where(np.isfinite(largest_of_part), largest_of_part, np.nan), out=highest)


def _cases(plan: Plan) -> tuple[dict[int, int], tuple[Case, ...]]:
    """Place -> case, and the cases that paths lead to, by level and kind."""
    keys = sorted({(place.level, place.kind.name) for place in plan.places}) if plan.paths else []
    of = {i: keys.index((place.level, place.kind.name)) for i, place in enumerate(plan.places)} if keys else {}
    found = []
    for level, kind in keys:
        same = [place for place in plan.places if (place.level, place.kind.name) == (level, kind)]
        found.append(Case(level, same[0].name, kind, len(same)))
    return of, tuple(found)
