"""The set as quadratic programs, in the Parquet form that qpbenchmark reads: the steps of a cascade over the levels.

python -m hqp_rp.problems.qpbenchmark FILE.parquet [--family FAMILY ...]

    from qpbenchmark.parquet_test_set import ParquetTestSet
    test_set = ParquetTestSet("FILE.parquet")

Each problem of the set becomes p + 1 programs, one for each level and one for the least norm. Program k asks for the least
violation of level k with all levels before it held where the exact answer x* has them:

    min 1/2 ||A_k x - b_k||^2                equalities
    min 1/2 ||w||^2,  A_k x - w in bounds    with two-sided rows; the unknown is (x, w)
    min 1/2 ||x||^2, or 1/2 x^T W x          the last one, whose only answer is x*

so each is an ordinary convex program whose optimal value is known: half the square of the level's residual, for equalities
less 1/2 ||b_k||^2, the constant that P and q do not hold.
"""

from __future__ import annotations

import argparse
import pathlib
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hqp_rp import problems
from hqp_rp.core.errors import FileError
from hqp_rp.core.paths import user_path
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.problems.known_problem import KnownProblem

if TYPE_CHECKING:
    import polars as pl

KEYS = ("P", "q", "G", "h", "A", "b", "lb", "ub", "name")
"""The columns of the file, as qpbenchmark has them; arrays flattened row by row, null where there is none."""

_HELD = 1e-9  # relative: a row of an earlier level that is violated by no more was met

Program = dict[str, FloatArray | str | None]


def programs(known: KnownProblem) -> Iterator[Program]:
    """The programs of one problem, the first level first; none where hard rows contradict each other, or a level is damped."""
    if known.exact is None or known.problem.damping is not None:
        return
    problem, x = known.problem, known.exact.x
    kept = [problem.hard] if problem.hard is not None else []
    for k, level in enumerate(problem.levels):
        yield _program(f"{known.name}/level_{k + 1}", kept, level, problem.n)
        kept.append(_held(level, x))
    yield _least_norm(f"{known.name}/least_norm", kept, problem)


def _held(level: Level, x: FloatArray) -> Level:
    """The level's rows within their bounds, those that x violates at the value that they have there."""
    value = level.A @ x
    size = np.linalg.norm(level.A, axis=1) * np.linalg.norm(x)
    below, above = np.minimum(value - level.lower, 0.0), np.maximum(value - level.upper, 0.0)
    below[-below <= _HELD * size], above[above <= _HELD * size] = 0.0, 0.0
    missed = (
        below + above != 0.0
    )  # held where it is: a row that misses its bound can come no nearer and must go no farther
    return Level(level.A, np.where(missed, value, level.lower), np.where(missed, value, level.upper))


def _program(name: str, kept: Sequence[Level], level: Level, n: int) -> Program:
    if level.is_equality:
        P, q = level.A.T @ level.A, -level.A.T @ level.lower
        return _assembled(name, P, q, kept, n)
    slack = Level(np.hstack([level.A, -np.eye(level.m)]), level.lower, level.upper)
    wide = [Level(np.hstack([rows.A, np.zeros((rows.m, level.m))]), rows.lower, rows.upper) for rows in kept]
    P = np.diag(np.concatenate([np.zeros(n), np.ones(level.m)]))
    return _assembled(name, P, np.zeros(n + level.m), [*wide, slack], n + level.m)


def _least_norm(name: str, kept: Sequence[Level], problem: Problem) -> Program:
    P = np.eye(problem.n) if problem.metric is None else np.asarray(problem.metric)
    return _assembled(name, P, np.zeros(problem.n), kept, problem.n)


def _assembled(name: str, P: FloatArray, q: FloatArray, rows: Sequence[Level], n: int) -> Program:
    matrix = np.vstack([np.zeros((0, n)), *(level.A for level in rows)])
    lower = np.concatenate([np.zeros(0), *(level.lower for level in rows)])
    upper = np.concatenate([np.zeros(0), *(level.upper for level in rows)])
    equal, over, under = lower == upper, np.isfinite(upper), np.isfinite(lower)
    over, under = over & ~equal, under & ~equal
    G, h = np.vstack([matrix[over], -matrix[under]]), np.concatenate([upper[over], -lower[under]])
    A, b = matrix[equal], lower[equal]
    inequalities = (G, h) if len(h) else (None, None)
    equalities = (A, b) if len(b) else (None, None)
    values = (P, q, *inequalities, *equalities, None, None, name)
    return dict(zip(KEYS, values, strict=True))


def frame(families: Sequence[str] | None = None) -> pl.DataFrame:
    """Every program as a row of `KEYS`. Raises `UnknownNameError` when there is no such family."""
    import polars as pl

    names = [name for family in families or problems.families() for name in problems.names(family)]
    found = [program for name in names for program in programs(problems.load(name))]
    columns = {
        key: pl.Series(
            [None if (value := program[key]) is None else np.asarray(value).ravel().tolist() for program in found],
            dtype=pl.List(pl.Float64),
        )
        for key in KEYS[:-1]
    }
    return pl.DataFrame(columns | {"name": pl.Series([program["name"] for program in found], dtype=pl.String)})


def main(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m hqp_rp.problems.qpbenchmark", description=__doc__)
    parser.add_argument("file", type=pathlib.Path, help="the Parquet file to write")
    parser.add_argument("--family", action="append", help=f"of {', '.join(problems.families())}; default all")
    given = parser.parse_args(arguments)
    target = user_path(given.file)
    table = frame(given.family)
    try:
        table.write_parquet(target)
    except OSError as error:
        raise FileError(f"{target}: cannot be written ({error.strerror or error}).") from error
    print(f"{target}: {table.height} programs of hqp_rp.problems {problems.version}")


if __name__ == "__main__":
    main()
