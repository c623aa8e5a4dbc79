"""One case of a scenario with limits, boiled down to one row for each contestant: who broke what, and what each level paid.

A scenario is one with limits when it measures a quantity called "... violation [unit]". Where it also measures
"... violation left [unit]" and "... violation added [unit]" (a start outside the limits, and what came on top of it), the
added part is held against a solver, and the part that is left says when it was back within the limits.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.measure.cases import KEPT, Case, Outcome, cases
from hqp_rp.core.solution import Status
from hqp_rp.scenarios.scenario import Scenario

COUNTS = 1e-6
"""A violation counts when it exceeds this, in its unit: below it is what tolerances and rounding leave."""

CHANGE = "velocity change [rad/s]"
"""What a scenario calls the change of the joint velocities from one step to the next."""

_VIOLATION = re.compile(r"(?P<kind>.+?)(?: limit)? violation(?P<part> added| left)? \[(?P<unit>.+)\]")
_ERROR = re.compile(r"(?P<name>.+) error \[(?P<unit>.+)\]")


@dataclasses.dataclass(frozen=True, slots=True)
class Violation:
    """How one contestant treated one kind of limit.

    Attributes:
        kind, unit: "position", "rad". quantity: what it is measured as.
        largest: over all seeds. time: s in violation, the mean of the seeds. first: s, the earliest of all seeds; None for
            a limit that was kept.
    """

    kind: str
    unit: str
    quantity: str
    largest: float
    time: float
    first: float | None

    @property
    def kept(self) -> bool:
        """Whether the limit was never exceeded by more than `COUNTS`."""
        return self.first is None


@dataclasses.dataclass(frozen=True, slots=True)
class TaskError:
    """What a level's task missed its reference by, at the configurations that the contestant's motion led to.

    Attributes:
        name, unit: "tool position", "m". rms: over all steps and seeds. peak: the largest. end: the mean over the seeds of
            the last one.
    """

    name: str
    unit: str
    rms: float
    peak: float
    end: float


@dataclasses.dataclass(frozen=True, slots=True)
class Denied:
    """What one level was refused of what it asked for, in the unit of its rates, at the problems that the contestant met.

    Attributes:
        rms: of the residual, over all steps with an answer. optimum: the same of the exact optimum of these problems, None
            where it was not computed.
        open: the certificate's excess, largest over the steps whose rank is not ambiguous, less what rounding explains: the
            part of a residual that points where the limits reached and the levels before leave room. It is 0 exactly where
            nothing could have been avoided, and otherwise no less than what could: a limit not yet reached may cap it.
        claimed: as open, over the steps that were called SOLVED. relative: open over ||A_k|| ||x|| + ||b_k||.
    """

    name: str
    rms: float
    optimum: float | None
    open: float | None
    claimed: float | None
    relative: float | None

    @property
    def left(self) -> bool:
        """Whether room was left beyond the tolerance that solvers declare."""
        return self.relative is not None and self.relative > KEPT


@dataclasses.dataclass(frozen=True, slots=True)
class LimitOutcome:
    """One contestant in one case, over all seeds.

    Attributes:
        outcome: its distances, times and statuses as everywhere.
        statuses: status -> share of its steps, the ones that occurred.
        violations, errors: one for each that the scenario measures; empty for a contestant that refused.
        denied: one for each level.
        changes: (median, 99th percentile, largest) of the joint velocities' change from one step to the next, rad/s, over all
            steps and seeds; None where the scenario does not measure it.
        outside: how many of the seeds started outside a limit; back: s until the last of them was within its limits again,
            None where one never was.
    """

    outcome: Outcome
    statuses: dict[str, float]
    violations: tuple[Violation, ...]
    errors: tuple[TaskError, ...]
    denied: tuple[Denied, ...]
    outside: int
    back: float | None
    changes: tuple[float, float, float] | None = None

    @property
    def label(self) -> str:
        """The contestant's label."""
        return self.outcome.label

    @property
    def answered(self) -> bool:
        """Whether the scenario measured anything: a refusal moves nothing."""
        return bool(self.violations)

    @property
    def kept(self) -> bool:
        """Whether it answered and broke no limit."""
        return self.answered and all(violation.kept for violation in self.violations)

    @property
    def wasteful(self) -> bool:
        """Whether some level could have been served better, beyond rounding: room for it was left open."""
        return any(level.left for level in self.denied)

    @property
    def admitted(self) -> bool:
        """Whether no room beyond rounding was left open on the steps that it called SOLVED."""
        return all(
            level.claimed is None or level.open is None or level.relative is None or not level.open
            or level.claimed * level.relative / level.open <= KEPT
            for level in self.denied
        )  # fmt: skip


@dataclasses.dataclass(frozen=True, slots=True)
class LimitCase:
    """One case of one scenario with limits.

    Attributes:
        case: as everywhere. told: whether its problem holds the limits.
        outcomes: one for each contestant, in the order of the line-up. duration: s, of one run.
    """

    case: Case
    told: bool
    outcomes: tuple[LimitOutcome, ...]
    duration: float

    @property
    def answered(self) -> tuple[LimitOutcome, ...]:
        """Those that took the problem."""
        return tuple(outcome for outcome in self.outcomes if outcome.answered)


def limit_scenarios(measured: pl.DataFrame) -> frozenset[str]:
    """The names of the scenarios that measure a violation."""
    found = measured.select("scenario", "quantity").unique()
    return frozenset(row[0] for row in found.iter_rows() if _VIOLATION.fullmatch(row[1]))


