"""The problem set as quadratic programs, for solvers and benchmarks that know one level only.

    python -m hqp_rp.problems.quadratic_programs --output qps     # FAMILY_LABEL_STAGE.npz, in the form of qpsolvers

Each level of equalities is one program, in the freedom that the exact answer x* says the levels before it leave; the last
stage is the least norm of what all levels leave, and x* is its only answer:

    stage k         min 1/2 ||A_k x||^2 - (A_k^T b_k)^T x
    stage "norm"    min 1/2 x^T W x
                    subject to the hard rows, and for each row i of the levels before to
                    a_i x = b_i                  an equality that is met at x*
                    a_i x = a_i x*               a row that is violated at x*, or of a damped level
                    lower_i <= a_i x <= upper_i  an inequality that is met at x*

Infeasible problems give one program, "norm", of their hard rows: the right answer is that there is none.
"""

from __future__ import annotations

import argparse
import pathlib
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from hqp_rp import problems
from hqp_rp.core.level import Level
from hqp_rp.core.paths import user_path
from hqp_rp.core.problem import FloatArray
from hqp_rp.problems.known_problem import KnownProblem

MET = 1e-12
"""A row is met when it misses by no more than this part of ||a_i|| ||x*|| + |bound|: x* is rounded once."""


class QuadraticProgram(NamedTuple):
    """`min 1/2 x^T P x + q^T x` subject to `G x <= h`, `A x = b`, as qpsolvers and qpbenchmark have it.

    Attributes:
        name: "family/label/stage". x: (n,) an answer, None where there is none. unique: it is the only one.
        cost: of x; nan where there is none.
    """

    name: str
    P: FloatArray
    q: FloatArray
    G: FloatArray
    h: FloatArray
    A: FloatArray
    b: FloatArray
    x: FloatArray | None
    unique: bool
    cost: float


def quadratic_programs(known: KnownProblem) -> Iterator[QuadraticProgram]:
    """The stages of a problem; levels with inequality rows or damping have none of their own, but bound the later ones."""
    problem = known.problem
    n = problem.n
    W = np.eye(n) if problem.metric is None else problem.metric
    x = None if known.exact is None else known.exact.x
    firm = [problem.hard] if problem.hard is not None else []
    if x is None:
        hard = [_sides(level, None) for level in firm]
        yield _program(f"{known.name}/norm", W, np.zeros(n), hard, None, False)
        return
    kept = [_sides(level, None) for level in firm]
    for k, level in enumerate(problem.levels):
        if level.is_equality and level.damping is None and level.m:
            yield _program(f"{known.name}/{k + 1}", level.A.T @ level.A, -level.A.T @ level.lower, kept, x, False)
        kept.append(_sides(level, x))
    yield _program(f"{known.name}/norm", W, np.zeros(n), kept, x, True)


class _Sides(NamedTuple):
    A: FloatArray
    b: FloatArray
    G: FloatArray
    h: FloatArray


def _sides(level: Level, x: FloatArray | None) -> _Sides:
    """Equalities and inequalities that a level leaves behind at x; of hard rows (x None), what they say."""
    A, lower, upper = level.A, level.lower, level.upper
    equal, held = lower == upper, np.where(np.isfinite(lower), lower, upper)
    if x is not None:
        value = A @ x
        nearest = np.clip(value, lower, upper)
        scale = np.linalg.norm(A, axis=1) * np.linalg.norm(x) + np.abs(nearest)
        violated = np.abs(value - nearest) > MET * scale
        if level.damping is not None:
            violated = violated | equal
        held, equal = np.where(violated, value, lower), equal | violated
    up, low = ~equal & np.isfinite(upper), ~equal & np.isfinite(lower)
    G, h = np.vstack((A[up], -A[low])), np.concatenate((upper[up], -lower[low]))
    return _Sides(A[equal], held[equal], G, h)


def _program(
    name: str, P: FloatArray, q: FloatArray, rows: Sequence[_Sides], x: FloatArray | None, unique: bool
) -> QuadraticProgram:
    n = len(q)
    none = _Sides(np.zeros((0, n)), np.zeros(0), np.zeros((0, n)), np.zeros(0))
    A, b, G, h = (np.concatenate(parts) for parts in zip(none, *rows, strict=True))
    cost = np.nan if x is None else float(0.5 * x @ P @ x + q @ x)
    return QuadraticProgram(name, np.array(P), q, G, h, A, b, x, unique, cost)


def main(arguments: Sequence[str] | None = None) -> None:
    """The command: one plain .npz for each program."""
    parser = argparse.ArgumentParser(prog="python -m hqp_rp.problems.quadratic_programs", description=__doc__)
    parser.add_argument("--output", type=user_path, required=True, metavar="FOLDER", help="where the files are written")
    folder: pathlib.Path = parser.parse_args(arguments).output
    folder.mkdir(parents=True, exist_ok=True)
    count = 0
    for name in problems.names():
        for program in quadratic_programs(problems.load(name)):
            arrays = {key: value for key, value in program._asdict().items() if value is not None}
            np.savez_compressed(folder / f"{program.name.replace('/', '_')}.npz", **arrays)
            count += 1
    print(f"{count} quadratic programs in {folder}")


if __name__ == "__main__":
    main()
