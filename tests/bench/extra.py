"""What a benchmark measures beside single solves: growth, batches, start-up, instruction counts."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence

import numpy as np

from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.core.batch import solve_batch
from hqp_rp.core.errors import MissingExtraError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.arms import sawyer
from hqp_rp.robot.batch import frame_batch
from tests.bench import ROOT
from tests.bench.entrants import Entrant, our_entrants, peer_entrants
from tests.bench.families import family, random_problem
from tests.bench.floor import FLOOR, c_loop
from tests.bench.native_loop import NotBuilt
from tests.bench.timing import LocalRunner, interleaved

say = Sentences(__file__)

GROWERS = ("null space", "reverse priority", "active set, cold", "DAQP, accurate", "numpy SVD cascade")
SIZES = (4, 7, 14, 28, 50, 100, 200)
LEVELS = tuple(range(1, 9))
LEVEL_ROWS, LEVEL_UNKNOWNS = 5, 50
BATCH = 20_000
_FLOOR_REPEATS = 8
BATCHED = ("null_space", "reverse_priority")
COUNTED_FAMILY = "7_3-3"

Curves = dict[str, list[tuple[float, float]]]
"""Label -> (abscissa, seconds)."""


def flops(n: int, rows: Sequence[int]) -> float:
    """Floating-point operations of an orthogonal cascade on full-rank equality levels.

    A level of m rows in c free columns is reduced by r = min(m, c) Householder reflections; each acts on the columns and
    rows that are left, those of all later levels included: `sum_j 4 (c - j) (R - j)`, j = 0 ... r - 1, R the rows of this
    and the later levels. Then `r^2` for the triangle and `4 n r` to turn the step back.

    Source: Golub and Van Loan 2013, section 5.1 (a reflection of an R x c block costs 4 R c).
    """
    free, left, total = n, sum(rows), 0.0
    for m in rows:
        r = min(m, free)
        total += sum(4.0 * (free - j) * max(left - j, 0) for j in range(r)) + r * r + 4.0 * n * r
        free -= r
        left -= m
    return total


def growth_shapes(over: str) -> list[tuple[float, int, tuple[int, ...]]]:
    """(abscissa, n, rows of each level): "unknowns" has three levels of a quarter of n rows; "levels" has 1 ... 8 of 5."""
    if over == "unknowns":
        return [(float(n), n, (n // 4,) * 3) for n in SIZES]
    return [(float(p), LEVEL_UNKNOWNS, (LEVEL_ROWS,) * p) for p in LEVELS]


def growth(over: str, peers: Sequence[str], *, calls: int, budget: float) -> Curves:
    """Median seconds per call of `GROWERS`, of the C floor where there is a C compiler, and, as "flop count", the flops at
    the rate of null space at the last point."""
    entrants = [e for e in [*our_entrants(), *peer_entrants(peers)[0]] if e.label in GROWERS]
    curves: Curves = {e.label: [] for e in entrants}
    shapes = growth_shapes(over)
    for at, n, rows in shapes:
        rng = np.random.default_rng([n, len(rows)])
        problems = [random_problem(rng, n, rows) for _ in range(4)]
        runners = [LocalRunner(e.label, e.prepare(problems)) for e in entrants]
        with contextlib.suppress(NotBuilt):  # said where the floor is measured on the families
            runners.append(LocalRunner(FLOOR, [functools.partial(c_loop(problems), _FLOOR_REPEATS)]))
        for timing in interleaved(runners, calls=calls, budget=budget):
            solves = _FLOOR_REPEATS * len(problems) if timing.label == FLOOR else 1
            curves.setdefault(timing.label, []).append((at, timing.median / solves))
    reference = curves[GROWERS[0]][-1][1] / flops(shapes[-1][1], shapes[-1][2])
    curves["flop count"] = [(at, reference * flops(n, rows)) for at, n, rows in shapes]
    return curves


def batch_rates(cores: int, *, count: int = BATCH) -> list[tuple[str, int, float]]:
    """(what, threads, problems or configurations per second), the median of five calls.

    `solve_batch` on two-level 7-joint problems; poses and Jacobians of the Sawyer's tool; whole stacks (3+3+7) of it.
    """
    from tests.bench.steps import step_family

    rng = np.random.default_rng(3)
    A, b = rng.standard_normal((count, 6, 7)), rng.standard_normal((count, 6))
    q, offsets = rng.uniform(-3.0, 3.0, (count, 7)), np.array([0, 3, 6])
    made = step_family("step_sawyer", quick=True)
    calls: dict[str, Callable[[int], object]] = {
        f"solve_batch, {name}, two-level 7-joint problems": functools.partial(_solved, A, b, offsets, name)
        for name in BATCHED
    }
    calls["frame_batch, Jacobians of the Sawyer"] = lambda threads: frame_batch(sawyer(), "tool", q, threads=threads)
    calls["Stack.batch, the Sawyer's 3+3+7 rows"] = lambda threads: made.stack.batch(made.robot, q, threads=threads)
    found = []
    for what, call in calls.items():
        for threads in sorted({1, cores}):
            times = []
            for _ in range(6):
                start = time.perf_counter()
                call(threads)
                times.append(time.perf_counter() - start)
            found.append((what, threads, count / float(np.median(times[1:]))))
    return found


def _solved(A: FloatArray, b: FloatArray, offsets: IntArray, name: str, threads: int) -> object:
    return solve_batch(A, b, None, offsets, solver=name, threads=threads)


_MAKE = (
    "import sys, time; t = time.perf_counter(); import json; import numpy as np; s = time.perf_counter(); import hqp_rp; "
    "r = np.random.default_rng(0); "
    "p = hqp_rp.Problem([hqp_rp.Level.equality(r.standard_normal((3, 7)), r.standard_normal(3)) for _ in range(2)]); "
)
_STARTS = {
    "import": "",
    "null_space": "x = hqp_rp.solve(p, 'null_space').x; ",
    "reverse_priority": "x = hqp_rp.solve(p, 'reverse_priority').x; ",
    "hierarchical_active_set": "x = hqp_rp.solve(p, 'hierarchical_active_set').x; ",
    "saturation_null_space": "x = hqp_rp.solve(p, 'saturation_null_space').x; ",
    "solve_batch": "x = hqp_rp.solve_batch(p.matrix[None], p.lower[None], None, p.offsets, solver='null_space').x; ",
    "certify": "x = hqp_rp.certify(p, np.zeros(7)).ok; ",
}


def start_up(runs: int = 5) -> dict[str, float]:
    """Seconds from before `import hqp_rp` to a first answer, numpy loaded already: medians over fresh processes.

    "import" is the import alone; every other name is a solver, or a call, that gives its first answer. Nothing is compiled
    and nothing cached but Python's own byte code.
    """
    end = "print(json.dumps(time.perf_counter() - s))"
    return {name: float(np.median([_fresh(_MAKE + call + end) for _ in range(runs)])) for name, call in _STARTS.items()}


def _fresh(code: str) -> float:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=dict(os.environ)
    )
    return float(json.loads(done.stdout.splitlines()[-1]))


def instruction_counts(labels: Sequence[str], *, calls: int = 2000) -> tuple[dict[str, float], str]:
    """(label -> instructions per call on `COUNTED_FAMILY`, ""), or ({}, a sentence that says why there are none).

    Linux `perf` counts user-space instructions of a process that makes `calls` calls and of one that makes twice as many;
    the difference is the calls' own.
    """
    perf = shutil.which("perf")
    if perf is None:
        return {}, say("no_perf")
    if _perf(perf, [sys.executable, "-c", ""]) is None:
        return {}, say("perf_counts_nothing")
    found = {}
    for label in labels:
        once, twice = (_perf(perf, [sys.executable, "-m", __name__, label, str(count)]) for count in (calls, 2 * calls))
        if once is not None and twice is not None:
            found[label] = (twice - once) / calls
    return found, ""


def _perf(perf: str, command: Sequence[str]) -> float | None:
    """User-space instructions of a command; None where perf does not give them."""
    done = subprocess.run(
        [perf, "stat", "-x", ",", "-e", "instructions:u", *command],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    for line in done.stderr.splitlines():
        fields = line.split(",")
        if len(fields) > 2 and fields[2].startswith("instructions") and fields[0].isdigit():
            return float(fields[0])
    return None


@functools.cache
def _entrant(label: str) -> Entrant:
    for entrant in [*our_entrants(), *peer_entrants()[0]]:
        if entrant.label == label:
            return entrant
    raise MissingExtraError(f"There is no entrant {label!r} here.")


def main(arguments: Sequence[str]) -> None:
    """LABEL CALLS: make so many calls on the counted family; what `instruction_counts` runs under perf."""
    label, count = arguments
    problems = family(COUNTED_FAMILY, quick=True).problems
    calls = _entrant(label).prepare(problems)
    for i in range(int(count)):
        calls[i % len(calls)]()


if __name__ == "__main__":
    main(sys.argv[1:])
