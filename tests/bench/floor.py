"""Where the time of a null-space call goes: the kernel beside a plain cascade in C, then dispatch, then the solution."""

from __future__ import annotations

import dataclasses
import functools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.core.closed_form import ClosedForm
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solver import RANK_TOLERANCE, get_solver
from tests.bench.accuracy import Accuracy, judge, references
from tests.bench.families import Family, family
from tests.bench.lexls import lexls_loops
from tests.bench.native_loop import Loop, NotBuilt, build, caller, stacked
from tests.bench.timing import TURN, LocalRunner, Timing, interleaved

say = Sentences(__file__)

FLOOR_FAMILIES = ("7_3-3", "7_1-5", "7_6-1-7", "7_3-3-7", "30", "100")
"""Families of equalities, on which the floor is measured."""

FLOOR, KERNEL, CALL, SOLVE, LEXLS = "C floor", "kernel", "kernel from Python", "Solver.solve", "LexLS"
"""Who is timed: the C cascade and the kernel in native loops, the native solver called from Python, the public call."""

_PASS = 1e-3  # s, what one timed pass over the instances takes at least


@dataclasses.dataclass(frozen=True, slots=True)
class Floor:
    """One family.

    Attributes:
        name, title: of the family.
        times: per solve, by the names above; those who take part.
        accuracy: of those whose answers are their own: the floor, the kernel, LexLS.
        lexls: which of LexLS's ways to x was the fastest certified one, or "".
    """

    name: str
    title: str
    times: Mapping[str, Timing]
    accuracy: Mapping[str, Accuracy]
    lexls: str = ""

    def share(self, label: str) -> float:
        """Of the time of `Solver.solve`: what the kernel, its dispatch ("dispatch") or the rest ("solution") takes."""
        kernel, call, solve = (self.times[name].median for name in (KERNEL, CALL, SOLVE))
        return {"kernel": kernel, "dispatch": call - kernel, "solution": solve - call}[label] / solve


def measure_floor(
    names: Sequence[str],
    *,
    lexls: tuple[str, str] | None = None,
    quick: bool = False,
    calls: int = 200,
    budget: float = 0.25,
    announce: Callable[[str], None] = lambda text: None,
) -> tuple[tuple[Floor, ...], tuple[str, ...]]:
    """Time them in turn on each family of these names; and a sentence for each one that takes no part.

    Args:
        names: of `FLOOR_FAMILIES`. lexls: folders of LexLS and of Eigen, or None.
        calls: passes over the instances, at most. budget: s for each that is timed. announce: told the family.
    """
    found, missing = [], {}
    for name in names:
        announce(name)
        made = family(name, quick=quick)
        native: dict[str, Loop] = {KERNEL: native_loop(made.problems)}
        try:
            native[FLOOR] = c_loop(made.problems)
        except NotBuilt as error:
            missing[FLOOR] = say("no_floor", error=str(error))
        if lexls is not None:
            try:
                native |= {f"{LEXLS} {way}": loop for way, loop in lexls_loops(made.problems, lexls).items()}
            except NotBuilt as error:
                missing[LEXLS] = say("no_lexls", error=str(error))
        found.append(_measured(made, native, calls, budget))
    return tuple(found), tuple(missing.values())


def _measured(made: Family, native: Mapping[str, Loop], calls: int, budget: float) -> Floor:
    known = references(made.problems)
    accuracy = {label: _judged(made.problems, loop, known) for label, loop in native.items()}
    passes: dict[str, tuple[Callable[[], Any], int]] = {
        label: _pass(loop, len(made.problems)) for label, loop in native.items()
    }
    solver = _solver()
    native_solve, solve = _native_of(solver).solve, solver.solve

    def call_all(repeats: int) -> None:
        for _ in range(repeats):
            for problem in made.problems:
                native_solve(problem, None)

    def solve_all(repeats: int) -> None:
        for _ in range(repeats):
            for problem in made.problems:
                solve(problem)

    passes |= {CALL: _pass(call_all, len(made.problems)), SOLVE: _pass(solve_all, len(made.problems))}
    # A pass takes a millisecond and more, so that the machine's other work falls into it: processor time leaves that out.
    runners = [LocalRunner(label, [call], time.thread_time_ns) for label, (call, _) in passes.items()]
    times = {
        timing.label: per_solve(timing, passes[timing.label][1])
        for timing in interleaved(runners, calls=max(calls, TURN), budget=budget)
    }
    ways = [label for label in times if label.startswith(LEXLS)]
    certified = [label for label in ways if accuracy[label].ok]
    best = min(certified or ways, key=lambda label: times[label].median, default="")
    for label in ways:
        if label == best:
            times[LEXLS], accuracy[LEXLS] = dataclasses.replace(times[label], label=LEXLS), accuracy[label]
        del times[label], accuracy[label]
    return Floor(made.name, made.title, times, accuracy, best.removeprefix(LEXLS).strip())


def per_solve(timing: Timing, solves: int) -> Timing:
    """The times of passes of so many solves, for one solve."""
    return dataclasses.replace(
        timing, median=timing.median / solves, p99=timing.p99 / solves, parts=timing.parts / solves
    )


def _pass(loop: Callable[[int], Any], instances: int) -> tuple[Callable[[], Any], int]:
    """A call that goes over the instances often enough to be timed well, and how many solves that is."""
    loop(1)
    start = time.perf_counter()
    loop(1)
    repeats = max(math.ceil(_PASS / max(time.perf_counter() - start, 1e-9)), 1)
    return functools.partial(loop, repeats), repeats * instances


def _judged(problems: Sequence[Problem], loop: Loop, known: Any) -> Accuracy:
    answers = loop(1).copy()
    return judge(
        problems, [functools.partial(answers.__getitem__, i) for i in range(len(problems))], lambda x: x, known
    )


def c_loop(problems: Sequence[Problem]) -> Loop:
    """The plain cascade in C (`native/cascade.c`) over the problems. Raises `NotBuilt` where it cannot be compiled."""
    library = _cascade()
    A, b, offsets = stacked(problems)
    x = np.empty((len(A), A.shape[2]))
    call = caller(library.cascade_loop, *A.shape, len(offsets) - 1, offsets, A, b, RANK_TOLERANCE, x)

    def loop(repeats: int) -> FloatArray:
        call(repeats)
        return x

    return loop


@functools.cache
def _cascade() -> Any:
    return build("cascade.c", "c")


def _solver() -> ClosedForm:
    solver = get_solver("null_space")
    assert isinstance(solver, ClosedForm)
    return solver


def _native_of(solver: ClosedForm) -> Any:
    """What `Solver.solve` calls."""
    native = solver.native()
    assert native is not None
    return native


def native_loop(problems: Sequence[Problem]) -> Loop:
    """The native kernel of null space over the problems, without Python between them."""
    native = _native_of(_solver())
    A, b, offsets = stacked(problems)
    x = np.empty((len(A), A.shape[2]))

    def loop(repeats: int) -> FloatArray:
        native.loop(A, b, offsets, x, repeats)
        return x

    return loop
