"""One chunk of a stress test: its samples, every contestant's answers, judged, as rows."""

from __future__ import annotations

import dataclasses
import threading
import time

import numpy as np
import polars as pl
from numpy.typing import NDArray

from hqp_rp.compare.stress.judge import (
    REFERENCES,
    References,
    along_paths,
    distances,
    level_errors,
    references,
)
from hqp_rp.compare.stress.plan import KINDS, Plan, Samples
from hqp_rp.compare.workers import warm_up
from hqp_rp.core.batch import solve_batch
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.solution import Status
from hqp_rp.core.solver import Solver

STATUSES = tuple(status.name for status in Status)

_ONE_AT_A_TIME = threading.Lock()  # the truth sets the working precision of the whole process


def chunk_rows(plan: Plan, index: int) -> pl.DataFrame:
    """The rows of chunk `index`: each contestant's, one after the other, each in the order of the samples.

    Columns: sample (its number in the run), kind, place (index into the atlas), path, step (null outside paths), sigma,
    contestant, status, x_norm (||x||), optimum_norm (||x*||), distance (||x - x*|| / (1 + ||x*||)), error_1 ... error_p
    (see `level_errors`), lipschitz, jump (null where not known), reference, ambiguous, time (s; measured, the only column
    that another run does not give again: of a batch, its mean).
    """
    with _ONE_AT_A_TIME:
        chunk = plan.chunks[index]
        samples = plan.samples_of(chunk)
        stacked = _stacked(samples)
        _warm_up(plan)
        solved = [(contestant.label, _solve(contestant.solver, samples, stacked)) for contestant in plan.contestants]
        found = references(samples, [x for _, (x, _, _) in solved])
        common = _common(samples, found)
        frames = [common.with_columns(**_judged(label, samples, found, *answer)) for label, answer in solved]
        columns = ["sample", "kind", "place", "path", "step", "sigma", "contestant", "status", "x_norm", "optimum_norm"]
        rest = [name for name in frames[0].columns if name not in columns]
        return pl.concat(frames).select(*columns, *rest)


def is_batched(solver: Solver) -> bool:
    """Whether the solver takes many problems in one native call."""
    return type(solver).solve_many is not Solver.solve_many


_warm: set[str] = set()


def _warm_up(plan: Plan) -> None:
    """Load what each solver needs, once in each process, so that no loading is taken for solve time."""
    fresh = [item.solver for item in plan.contestants if repr(item.solver) not in _warm]
    if not fresh:
        return
    warm_up(fresh)
    rng = np.random.default_rng(0)
    A, b = rng.standard_normal((16, 6, 7)), rng.standard_normal((16, 6))
    for solver in fresh:
        if is_batched(solver):
            solve_batch(A, b, None, [0, 3, 6], solver=dataclasses.replace(solver), threads=1)
        _warm.add(repr(solver))


@dataclasses.dataclass(frozen=True, slots=True)
class _Stacked:
    """Problems of one shape: A (C, M, n), lower, upper (C, M), offsets (p + 1,)."""

    A: FloatArray
    lower: FloatArray
    upper: FloatArray | None
    offsets: NDArray[np.int64]


def _stacked(samples: Samples) -> _Stacked | None:
    first = samples.problems[0]
    if first.hard is not None or any(
        not np.array_equal(problem.offsets, first.offsets) for problem in samples.problems
    ):
        return None
    equality = all(problem.is_equality for problem in samples.problems)
    return _Stacked(
        np.stack([problem.matrix for problem in samples.problems]),
        np.stack([problem.lower for problem in samples.problems]),
        None if equality else np.stack([problem.upper for problem in samples.problems]),
        first.offsets,
    )


def _solve(
    solver: Solver, samples: Samples, stacked: _Stacked | None
) -> tuple[FloatArray, NDArray[np.uint8], FloatArray]:
    """x (C, n), codes (C,) into `Status`, and seconds (C,)."""
    count = len(samples.problems)
    own = dataclasses.replace(solver)  # nothing of another chunk
    if stacked is not None and is_batched(own):
        # What is loaded or allocated at the first call is nobody's time.
        solve_batch(
            stacked.A[:1],
            stacked.lower[:1],
            None if stacked.upper is None else stacked.upper[:1],
            stacked.offsets,
            solver=own,
            threads=1,
        )
        start = time.perf_counter()
        answer = solve_batch(stacked.A, stacked.lower, stacked.upper, stacked.offsets, solver=own, threads=1)
        return answer.x, answer.codes, np.full(count, (time.perf_counter() - start) / count)
    x = np.full((count, samples.problems[0].n), np.nan)
    codes, seconds = np.zeros(count, dtype=np.uint8), np.empty(count)
    own.solve(samples.problems[0])
    for i, problem in enumerate(samples.problems):
        own.reset()  # each sample stands alone
        start = time.perf_counter()
        solution = own.solve(problem)
        seconds[i] = time.perf_counter() - start
        codes[i] = STATUSES.index(solution.status.name)
        if solution.x is not None:
            x[i] = solution.x
    return x, codes, seconds


def _common(samples: Samples, found: References) -> pl.DataFrame:
    known = np.isfinite(found.x[:, 0])
    norms = np.full(len(found.x), np.nan)
    norms[known] = np.linalg.norm(found.x[known], axis=1)
    return pl.DataFrame(
        {
            "sample": pl.Series(samples.number, dtype=pl.Int64),
            "kind": pl.Series([samples.kind] * len(found.x), dtype=pl.Enum(KINDS)),
            **{name: _index(getattr(samples, name)) for name in ("place", "path", "step")},
            "sigma": found.sigma,
            "optimum_norm": _filled(norms),
            "reference": pl.Series([REFERENCES[code] for code in found.method], dtype=pl.Enum(REFERENCES)),
            "ambiguous": found.ambiguous,
        }
    )


def _judged(
    label: str,
    samples: Samples,
    found: References,
    x: FloatArray,
    codes: NDArray[np.uint8],
    seconds: FloatArray,
) -> dict[str, pl.Series]:
    errors = level_errors(samples.problems, found, x)
    lipschitz, jump, known = along_paths(samples, x)
    with np.errstate(all="ignore"):
        size = np.linalg.norm(x, axis=1)
    return {
        "contestant": pl.Series([label] * len(x), dtype=pl.String),
        "status": pl.Series([STATUSES[code] for code in codes], dtype=pl.Enum(STATUSES)),
        "x_norm": _filled(size),
        "distance": _filled(distances(found, x)),
        **{f"error_{k + 1}": _filled(errors[:, k]) for k in range(errors.shape[1])},
        "lipschitz": _filled(lipschitz),
        "jump": pl.Series([bool(j) if sure else None for j, sure in zip(jump, known, strict=True)], dtype=pl.Boolean),
        "time": pl.Series(seconds),
    }


def _filled(values: FloatArray) -> pl.Series:
    """nan as null."""
    return pl.Series(values).fill_nan(None)


def _index(values: NDArray[np.int64]) -> pl.Series:
    return pl.Series([None if value < 0 else int(value) for value in values], dtype=pl.Int32)
