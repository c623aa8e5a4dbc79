"""What every worker shares: it reads problems as plain .npz, answers JSON lines, and times its own calls. numpy alone.

A worker is a Python file that is run by its peer's own interpreter. It hands a `Worker` to `serve`, which answers

    {"about": 1}                                     package, version, settings of each variant
    {"solve": PATH, "variant": NAME}                 x, whether the peer calls it a success, its own words, its promise
    {"time": [PATH, ...], "variant": NAME, "calls": K}    K times in ns, round the problems
    {"step": {...}}, {"velocity": i}, {"turn": i, "calls": K}    whole control steps from q to v

`python NAME_worker.py --cold PATH` solves one problem and ends: for the time from interpreter start to first answer.
"""

from __future__ import annotations

import dataclasses
import importlib.metadata
import itertools
import json
import os
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

Array = Any


class Rows(NamedTuple):
    """lower <= A x <= upper; equalities where the bounds coincide, infinite where there is none."""

    A: Array
    lower: Array
    upper: Array

    @property
    def equal(self) -> bool:
        return bool(np.array_equal(self.lower, self.upper))


class Given(NamedTuple):
    """A problem: n unknowns, levels in order, hard rows or None; "stacked" is all levels in one `Rows`, with their ends."""

    n: int
    levels: list[Rows]
    hard: Rows | None
    stacked: Rows
    ends: Array

    @property
    def equalities(self) -> bool:
        return all(level.equal for level in self.levels)


class Answer(NamedTuple):
    """x (n,) or None, whether the peer calls it a success, its own words, and what it then promises (see `measure.py`)."""

    x: Array | None
    success: bool
    said: str
    promise: Mapping[str, Any] | None = None


@dataclasses.dataclass(frozen=True)
class Worker:
    """A peer.

    Attributes:
        package: its name for `importlib.metadata`.
        variants: settings by name, in words.
        cannot: (problem, variant) -> why the peer cannot state it, or "".
        prepare: (problem, variant) -> a call without arguments, with everything built that a control loop has at hand.
        read: (what the call returned, problem, variant) -> Answer.
        step: (robot and tasks) -> a call from q to v; None when the peer has no whole step.
    """

    package: str
    variants: Mapping[str, str]
    cannot: Callable[[Given, str], str] | None = None
    prepare: Callable[[Given, str], Callable[[], Any]] | None = None
    read: Callable[[Any, Given, str], Answer] | None = None
    step: Callable[[Mapping[str, Any]], Callable[[Array], Array]] | None = None
    step_settings: str = ""


def load(path: str) -> Given:
    """A problem of the problem set, or any file of the same arrays."""
    with np.load(path, allow_pickle=False) as file:
        A, lower, upper, offsets = file["matrix"], file["lower"], file["upper"], file["offsets"]
        hard = Rows(file["hard_A"], file["hard_lower"], file["hard_upper"]) if "hard_A" in file.files else None
    levels = [Rows(A[a:b].copy(), lower[a:b].copy(), upper[a:b].copy()) for a, b in itertools.pairwise(offsets)]
    return Given(A.shape[1], levels, hard, Rows(A, lower, upper), offsets[1:])


def costs(count: int) -> list[float]:
    """Weights in place of priorities: 1e2 for the first level, each next one 100 times less, the last not below 1e-4."""
    ratio = min(100.0, 1e6 ** (1.0 / max(count - 1, 1)))
    return [100.0 / ratio**k for k in range(count)]


class _Session:
    def __init__(self, worker: Worker) -> None:
        self.worker = worker
        self.calls: dict[tuple[str, str], Callable[[], Any]] = {}

    def about(self) -> dict[str, Any]:
        version = importlib.metadata.version(self.worker.package)
        return {
            "package": self.worker.package,
            "version": version,
            "python": sys.version.split()[0],
            "variants": dict(self.worker.variants),
            "solves": self.worker.prepare is not None,
            "steps": self.worker.step is not None,
            "step_settings": self.worker.step_settings,
        }

    def solve(self, path: str, variant: str) -> dict[str, Any]:
        worker, given = self.worker, load(path)
        assert worker.cannot is not None
        assert worker.prepare is not None
        assert worker.read is not None
        why = worker.cannot(given, variant)
        if why:
            return {"cannot": why}
        try:
            answer = worker.read(worker.prepare(given, variant)(), given, variant)
        except Exception as error:  # whatever it is, it is the peer's answer
            answer = Answer(None, False, f"{type(error).__name__}: {' '.join(str(error).split())[:120]}")
        x = None if answer.x is None else np.asarray(answer.x, dtype=np.float64).reshape(-1)
        x_given = x is not None and x.shape == (given.n,)
        return {
            "x": x.tolist() if x is not None and x_given else None,
            "success": bool(answer.success and x_given),
            "said": answer.said,
            "promise": dict(answer.promise) if answer.promise else None,
        }

    def time(self, paths: list[str], variant: str, calls: int) -> dict[str, Any]:
        assert self.worker.prepare is not None
        for path in paths:
            if (path, variant) not in self.calls:
                self.calls[path, variant] = self.worker.prepare(load(path), variant)
        ready = [self.calls[path, variant] for path in paths]
        return {"times": _timed(lambda i: ready[i % len(ready)](), range(calls))}

    def begin(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        assert self.worker.step is not None
        self.configurations = [np.array(q) for q in asked["configurations"]]
        self.step = self.worker.step(asked)
        self.step(self.configurations[0])
        return {"ready": True}

    def turn(self, first: int, calls: int) -> dict[str, Any]:
        step, q = self.step, self.configurations
        return {"times": _timed(lambda i: step(q[i % len(q)]), range(first, first + calls))}

    def reply(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        if "about" in asked:
            return self.about()
        if "solve" in asked:
            return self.solve(asked["solve"], asked["variant"])
        if "time" in asked:
            return self.time(asked["time"], asked["variant"], asked["calls"])
        if "step" in asked:
            return self.begin(asked["step"])
        if "velocity" in asked:
            return {"v": np.asarray(self.step(self.configurations[asked["velocity"]])).reshape(-1).tolist()}
        return self.turn(asked["turn"], asked["calls"])


def _timed(call: Callable[[int], Any], turns: range) -> list[int]:
    times = []
    for i in turns:
        begin = time.perf_counter_ns()
        call(i)
        times.append(time.perf_counter_ns() - begin)
    return times


def serve(worker: Worker) -> None:
    """Answer JSON lines from standard input until it ends."""
    # A library may print on standard output, from C++ too: the replies go out on a copy of it.
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    session = _Session(worker)
    if sys.argv[1:2] == ["--cold"]:
        with open(sys.argv[2], encoding="utf-8") as file:
            asked = json.load(file)
        if worker.prepare is None:
            session.begin(asked["step"])
        else:
            session.solve(asked["solve"], asked["variant"] or next(iter(worker.variants)))
        out.write(json.dumps({"done": True}) + "\n")
        return
    for line in sys.stdin:
        try:
            reply = session.reply(json.loads(line))
        except Exception as error:  # the other side tells it
            reply = {"error": f"{type(error).__name__}: {error}"}
        out.write(json.dumps(reply) + "\n")
