"""The QP cascade beside the sum of its own QPs: what it costs more than ProxQP's native calls on kept objects."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from hqp_rp.core.problem import Problem
from hqp_rp.core.solver import get_solver
from tests.bench.families import family
from tests.bench.timing import LocalRunner, Ratio, Timing, interleaved, ratio

QP_FAMILIES = (
    *("7_3-3", "7_3-3-7", "30", "100"),
    *("7_limits", "7_limits_path", "humanoid_20", "humanoid_40", "humanoid_40_path"),
)
"""On which families."""

CASCADE, NATIVE = "qp_cascade on ProxQP", "its own native QPs"

_INSTANCES = 32
_LONG = 200_000  # ns: from here on, calls are timed in processor time
_LOGGED = ("init", "update", "solve")


@dataclasses.dataclass(frozen=True, slots=True)
class NativeQps:
    """One family.

    Attributes:
        name, title: of the family.
        qps: QPs of one solve, the mean over the instances.
        cascade, native: times of `Solver.solve`, and of the same QPs updated and solved on kept objects.
        deviation: the largest relative difference between a replayed QP's answer and the recorded one.
    """

    name: str
    title: str
    qps: float
    cascade: Timing
    native: Timing
    deviation: float

    @property
    def times_slower(self) -> Ratio:
        """How many times the sum of its QPs the cascade takes."""
        return ratio(self.native, self.cascade)


@dataclasses.dataclass(frozen=True, slots=True)
class _Call:
    """One native call: the method with its arguments; of a solve, the object's settings, the guess it used and its answer."""

    call: Callable[[], Any]
    results: Any = None
    settings: Any = None
    guess: Any = None
    answer: Any = None


def native_qps(
    names: Sequence[str],
    *,
    quick: bool = False,
    calls: int = 1000,
    budget: float = 0.25,
    announce: Callable[[str], None] = lambda _: None,
) -> tuple[NativeQps, ...]:
    """Time both in turn on each family of these names.

    Args:
        names: of `QP_FAMILIES`. calls: of each, at most. budget: s for each. announce: told the family.
    """
    found = []
    for name in names:
        announce(name)
        made = family(name, quick=quick)
        problems = made.problems if made.path else made.problems[:_INSTANCES]
        tapes = recorded(problems)
        deviation = max((play_and_compare(tape) for tape in tapes), default=0.0)
        solver = get_solver("qp_cascade", backend="proxqp")
        solves = [functools.partial(solver.solve, problem) for problem in problems]
        long = min(LocalRunner(CASCADE, solves).turn(0, 8)) > _LONG
        # The machine's other work falls into long calls; reading processor time would cost short ones too much.
        clock = time.thread_time_ns if long else time.perf_counter_ns
        runners = [LocalRunner(CASCADE, solves, clock), LocalRunner(NATIVE, played(tapes), clock)]
        cascade, native = interleaved(runners, calls=calls, budget=budget)
        qps = float(np.mean([sum(item.results is not None for item in tape) for tape in tapes]))
        found.append(NativeQps(name, made.title, qps, cascade, native, deviation))
    return tuple(found)


def recorded(problems: Sequence[Problem]) -> list[list[_Call]]:
    """For each problem, every native call that the cascade makes on it once its objects exist, in order."""
    tapes: list[list[_Call]] = []
    tape: list[_Call] = []
    with _listening(tape):
        solver = get_solver("qp_cascade", backend="proxqp")
        for problem in problems:  # objects are made, and warm starts filled
            solver.solve(problem)
        for problem in problems:
            tape.clear()
            solver.solve(problem)
            tapes.append(list(tape))
        solver.reset()
    return tapes


def played(tapes: Sequence[Sequence[_Call]]) -> list[Callable[[], None]]:
    """For each tape, a call that makes its calls again on the same objects.

    The initial guess is set, as ProxQP's user has to, on the objects that do not always use the same one.
    """
    guesses: dict[int, set[Any]] = {}
    for item in (item for tape in tapes for item in tape if item.settings is not None):
        guesses.setdefault(id(item.settings), set()).add(item.guess)

    def player(tape: Sequence[_Call]) -> Callable[[], None]:
        steps = [
            (item.call, item.settings if len(guesses.get(id(item.settings), ())) > 1 else None, item.guess)
            for item in tape
        ]

        def play() -> None:
            for call, settings, guess in steps:
                if settings is not None:
                    settings.initial_guess = guess
                call()

        return play

    return [player(tape) for tape in tapes]


def play_and_compare(tape: Sequence[_Call]) -> float:
    """Make the recorded calls again; the largest relative difference of an answer from the recorded one."""
    worst = 0.0
    for item in tape:
        if item.settings is not None:
            item.settings.initial_guess = item.guess
        item.call()
        if item.results is not None:
            x = np.array(item.results.x)
            worst = max(worst, float(np.linalg.norm(x - item.answer) / (1.0 + np.linalg.norm(item.answer))))
    return worst


@contextlib.contextmanager
def _listening(tape: list[_Call]) -> Iterator[None]:
    """Within it, every `proxqp.dense.QP` that is made writes what is asked of it on the tape."""
    from proxsuite import proxqp

    original = proxqp.dense.QP
    proxqp.dense.QP = functools.partial(_Listener, original, tape)
    try:
        yield
    finally:
        proxqp.dense.QP = original


class _Listener:
    """Stands in for a `proxqp.dense.QP`: passes everything on, and keeps copies of what it passed."""

    def __init__(self, original: Any, tape: list[_Call], *arguments: Any, **named: Any) -> None:
        self._real = original(*arguments, **named)
        self._tape = tape

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._real, name)
        return functools.partial(self._logged, name, found) if name in _LOGGED else found

    def _logged(self, name: str, method: Callable[..., Any], *arguments: Any, **named: Any) -> None:
        copies = [np.copy(a) if isinstance(a, np.ndarray) else a for a in arguments]
        call = functools.partial(
            method, *copies, **{key: np.copy(a) if isinstance(a, np.ndarray) else a for key, a in named.items()}
        )
        guess = self._real.settings.initial_guess
        call()
        if name == "solve":
            results = self._real.results
            self._tape.append(_Call(call, results, self._real.settings, guess, np.array(results.x)))
        else:
            self._tape.append(_Call(call))
