"""One case of one scenario, boiled down to one row for each contestant: what the report's sentences and tables are made of."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import polars as pl

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.measure.metrics import parting_frame, run_levels_frame, runs_frame
from hqp_rp.core.solution import Status
from hqp_rp.scenarios.scenario import Scenario

PARTING = 1e-6
"""A solver has left the optimum when |x - x*| / |x*| exceeds this."""
KEPT = 1e-9
"""A level is kept when its excess is at most this times ||A_k|| ||x|| + ||b_k|| at every step, the solvers' own tolerance."""
BOUNDED = 10.0
"""|x| is bounded when it never exceeds this many times the largest optimum far from the singularity."""
FAR = 0.3
"""Steps at no less than this share of the largest distance from the singularity are far from it."""
CLEAR = 1e-6
"""Where every sigma is at least this, equal methods must agree to `KEPT` despite rounding."""
MOVED = 3.0
"""Every threshold is also moved down and up by this factor: a verdict that changes is marked (`thresholds`)."""


@dataclasses.dataclass(frozen=True, slots=True)
class Outcome:
    """One contestant in one case, over all seeds; None where there was no answer to measure.

    Attributes:
        contestant: who.
        solved: share of steps with `Status.SOLVED`; steps: how many there were.
        refused: the sentence of a refusal, or "".
        parts_at: parameter at which the median seed left the optimum; None when it never did; parted: whether it did.
        within: share of unambiguous steps within `PARTING` of the optimum.
        distance, distance_max: median and largest distance from the optimum.
        clear_distance: largest distance from the optimum where every sigma is at least `CLEAR`; clear_distance_moved: the
            same with `CLEAR` moved down and up by `MOVED`.
        excess, relative_excess: largest of each level, over all steps that are not ambiguous.
        proven: for each level, the largest relative excess that rounding does not explain.
        x_max: largest |x|. variation: median total variation of x along the path.
        false_claims: steps called SOLVED by a method that claims to be lexicographic there, and refuted by the certificate.
        time_p50, time_p99: s.
    """

    contestant: Contestant
    steps: int
    solved: float
    refused: str
    parts_at: float | None
    parted: bool
    within: float | None
    distance: float | None
    distance_max: float | None
    clear_distance: float | None
    clear_distance_moved: tuple[float | None, float | None]
    excess: tuple[float | None, ...]
    relative_excess: tuple[float | None, ...]
    proven: tuple[float | None, ...]
    x_max: float | None
    variation: float | None
    false_claims: int
    time_p50: float
    time_p99: float

    @property
    def label(self) -> str:
        """The contestant's label."""
        return self.contestant.label

    def keeps(self, level: int) -> bool:
        """Whether the level (from 1) stayed at its optimum given the levels before it, but for rounding, at every step."""
        value = self.proven[level - 1] if len(self.proven) >= level else None
        return value is not None and value <= KEPT


@dataclasses.dataclass(frozen=True, slots=True)
class Case:
    """One case of one scenario.

    Attributes:
        scenario, name: which one; name is "" when the scenario has one only.
        levels: names of the levels. outcomes: one for each contestant, in the order of the line-up.
        far_norm: the largest |x*| far from the singularity, the median of the contestants': what |x| is compared with;
            far_norm_moved: the same with `FAR` moved down and up by `MOVED`.
        nearest: the smallest distance from the singularity that occurred.
        reference: how the optimum was computed. ambiguous: share of steps whose rank is ambiguous.
    """

    scenario: Scenario
    name: str
    levels: tuple[str, ...]
    outcomes: tuple[Outcome, ...]
    far_norm: float
    far_norm_moved: tuple[float, float]
    nearest: float
    reference: tuple[str, ...]
    ambiguous: float

    @property
    def title(self) -> str:
        """The scenario's and the case's name, in words."""
        words = type(self.scenario).name.replace("_", " ")
        return f"{words}, {self.name}" if self.name else words

    def growth(self, outcome: Outcome) -> float | None:
        """Largest |x| over the largest optimum far from the singularity."""
        return None if outcome.x_max is None or not self.far_norm else outcome.x_max / self.far_norm

    def bounded(self, outcome: Outcome) -> bool:
        """Whether |x| stayed within `BOUNDED` times what is needed far from the singularity, where there is one."""
        if outcome.x_max is None:
            return False
        return outcome.x_max <= BOUNDED * self.far_norm or not self.far_norm


def cases(
    scenario: Scenario, contestants: Sequence[Contestant], steps: pl.DataFrame, levels: pl.DataFrame
) -> tuple[Case, ...]:
    """Every case of the scenario; the frames may hold other scenarios too."""
    name = type(scenario).name
    steps, levels = steps.filter(pl.col("scenario") == name), levels.filter(pl.col("scenario") == name)
    return tuple(
        _case(scenario, case, contestants, steps.filter(pl.col("case") == case), levels.filter(pl.col("case") == case))
        for case in steps["case"].unique(maintain_order=True)
    )


