"""Timing in turns, A B A B ..., within one process, and the statistics of it."""

from __future__ import annotations

import dataclasses
import gc
import math
import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.problem import FloatArray

TURN = 8
"""Calls that a runner makes in one turn, each timed by itself; then it is the next one's turn."""

PARTS = 5
"""A run is cut into this many consecutive parts; how a ratio differs between them is its spread."""


class Runner(Protocol):
    """Who is timed: `turn` calls it `count` times, from instance `first` on and round again; the time of each call in ns."""

    @property
    def label(self) -> str: ...

    def turn(self, first: int, count: int) -> list[int]: ...


@dataclasses.dataclass(frozen=True, slots=True)
class LocalRunner:
    """Calls in this process, one for each instance.

    `clock` gives ns: `time.perf_counter_ns`, or `time.thread_time_ns` for calls so long that the machine's other work falls
    into them.
    """

    label: str
    calls: Sequence[Callable[[], Any]]
    clock: Callable[[], int] = time.perf_counter_ns

    def turn(self, first: int, count: int) -> list[int]:
        calls, clock = self.calls, self.clock
        times = []
        for i in range(first, first + count):
            call = calls[i % len(calls)]
            start = clock()
            call()
            times.append(clock() - start)
        return times


@dataclasses.dataclass(frozen=True, slots=True)
class Timing:
    """Times per call, in seconds.

    Attributes:
        label: who. calls: how many calls were timed.
        median, p99: of single calls.
        parts: (PARTS,) the median of each consecutive part of the run.
    """

    label: str
    calls: int
    median: float
    p99: float
    parts: FloatArray


@dataclasses.dataclass(frozen=True, slots=True)
class Ratio:
    """How many times faster `label` is than `than`, by medians; spread: half its range over the parts, relative."""

    label: str
    than: str
    value: float
    spread: float


def interleaved(
    runners: Sequence[Runner],
    *,
    calls: int,
    budget: float,
    advance: Callable[[str], None] | None = None,
) -> list[Timing]:
    """Time the runners in turn, each turn of `TURN` calls.

    Every runner is warmed up by calls that do not count. One that would need more than `budget` seconds for all its calls
    takes part in fewer turns, spread evenly over the run. The garbage collector rests meanwhile.

    Args:
        runners: who; each keeps its own place among its instances, so that it meets them in order.
        calls: per runner, at most. budget: s, per runner. advance: told the label before a runner is warmed up.
    """
    turns = [0] * len(runners)
    for k, runner in enumerate(runners):
        if advance is not None:
            advance(runner.label)
        runner.turn(0, 1)
        once = sorted(runner.turn(1, 3))[1] * 1e-9
        affordable = min(calls, max(int(budget / max(once, 1e-9)), PARTS))
        turns[k] = max(math.ceil(affordable / TURN), 1)
        if once * TURN < 0.05:
            runner.turn(4, TURN)
    rounds = max(turns, default=0)
    taken = [0] * len(runners)
    times: list[list[int]] = [[] for _ in runners]
    enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        for r in range(rounds):
            for k, runner in enumerate(runners):
                if (r + 1) * turns[k] // rounds > r * turns[k] // rounds:
                    times[k] += runner.turn(taken[k], TURN)
                    taken[k] += TURN
    finally:
        if enabled:
            gc.enable()
    return [timing(runner.label, np.array(own)) for runner, own in zip(runners, times, strict=True)]


def timing(label: str, nanoseconds: NDArray[np.integer]) -> Timing:
    """The statistics of single calls, given in ns in the order in which they were made; at least one."""
    seconds = np.asarray(nanoseconds, dtype=np.float64) * 1e-9
    pieces = [piece if piece.size else seconds for piece in np.array_split(seconds, PARTS)]
    parts = np.array([np.median(piece) for piece in pieces])
    return Timing(label, len(seconds), float(np.median(seconds)), float(np.quantile(seconds, 0.99)), parts)


def ratio(own: Timing, other: Timing) -> Ratio:
    """How many times faster `own` is than `other`."""
    value = other.median / own.median
    parts = other.parts / own.parts
    return Ratio(own.label, other.label, value, float(parts.max() - parts.min()) / 2.0 / value)
