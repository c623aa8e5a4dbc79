"""What a benchmark measures, in one process: every family, control steps, growth, batches, start-up."""

from __future__ import annotations

import dataclasses
import functools
import sys
from collections.abc import Callable, Mapping
from typing import Any

from hqp_rp.compare.machine import usable_cores
from tests.bench.accuracy import Accuracy, judge, references
from tests.bench.entrants import SOLVER_PEERS, our_entrants, peer_entrants
from tests.bench.extra import GROWERS, Curves, batch_rates, growth, instruction_counts, start_up
from tests.bench.families import FAMILIES, family
from tests.bench.inside import Inside, inside_ratios, measure_inside
from tests.bench.remote_steps import remote_steppers
from tests.bench.steps import Stepper, step_family, steppers
from tests.bench.timing import LocalRunner, Ratio, Runner, Timing, interleaved, ratio

HEADLINE = ("null space", "reverse priority", "active set, cold", "active set, warm", "DAQP hierarchy", "QP ProxQP")
"""Ours whose ratios over the peers are kept in the history."""

_JUDGED_STEPS = 32


@dataclasses.dataclass(frozen=True, slots=True)
class Asked:
    """What a run is asked for.

    Attributes:
        families, peers: their names. peer_python: interpreters for peers. lexls: folders of LexLS and of Eigen, or None.
        quick: fewer calls and instances.
    """

    families: tuple[str, ...]
    peers: tuple[str, ...]
    peer_python: tuple[str, ...] = ()
    quick: bool = False
    lexls: tuple[str, str] | None = None

    @property
    def calls(self) -> int:
        """Calls per entrant and family, at most."""
        return 400 if self.quick else 4000

    @property
    def budget(self) -> float:
        """Seconds per entrant and family; a slow one makes fewer calls."""
        return 0.15 if self.quick else 1.0

    def words(self) -> dict[str, Any]:
        """What makes two runs comparable: the effort. Families and peers may differ; what both have is compared."""
        return {"quick": self.quick}


@dataclasses.dataclass(frozen=True, slots=True)
class Row:
    """One entrant on one family."""

    label: str
    peer: bool
    settings: str
    timing: Timing
    accuracy: Accuracy


@dataclasses.dataclass(frozen=True, slots=True)
class Result:
    """One family: who took part, and for who did not, the reason (label -> sentence)."""

    name: str
    title: str
    words: str
    rows: tuple[Row, ...]
    refused: Mapping[str, str]


@dataclasses.dataclass(frozen=True, slots=True)
class Measured:
    """All figures of a run.

    Attributes:
        results: one for each family, in order. missing: a sentence for each peer that takes no part.
        versions: of peers in environments of their own.
        growth: what it is over ("unknowns", "levels") -> curves; empty in a quick run.
        batch: (what, threads, per second). start: see `start_up`.
        instructions: label -> per call; no_instructions: why there are none, or "".
        inside: what is inside a call.
    """

    results: tuple[Result, ...]
    missing: tuple[str, ...]
    versions: Mapping[str, str]
    growth: Mapping[str, Curves]
    batch: tuple[tuple[str, int, float], ...]
    start: Mapping[str, float | bool]
    instructions: Mapping[str, float]
    no_instructions: str
    inside: Inside = dataclasses.field(default_factory=Inside)