def singular_distance(levels: pl.DataFrame) -> pl.DataFrame:
    """Distance from the singularity of each step: (contestant, seed, step, sigma).

    The smallest singular value of a level's rows in the null space of the levels before it, over the levels below the first
    whose rows fit there (the others have none to lose).
    """
    fits = (pl.col("level") > 1) & (pl.col("rows") <= pl.col("unknowns") - pl.col("before"))
    keys = ["contestant", "seed", "step"]
    return levels.filter(fits).group_by(keys, maintain_order=True).agg(pl.col("sigma_min").min().alias("sigma"))


def _case(
    scenario: Scenario, name: str, contestants: Sequence[Contestant], steps: pl.DataFrame, levels: pl.DataFrame
) -> Case:
    sigma = singular_distance(levels)
    steps = steps.join(sigma, on=["contestant", "seed", "step"], how="left", maintain_order="left")
    largest = float(steps["sigma"].max() or 0.0)  # type: ignore[arg-type]

    def norm_beyond(share: float) -> float:
        far = steps.filter(pl.col("sigma") >= share * largest).group_by("contestant").agg(pl.col("optimum_norm").max())
        return float(far["optimum_norm"].median() or 0.0)  # type: ignore[arg-type]

    parting = parting_frame(steps, PARTING)
    runs, run_levels = runs_frame(steps), run_levels_frame(levels)
    outcomes = [
        _outcome(
            contestant,
            *(frame.filter(pl.col("contestant") == contestant.label) for frame in (steps, parting, runs, run_levels)),
            levels=levels.filter(pl.col("contestant") == contestant.label),
            ascending=not scenario.log_abscissa,
        )
        for contestant in contestants
    ]
    return Case(
        scenario=scenario,
        name=name,
        levels=tuple(levels.group_by("level").agg(pl.col("name").first()).sort("level")["name"]),
        outcomes=tuple(outcomes),
        far_norm=norm_beyond(FAR),
        far_norm_moved=(norm_beyond(FAR / MOVED), norm_beyond(min(FAR * MOVED, 1.0))),
        nearest=float(steps["sigma"].min() or 0.0),  # type: ignore[arg-type]
        reference=tuple(sorted(steps["reference"].unique())),
        ambiguous=float(steps["ambiguous"].mean() or 0.0),  # type: ignore[arg-type]
    )


def _outcome(
    contestant: Contestant,
    steps: pl.DataFrame,
    parting: pl.DataFrame,
    runs: pl.DataFrame,
    run_levels: pl.DataFrame,
    *,
    levels: pl.DataFrame,
    ascending: bool,
) -> Outcome:
    refusals = steps.filter(pl.col("status") == Status.REFUSED.name)["message"]
    clear = steps.filter(~pl.col("ambiguous") & pl.col("distance").is_not_null())
    false = (
        pl.col("lexicographic") & (pl.col("status") == Status.SOLVED.name) & ~pl.col("certified") & ~pl.col("ambiguous")
    )
    by_level = run_levels.group_by("level").agg(pl.col("excess_max", "relative_excess_max").max()).sort("level")
    scale = pl.when(pl.col("excess") > 0).then(pl.col("relative_excess") / pl.col("excess")).otherwise(0.0)
    proven = (
        levels.filter(~pl.col("ambiguous"))
        .group_by("level")
        .agg(((pl.col("excess") - pl.col("uncertainty")).clip(lower_bound=0.0) * scale).max().alias("proven"))
        .sort("level")
    )

    def distance_beyond(sigma: float) -> float | None:
        return _float(clear.filter(pl.col("sigma") >= sigma)["distance"].max())

    parted = parting["parts_at"].sort(descending=not ascending, nulls_last=True).to_list()
    middle = parted[len(parted) // 2] if parted else None
    return Outcome(
        contestant=contestant,
        steps=steps.height,
        solved=_float((steps["status"] == Status.SOLVED.name).mean()) or 0.0,
        refused=str(refusals[0]) if len(refusals) else "",
        parts_at=middle,
        parted=middle is not None,
        within=_float((clear["distance"] <= PARTING).mean()) if clear.height else None,
        distance=_float(clear["distance"].median()),
        distance_max=_float(clear["distance"].max()),
        clear_distance=distance_beyond(CLEAR),
        clear_distance_moved=(distance_beyond(CLEAR / MOVED), distance_beyond(CLEAR * MOVED)),
        excess=tuple(by_level["excess_max"]),
        relative_excess=tuple(by_level["relative_excess_max"]),
        proven=_filled(proven["proven"].to_list(), by_level.height),
        x_max=_float(steps["x_norm"].max()),
        variation=_float(runs["total_variation"].median()),
        false_claims=steps.filter(false).height,
        time_p50=_float(steps["solve_time"].quantile(0.5)) or 0.0,
        time_p99=_float(steps["solve_time"].quantile(0.99)) or 0.0,
    )


def _filled(values: list[float | None], count: int) -> tuple[float | None, ...]:
    return tuple(values) if values else (None,) * count


def _float(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) else None
