"""The benchmark's report: ratios first, then how cost grows, times, accuracy, machine and settings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hqp_rp.compare.figures.chart import Line, Lines, styles
from hqp_rp.compare.report.opening import first_chart
from hqp_rp.compare.report.report import Opening, Report, Section, Table
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number
from hqp_rp.core.words import listing
from tests.bench.accuracy import ACCEPTED
from tests.bench.extra import BATCH, COUNTED_FAMILY, GROWERS, LEVEL_ROWS, LEVEL_UNKNOWNS, Curves
from tests.bench.families import FAMILIES
from tests.bench.floor import FLOOR
from tests.bench.history import MARGIN
from tests.bench.inside_report import inside_answer, inside_section
from tests.bench.measure import Measured, Result
from tests.bench.ratios_report import fastest, ratios_section
from tests.bench.record import Bench
from tests.bench.timing import PARTS, TURN, ratio

say = Sentences(__file__)


def bench_report(done: Bench) -> Report:
    """The whole report of a benchmark, as data."""
    measured = done.measured
    solved = [result for result in measured.results if result.name in FAMILIES]
    steps = [result for result in measured.results if result.name not in FAMILIES]
    inside = inside_section(measured.inside)
    sections = [
        Section("The answer", answer(measured), listed=True),
        ratios_section(measured),
        *([inside] if inside is not None else []),
        Section("Against the last run", done.against, listed=True),
        Section("What this cannot tell", (*_cannot_tell(), *measured.missing), listed=True),
    ]
    if measured.growth:
        sections.append(Section("How cost grows", charts=tuple(_growth(o, c) for o, c in measured.growth.items())))
    if solved:
        sections.append(Section("Times of a solve", tables=tuple(_times(result) for result in solved)))
    if steps:
        tables = tuple(_times(result) for result in steps)
        sections.append(Section("Times of a control step", (say("whole_steps"),), tables=tables))
    sections += [
        Section("Batches, start and instructions", tables=(_batch(measured), _start(measured), *_instructions(measured)),
                sentences=(measured.no_instructions,) if measured.no_instructions else ()),
        Section("Settings", tables=(_settings(measured), _refusals(measured), _machine(done))),
    ]  # fmt: skip
    labels = [*GROWERS, FLOOR, "flop count"]
    return Report("hqp_rp: benchmark", say("question"), tuple(sections), styles([labels]), _opening(measured, sections))


def _cannot_tell() -> tuple[str, ...]:
    return (
        say("in_turns", calls=TURN),
        say("certified_means", tolerance=ACCEPTED),
        say("prepared_beforehand"),
        say("other_robots_differ"),
        say("weights_solve_another_problem"),
        say("steps_behind_one_call"),
    )


def _opening(measured: Measured, sections: Sequence[Section]) -> Opening:
    """For each family the fastest that is certified on every instance, whoever made it; ours against theirs in numbers."""
    advice, against = [], []
    for result in measured.results:
        ours, peers = fastest(result, peer=False), fastest(result, peer=True)
        best = min((row for row in (ours, peers) if row is not None), key=lambda row: row.timing.median, default=None)
        told = say("nobody_certified") if best is None else f"{best.label} ({_us(best.timing.median)} us)"
        advice.append((result.title, told))
        if ours is not None and peers is not None:
            against.append((ratio(ours.timing, peers.timing).value, result.title, peers.label))
    numbers = []
    if against:
        for pick, largest in ((max, True), (min, False)):
            value, title, peer = pick(against)
            numbers.append((f"{value:.3g} times", say("extreme_ratio", largest=largest, title=title, peer=peer)))
    slowest = _slowest_start(measured)
    numbers.append((f"{number(measured.start[slowest])} s", say("slowest_start", name=slowest)))
    header = ("problems", "the fastest that is right on all of them")
    return Opening(tuple(advice), tuple(numbers), first_chart(sections), header)


def answer(measured: Measured) -> tuple[str, ...]:
    """For each family, our fastest certified solver beside the fastest certified peer; then batch and start."""
    sentences = [_fastest(result) for result in measured.results]
    sentences += inside_answer(measured.inside)
    most = max((threads for _, threads, _ in measured.batch), default=0)
    sentences += [
        say("many_at_once", name=name, rate=_plain(rate), threads=threads)
        for name, threads, rate in measured.batch
        if threads == most
    ]
    slowest = _slowest_start(measured)
    start = measured.start
    sentences.append(say("first_answer", imported=start["import"], slowest=start[slowest], name=slowest))
    return tuple(sentences)


def _fastest(result: Result) -> str:
    ours, peers = fastest(result, peer=False), fastest(result, peer=True)
    if ours is None:
        return say("none_certified", title=result.title)
    us = _us(ours.timing.median)
    if peers is None:
        slower = [
            (ratio(ours.timing, row.timing).value, row.label, row.accuracy.error) for row in result.rows if row.peer
        ]
        return say("no_peer_certified", title=result.title, label=ours.label, us=us, slower=slower)
    times = ratio(ours.timing, peers.timing).value
    return say("beside_peer", title=result.title, label=ours.label, us=us, times=times, peer=peers.label)


def _slowest_start(measured: Measured) -> str:
    return max((name for name in measured.start if name != "import"), key=lambda name: measured.start[name])


def _us(seconds: float) -> str:
    return _plain(seconds * 1e6)


def _plain(value: float) -> str:
    """Three digits, large ones without an exponent: 1.17, 408, 165,000."""
    return number(value, 3) if value < 1e4 else f"{float(f'{value:.3g}'):,.0f}"


def _growth(over: str, curves: Curves) -> Lines:
    lines = tuple(
        Line(label, np.array([at for at, _ in points]), np.array([1e6 * t for _, t in points]))
        for label, points in curves.items()
    )
    return Lines(
        name=f"growth_{over}",
        title=f"Cost over {over}",
        caption=say("growth_shows", over=over, rows=LEVEL_ROWS, n=LEVEL_UNKNOWNS, floor=FLOOR),
        x_label=f"number of {over}",
        columns=("solver",),
        rows=("us per call",),
        panels=((lines,),),
        log_x=over == "unknowns",
        log_y=(True,),
        floor=(0.01,),
        ceiling=(1e7,),
    )


def _times(result: Result) -> Table:
    rows = []
    for row in sorted(result.rows, key=lambda row: row.timing.median):
        accuracy = row.accuracy
        rows.append(
            (
                row.label,
                "peer" if row.peer else "hqp_rp",
                _us(row.timing.median),
                _us(row.timing.p99),
                str(row.timing.calls),
                f"{accuracy.certified} of {accuracy.asked}",
                number(accuracy.error),
                number(accuracy.distance),
                accuracy.fault,
            )
        )
    header = ("entrant", "whose", "median, us", "p99, us", "calls", "certified", "error", "distance", "first fault")
    return Table(result.title, header, tuple(rows), f"{result.words}.", text=frozenset({0, 1, 8}))


def _batch(measured: Measured) -> Table:
    rows = tuple((name, str(threads), _plain(rate)) for name, threads, rate in measured.batch)
    return Table(
        "Many at once",
        ("what", "threads", "per second"),
        rows,
        say("batch_table", count=BATCH),
    )


def _start(measured: Measured) -> Table:
    rows = tuple(
        (name if name == "import" else f"import and {name}", number(seconds))
        for name, seconds in measured.start.items()
    )
    return Table("Start", ("what", "s"), rows, say("start_table"))


def _instructions(measured: Measured) -> list[Table]:
    if not measured.instructions:
        return []
    rows = tuple((label, _plain(count)) for label, count in measured.instructions.items())
    return [Table(f"Instructions per call on {COUNTED_FAMILY}", ("entrant", "instructions"), rows)]


def _settings(measured: Measured) -> Table:
    known = {row.label: row for result in measured.results for row in result.rows}
    rows = tuple((row.label, "peer" if row.peer else "hqp_rp", row.settings) for row in known.values())
    return Table("Entrants", ("entrant", "whose", "settings"), rows, text=frozenset({0, 1, 2}))


def _refusals(measured: Measured) -> Table:
    found: dict[tuple[str, str], list[str]] = {}
    for result in measured.results:
        for label, sentence in result.refused.items():
            found.setdefault((label, sentence), []).append(result.title)
    rows = tuple((label, listing(titles), sentence) for (label, sentence), titles in found.items())
    return Table("Who takes no part where", ("entrant", "families", "why"), rows, text=frozenset({0, 1, 2}))


def _machine(done: Bench) -> Table:
    entry = done.entry
    rows = [*entry.machine.items(), *entry.versions.items(), ("effort", "quick" if entry.asked["quick"] else "full")]
    caption = say("machine_table", margin=MARGIN, parts=PARTS)
    return Table("Machine and versions", ("what", "which"), tuple(rows), caption, text=frozenset({0, 1}))