def limit_cases(
    scenario: Scenario,
    contestants: Sequence[Contestant],
    steps: pl.DataFrame,
    levels: pl.DataFrame,
    measured: pl.DataFrame,
) -> tuple[LimitCase, ...]:
    """Every case of a scenario with limits; the frames may hold other scenarios too."""
    name = type(scenario).name
    steps, levels, measured = (frame.filter(pl.col("scenario") == name) for frame in (steps, levels, measured))
    without = getattr(scenario, "without_limits", None)
    found = []
    for case in cases(scenario, contestants, steps, levels):
        of_case = [frame.filter(pl.col("case") == case.name) for frame in (steps, levels, measured)]
        period = _period(of_case[0])
        found.append(
            LimitCase(
                case=case,
                told=case.name != without,
                outcomes=tuple(_outcome(outcome, case, period, *of_case) for outcome in case.outcomes),
                duration=_number(of_case[0]["parameter"].max()) + period,
            )
        )
    return tuple(found)


def quantities(measured: pl.DataFrame) -> tuple[list[str], list[str]]:
    """The quantities that tell of violations, one for each kind of limit, and those that tell of task errors, in order."""
    names = measured["quantity"].unique(maintain_order=True).to_list()
    matches = [match for name in names if (match := _VIOLATION.fullmatch(name))]
    added = {match["kind"] for match in matches if match["part"] == " added"}
    kinds = [m[0] for m in matches if m["part"] == " added" or (m["part"] is None and m["kind"] not in added)]
    return kinds, [name for name in names if _ERROR.fullmatch(name)]


def _period(steps: pl.DataFrame) -> float:
    """s that one step stands for: the difference between the first two of a run."""
    times = np.unique(steps["parameter"].to_numpy())
    return float(times[1] - times[0]) if len(times) > 1 else 0.0


def _outcome(
    outcome: Outcome, case: Case, period: float, steps: pl.DataFrame, levels: pl.DataFrame, measured: pl.DataFrame
) -> LimitOutcome:
    steps, levels, measured = (
        frame.filter(pl.col("contestant") == outcome.label) for frame in (steps, levels, measured)
    )
    shares = steps.group_by("status").agg((pl.len() / steps.height).alias("share"))
    by_status = dict(shares.iter_rows())
    kinds, errors = quantities(measured)
    outside, back = _way_back(measured, period)
    return LimitOutcome(
        outcome=outcome,
        statuses={status.name: by_status[status.name] for status in Status if status.name in by_status},
        violations=tuple(_violation(name, measured.filter(pl.col("quantity") == name), period) for name in kinds),
        errors=tuple(_error(name, measured.filter(pl.col("quantity") == name)) for name in errors),
        denied=tuple(_denied(name, k, outcome, levels) for k, name in enumerate(case.levels, start=1)),
        outside=outside,
        back=back,
        changes=_changes(measured),
    )


def _changes(measured: pl.DataFrame) -> tuple[float, float, float] | None:
    values = measured.filter(pl.col("quantity") == CHANGE)["value"].drop_nulls().to_numpy()
    if not len(values):
        return None
    median, most = np.percentile(values, [50.0, 99.0])
    return float(median), float(most), float(values.max())


def _violation(quantity: str, measured: pl.DataFrame, period: float) -> Violation:
    match = _VIOLATION.fullmatch(quantity)
    assert match is not None
    over = measured.filter(pl.col("value") > COUNTS)
    return Violation(
        kind=match["kind"],
        unit=match["unit"],
        quantity=quantity,
        largest=_number(measured["value"].max()),
        time=period * over.height / max(measured["seed"].n_unique(), 1),
        first=None if not over.height else _number(over["parameter"].min()),
    )


def _error(quantity: str, measured: pl.DataFrame) -> TaskError:
    match = _ERROR.fullmatch(quantity)
    assert match is not None
    last = measured.sort("step").group_by("seed").agg(pl.col("value").last())
    return TaskError(
        name=match["name"],
        unit=match["unit"],
        rms=_rms(measured["value"].to_numpy()),
        peak=_number(measured["value"].max()),
        end=_number(last["value"].mean()),
    )


def _denied(name: str, level: int, outcome: Outcome, levels: pl.DataFrame) -> Denied:
    answered = levels.filter(pl.col("level") == level).drop_nulls("residual")
    optimal = answered["optimal_residual"].to_numpy()
    clear = answered.filter(~pl.col("ambiguous")).with_columns(
        (pl.col("excess") - pl.col("uncertainty")).clip(lower_bound=0.0).alias("sure")
    )
    claimed = clear.filter(pl.col("status") == Status.SOLVED.name)
    return Denied(
        name=name,
        rms=_rms(answered["residual"].to_numpy()),
        optimum=_rms(optimal) if len(optimal) and np.isfinite(optimal).all() else None,
        open=_number(clear["sure"].max()) if clear.height else None,
        claimed=_number(claimed["sure"].max()) if claimed.height else None,
        relative=outcome.proven[level - 1] if len(outcome.proven) >= level else None,
    )


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def _way_back(measured: pl.DataFrame, period: float) -> tuple[int, float | None]:
    """How many seeds started outside, and the s until the last of them was inside; None where one never was."""
    left = measured.filter(pl.col("quantity").str.contains(" violation left [", literal=True))
    over = left.filter(pl.col("value") > COUNTS).group_by("seed").agg(pl.col("parameter").max())
    if not over.height:
        return 0, 0.0
    last, end = _number(over["parameter"].max()), _number(left["parameter"].max())
    return over.height, last + period if last < end else None


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")