def measure(asked: Asked, progress: bool = False) -> Measured:
    """Measure everything that is asked for, in this process."""
    announce = _said if progress else _unsaid
    results: list[Result] = []
    missing: list[str] = []
    found_versions: dict[str, str] = {}
    for name in asked.families:
        if name in FAMILIES:
            result, absent = _solve_family(name, asked, functools.partial(announce, name))
        else:
            result, absent, more = _step_family(name, asked, functools.partial(announce, name))
            found_versions |= more
        results.append(result)
        missing += [sentence for sentence in absent if sentence not in missing]
    inside = measure_inside(asked.families, lexls=asked.lexls, quick=asked.quick, announce=announce)
    curves = {}
    if not asked.quick:
        for over in ("unknowns", "levels"):
            announce("growth", over)
            curves[over] = growth(over, asked.peers, calls=asked.calls // 10, budget=asked.budget / 4)
    announce("many at once", "")
    batch = batch_rates(usable_cores(), count=2000 if asked.quick else 20_000)
    announce("start", "")
    start = start_up(2 if asked.quick else 5)
    announce("instructions", "")
    counts, sentence = instruction_counts([*GROWERS, "DAQP, defaults"], calls=500 if asked.quick else 2000)
    return Measured(
        tuple(results), tuple(missing), found_versions, curves, tuple(batch), start, counts, sentence, inside
    )  # fmt: skip


def headline_ratios(measured: Measured) -> list[tuple[str, Ratio]]:
    """(family, how many times faster ours is than a peer), for ours whose every answer was certified; and `inside_ratios`."""
    found = []
    for result in measured.results:
        ours = [row for row in result.rows if not row.peer and row.label in HEADLINE and row.accuracy.ok]
        ours += [row for row in result.rows if not row.peer and "mink" in row.label and row.accuracy.ok]
        peers = [row for row in result.rows if row.peer]
        found += [(result.name, ratio(own.timing, other.timing)) for own in ours for other in peers]
    return found + inside_ratios(measured.inside)


def _solve_family(name: str, asked: Asked, announce: Callable[[str], None]) -> tuple[Result, list[str]]:
    made = family(name, quick=asked.quick)
    peers, missing = peer_entrants([peer for peer in asked.peers if peer in SOLVER_PEERS])
    known = references(made.problems)
    runners: list[Runner] = []
    judged: list[tuple[Any, Accuracy]] = []
    refused = {}
    for entrant in [*our_entrants(), *peers]:
        if entrant.path_only and not made.path:
            continue
        sentence = entrant.refuses(made.problems[0])
        if sentence is not None:
            refused[entrant.label] = sentence
            continue
        announce(entrant.label)
        calls = entrant.prepare(made.problems)
        count = min(len(calls), 64)
        judged.append((entrant, judge(made.problems[:count], calls[:count], entrant.answer, known)))
        runners.append(LocalRunner(entrant.label, calls))
    announce("in turn")
    timings = interleaved(runners, calls=asked.calls, budget=asked.budget)
    rows = tuple(
        Row(entrant.label, entrant.peer, entrant.settings, timing, accuracy)
        for (entrant, accuracy), timing in zip(judged, timings, strict=True)
    )
    return Result(name, made.title, made.words, rows, refused), missing


def _step_family(name: str, asked: Asked, announce: Callable[[str], None]) -> tuple[Result, list[str], dict[str, str]]:
    made = step_family(name, quick=asked.quick)
    chosen, missing = steppers(made, asked.peers)
    remote, absent, found_versions = (
        remote_steppers(made, chosen, asked.peers, asked.peer_python) if name == "step_sawyer" else ([], [], {})
    )
    judged: list[tuple[Stepper, Accuracy]] = []
    runners: list[Runner] = []
    try:
        for stepper in [*chosen, *(stepper for stepper, _ in remote)]:
            announce(stepper.label)
            some = slice(0, len(stepper.calls), max(len(stepper.calls) // _JUDGED_STEPS, 1))
            calls, problems = stepper.calls[some], stepper.problems[some]
            judged.append((stepper, judge(problems, calls, stepper.answer, [None] * len(calls))))
            runners.append(LocalRunner(stepper.label, stepper.calls))
        runners[len(chosen) :] = [runner for _, runner in remote]
        announce("in turn")
        timings = interleaved(runners, calls=asked.calls, budget=asked.budget)
    finally:
        for _, runner in remote:
            runner.close()
    rows = tuple(
        Row(stepper.label, stepper.peer, stepper.settings, timing, accuracy)
        for (stepper, accuracy), timing in zip(judged, timings, strict=True)
    )
    return Result(name, made.title, made.words, rows, {}), [*missing, *absent], found_versions


def _said(name: str, what: str) -> None:
    print(f"{name}: {what}".rstrip(": "), file=sys.stderr, flush=True)


def _unsaid(name: str, what: str) -> None:
    pass
