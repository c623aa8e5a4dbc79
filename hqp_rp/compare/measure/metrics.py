"""What is measured at every step and over every run, as polars data frames; the judge, never the contestant, measures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import polars as pl

from hqp_rp.compare.measure.reference import reference
from hqp_rp.core.certificate import Certificate, certify
from hqp_rp.core.diagnostics import LevelReport, Spectrum, spectra
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.solution import Status
from hqp_rp.core.solver import Solver
from hqp_rp.scenarios.scenario import Step

SMALLEST_NORM = 1e-9
"""|x - x*| is divided by max(|x*|, this): an optimum at rest has no relative error."""

_LEVEL = pl.Struct(
    {
        "level": pl.Int64,
        "name": pl.String,
        "residual": pl.Float64,
        "optimal_residual": pl.Float64,
        "excess": pl.Float64,
        "relative_excess": pl.Float64,
        "uncertainty": pl.Float64,
        "rank": pl.Int64,
        "own_rank": pl.Int64,
        "rows": pl.Int64,
        "before": pl.Int64,
        "unknowns": pl.Int64,
        "sigma_min": pl.Float64,
        "singularity": pl.String,
    }
)
SCHEMA: dict[str, Any] = {
    "scenario": pl.String,
    "case": pl.String,
    "contestant": pl.String,
    "seed": pl.Int64,
    "step": pl.Int64,
    "parameter": pl.Float64,
    "status": pl.String,
    "message": pl.String,
    "iterations": pl.Int64,
    "solve_time": pl.Float64,
    "lexicographic": pl.Boolean,
    "certified": pl.Boolean,
    "verdict": pl.String,
    "hard_violation": pl.Float64,
    "x": pl.List(pl.Float64),
    "x_norm": pl.Float64,
    "optimum_norm": pl.Float64,
    "distance": pl.Float64,
    "reference": pl.String,
    "ambiguous": pl.Boolean,
    "levels": pl.List(_LEVEL),
    "measured": pl.List(pl.Struct({"quantity": pl.String, "value": pl.Float64})),
}
"""Columns of a part: one row for each step; `steps_frame`, `levels_frame` and `measured_frame` take it apart."""

RUN = ["scenario", "case", "contestant", "seed"]
"""The columns that name one run: `step` and `parameter` run along it."""


def judged_rows(
    steps: Iterable[Step], solver: Solver, *, scenario: str, contestant: str, seed: int
) -> Iterator[dict[str, Any]]:
    """One row of `SCHEMA` for each step, measured from (problem, x).

    residual is ||violation_k(x)||; excess the part of it that could be avoided given the earlier levels, as `certify`
    finds it, uncertainty what rounding may contribute to it; relative_excess is it over ||A_k|| ||x|| + ||b_k||;
    certified and verdict are the certificate's at the solver's own tolerance; lexicographic is what the solver claims of
    its method; distance is |x - x*| / max(|x*|, 1e-9).
    """
    for index, step in enumerate(steps):
        problem, solution = step.problem, step.solution
        x = solution.x
        proof = None if x is None else certify(problem, x, solution.secondary, solver.tolerance)
        optimum = reference(problem, solution.secondary, x if proof is not None and proof.ok else None)
        yield {
            "scenario": scenario,
            "case": step.case,
            "contestant": contestant,
            "seed": seed,
            "step": index,
            "parameter": step.parameter,
            "status": solution.status.name,
            "message": solution.message,
            "iterations": solution.iterations,
            "solve_time": step.solve_time,
            "lexicographic": solver.is_lexicographic(problem),
            "certified": None if proof is None else proof.ok,
            "verdict": None if proof is None else proof.sentence,
            "hard_violation": None if proof is None else proof.hard_violation,
            "x": None if x is None else x.tolist(),
            "x_norm": None if x is None else float(np.linalg.norm(x)),
            "optimum_norm": None if optimum.x is None else float(np.linalg.norm(optimum.x)),
            "distance": distance(x, optimum.x),
            "reference": optimum.method,
            "ambiguous": optimum.ambiguous,
            "levels": _levels(step, proof, optimum.residuals),
            "measured": [{"quantity": name, "value": float(value)} for name, value in step.measured.items()],
        }


def distance(x: FloatArray | None, optimum: FloatArray | None) -> float | None:
    """|x - x*| / max(|x*|, 1e-9); None where there is no x or no x*."""
    if x is None or optimum is None:
        return None
    return float(np.linalg.norm(x - optimum)) / max(float(np.linalg.norm(optimum)), SMALLEST_NORM)


def _levels(step: Step, proof: Certificate | None, optimal: FloatArray) -> list[dict[str, Any]]:
    problem, solution = step.problem, step.solution
    found: Sequence[Spectrum | LevelReport] = spectra(problem) if proof is None else solution.levels
    rows = np.diff(problem.offsets).tolist()
    return [
        {
            "level": k + 1,
            "name": problem.names[k],
            "residual": None if proof is None else proof.levels[k].residual,
            "optimal_residual": float(optimal[k]),
            "excess": None if proof is None else proof.levels[k].excess,
            "relative_excess": None if proof is None else proof.levels[k].relative_excess,
            "uncertainty": None if proof is None else proof.levels[k].uncertainty,
            "rank": found[k].rank,
            "own_rank": found[k].own_rank,
            "rows": rows[k],
            "before": int(problem.offsets[k]),
            "unknowns": problem.n,
            "sigma_min": found[k].sigma_min,
            "singularity": found[k].singularity.name,
        }
        for k in range(problem.p)
    ]


def part_frame(rows: Iterable[dict[str, Any]]) -> pl.DataFrame:
    """The rows of one or more runs as a data frame of `SCHEMA`."""
    return pl.DataFrame(list(rows), schema=SCHEMA, orient="row")


def steps_frame(parts: pl.DataFrame) -> pl.DataFrame:
    """One row for each step, without the level and scenario figures."""
    return parts.drop("levels", "measured")


def levels_frame(parts: pl.DataFrame) -> pl.DataFrame:
    """One row for each step and level."""
    keys = [*RUN, "step", "parameter", "status", "ambiguous", "x_norm"]
    return parts.select(*keys, "levels").explode("levels").unnest("levels")


def measured_frame(parts: pl.DataFrame) -> pl.DataFrame:
    """One row for each step and figure that only the scenario could measure."""
    keys = [*RUN, "step", "parameter"]
    return (
        parts.select(*keys, "measured").filter(pl.col("measured").list.len() > 0).explode("measured").unnest("measured")
    )


def runs_frame(steps: pl.DataFrame) -> pl.DataFrame:
    """One row for each run: distances, norms, total variation, shares of each status, times.

    Ambiguous steps are left out of the distances. `total_variation` is sum_i |x_{i+1} - x_i| along the path, over the
    steps that have an x; times are in s.
    """
    clear = pl.col("distance").filter(~pl.col("ambiguous"))
    shares = [(pl.col("status") == status.name).mean().alias(f"share_{status.name.lower()}") for status in Status]
    variation = (
        steps.filter(pl.col("x").is_not_null())
        .sort("step")
        .group_by(RUN, maintain_order=True)
        .agg(pl.col("x").map_batches(_variation, return_dtype=pl.Float64, returns_scalar=True).alias("total_variation"))
    )
    return (
        steps.group_by(RUN, maintain_order=True)
        .agg(
            pl.len().alias("steps"),
            pl.col("ambiguous").sum().alias("ambiguous_steps"),
            clear.max().alias("distance_max"),
            clear.median().alias("distance_median"),
            pl.col("x_norm").max().alias("x_norm_max"),
            pl.col("x_norm").median().alias("x_norm_median"),
            pl.col("optimum_norm").max().alias("optimum_norm_max"),
            pl.col("iterations").median().alias("iterations_median"),
            *shares,
            pl.col("solve_time").quantile(0.5).alias("time_p50"),
            pl.col("solve_time").quantile(0.99).alias("time_p99"),
        )
        .join(variation, on=RUN, how="left", maintain_order="left")
    )


def run_levels_frame(levels: pl.DataFrame) -> pl.DataFrame:
    """One row for each run and level: largest and median residual, excess and relative excess; smallest sigma_min."""
    clear = ~pl.col("ambiguous")
    figures = ("residual", "excess", "relative_excess")
    return levels.group_by([*RUN, "level", "name"], maintain_order=True).agg(
        *(pl.col(figure).filter(clear).max().alias(f"{figure}_max") for figure in figures),
        *(pl.col(figure).filter(clear).median().alias(f"{figure}_median") for figure in figures),
        pl.col("sigma_min").min().alias("sigma_min_min"),
    )


def parting_frame(steps: pl.DataFrame, threshold: float = 1e-6) -> pl.DataFrame:
    """For each run, the first step (in the order of the path) whose distance from the optimum exceeds `threshold`.

    `parts_at` is that step's parameter, null when the answer stayed with the optimum; ambiguous steps do not count.
    """
    left = (pl.col("distance") > threshold) & ~pl.col("ambiguous")
    return (
        steps.sort("step")
        .group_by(RUN, maintain_order=True)
        .agg(
            pl.col("parameter").filter(left).first().alias("parts_at"),
            pl.col("distance").is_not_null().any().alias("measured"),
        )
        .sort(RUN)
    )


def _variation(series: pl.Series) -> float:
    points = np.array(series.to_list(), dtype=np.float64)
    if len(points) < 2:  # polars also tries an empty series
        return 0.0
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
