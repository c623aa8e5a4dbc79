"""One singular configuration: all paths past it, every contestant's answers, one row for each contestant and path."""

from __future__ import annotations

import dataclasses
import time

import numpy as np
import polars as pl

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.statistics.passages import Design, Passage, passages, places
from hqp_rp.compare.statistics.settings import FACTOR, variants_of
from hqp_rp.compare.workers import warm_up
from hqp_rp.core.batch import solve_batch
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Status
from hqp_rp.core.solver import Solver

FAR = 0.3
"""Samples whose `Passage.sigma` is at least this share of the largest of their path are far from the singularity."""
FARS = {"": FAR, "_nearer": FAR / FACTOR, "_farther": FAR * FACTOR}
"""What is added to the name of a column -> the threshold of what counts as far."""


@dataclasses.dataclass(frozen=True)
class Unit:
    """All paths past one singular configuration of an arm."""

    design: Design
    arm: str
    index: int
    contestants: tuple[Contestant, ...]

    @property
    def key(self) -> str:
        return f"{self.arm}-{self.index:03d}"


def run_unit(unit: Unit) -> pl.DataFrame:
    """The rows of one unit.

    Columns: arm, place, path, contestant; setting (of `settings.FACTORS`, 1 as the contestant is); nearest (the smallest
    sigma met); answered (share of samples with an x); error_1 (largest ||A_1 x - b_1|| / ||b_1|| of the path), error_2 (the
    same of level 2), error_2_far and error_3_far (far from the singularity, of level 3 what exceeds the optimum's), growth
    (largest ||x|| over the largest ||x*|| far from it), jump (rad/s, largest ||x_i - x_(i-1)|| of neighbouring samples), time
    (s, median of single calls). Those with _far and growth stand once for each of `FARS`. Where a sample has no x, every
    error of the path is infinite and so is its growth: no answer is no answer.
    """
    place = places(unit.arm, unit.design.configurations, unit.design.seed)[unit.index]
    entrants = [(item, factor, solver) for item in unit.contestants for factor, solver in variants_of(item)]
    warm_up([solver for _, _, solver in entrants])
    rows = []
    for path, passage in enumerate(passages(unit.design, unit.arm, place, unit.index)):
        problems = [
            Problem.from_stacked(A, b, b, passage.offsets, check=False)
            for A, b in zip(passage.A, passage.b, strict=True)
        ]
        optimum = solve_batch(passage.A, passage.b, None, passage.offsets, solver="null_space", threads=1).x
        for contestant, factor, solver in entrants:
            x, answered, seconds = _answers(solver, problems)
            rows.append(
                {"arm": unit.arm, "place": unit.index, "path": path, "contestant": contestant.label, "setting": factor}
                | {"nearest": float(passage.sigma.min()), "answered": float(answered.mean())}
                | measures(passage, x, optimum, answered)
                | {"time": float(np.median(seconds))}
            )
    return pl.DataFrame(rows)


def measures(
    passage: Passage, x: FloatArray, optimum: FloatArray, answered: FloatArray | None = None
) -> dict[str, float]:
    """What one path of answers x (N, n) is worth; see `run_unit`. answered: (N,), None for all."""
    errors, least = level_errors(passage, x), level_errors(passage, optimum)
    found = {"error_1": float(errors[0].max()), "error_2": float(errors[1].max())}
    for name, threshold in FARS.items():
        far = passage.sigma >= threshold * passage.sigma.max()
        needed = np.linalg.norm(optimum[far], axis=1).max()
        found[f"error_2_far{name}"] = float(errors[1][far].max())
        found[f"error_3_far{name}"] = float(np.maximum(errors[2] - least[2], 0.0)[far].max())
        found[f"growth{name}"] = float(np.linalg.norm(x, axis=1).max() / needed)
    found["jump"] = float(np.linalg.norm(np.diff(x, axis=0), axis=1).max())
    return found if answered is None or answered.all() else dict.fromkeys(found, np.inf)


def level_errors(passage: Passage, x: FloatArray) -> list[FloatArray]:
    """Of each level (N,) ||A_k x - b_k|| / ||b_k||."""
    missed = np.einsum("nij,nj->ni", passage.A, x) - passage.b
    parts = [slice(a, b) for a, b in zip(passage.offsets[:-1], passage.offsets[1:], strict=True)]
    return [np.linalg.norm(missed[:, part], axis=1) / np.linalg.norm(passage.b[:, part], axis=1) for part in parts]


def _answers(given: Solver, problems: list[Problem]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """x (N, n), 0 where there is none; whether there was one (N,); seconds (N,)."""
    solver = dataclasses.replace(given)  # nothing of another path
    x = np.zeros((len(problems), problems[0].n))
    answered, seconds = np.zeros(len(problems)), np.empty(len(problems))
    for i, problem in enumerate(problems):
        start = time.perf_counter()
        solution = solver.solve(problem)
        seconds[i] = time.perf_counter() - start
        if solution.status is Status.REFUSED:
            seconds[i:] = np.nan
            break
        if solution.x is not None and np.isfinite(solution.x).all():
            x[i], answered[i] = solution.x, 1.0
    return x, answered, seconds
