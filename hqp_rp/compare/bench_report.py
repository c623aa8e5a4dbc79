"""The benchmark's report: ratios first, then how cost grows, times, accuracy, machine and settings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hqp_rp.compare.bench_accuracy import ACCEPTED
from hqp_rp.compare.bench_extra import BATCH, COUNTED_FAMILY, GROWERS, LEVEL_ROWS, LEVEL_UNKNOWNS, Curves
from hqp_rp.compare.bench_families import FAMILIES
from hqp_rp.compare.bench_history import MARGIN
from hqp_rp.compare.bench_measure import HEADLINE, Measured, Result, Row
from hqp_rp.compare.bench_timing import PARTS, TURN, ratio
from hqp_rp.compare.chart import Bars, Line, Lines, styles
from hqp_rp.compare.report import Report, Section, Table, listing, number

if TYPE_CHECKING:
    from hqp_rp.compare.bench import Bench

QUESTION = "How fast is each prioritized solver, next to what a user would pick instead, at equal accuracy?"

_KINDS = ("hqp_rp, certified", "peer, certified", "not certified")

_CANNOT_TELL = (
    f"Calls are timed in turns of {TURN}, one entrant after the other within one process and on one thread, so that load on "
    "the machine meets all of them alike: ratios within one run mean something, times of two runs do not compare.",
    f"Certified means that `certify` accepts every judged answer at a relative {ACCEPTED:g}. The time of an entrant that is "
    "not certified buys less: it is shown in grey, and no ratio of ours is stated for a solver of ours that is not.",
    "Peers are called with arrays prepared beforehand, ours with the problem built beforehand; answer and status included.",
    "The families are random or follow smooth made-up paths; another robot's problems differ in how many limits are active.",
    "A weighted front end (mink, pink, placo) solves another problem, with costs in place of priorities: it is there because "
    "users choose it, and its error says what that costs.",
)


def bench_report(done: Bench) -> Report:
    """The whole report of a benchmark, as data."""
    measured = done.measured
    solved = [result for result in measured.results if result.name in FAMILIES]
    steps = [result for result in measured.results if result.name not in FAMILIES]
    sections = [
        Section("The answer", answer(measured), listed=True),
        Section(
            "Ratios",
            ("How many times faster each certified solver of ours is than each peer; below 1 the peer is faster.",),
            charts=tuple(_bars(measured)),
            tables=tuple(_ratios(result) for result in measured.results),
        ),
        Section("Against the last run", done.against, listed=True),
        Section("What this cannot tell", (*_CANNOT_TELL, *measured.missing), listed=True),
    ]
    if measured.growth:
        sections.append(Section("How cost grows", charts=tuple(_growth(o, c) for o, c in measured.growth.items())))
    if solved:
        sections.append(Section("Times of a solve", tables=tuple(_times(result) for result in solved)))
    if steps:
        words = "Kinematics, tasks and solve, from a configuration to a joint velocity."
        sections.append(Section("Times of a control step", (words,), tables=tuple(_times(result) for result in steps)))
    sections += [
        Section("Batches, start and instructions", tables=(_batch(measured), _start(measured), *_instructions(measured)),
                sentences=(measured.no_instructions,) if measured.no_instructions else ()),
        Section("Settings", tables=(_settings(measured), _refusals(measured), _machine(done))),
    ]  # fmt: skip
    labels = [*GROWERS, "flop count"]
    return Report("hqp_rp: benchmark", QUESTION, tuple(sections), styles([labels]))


def answer(measured: Measured) -> tuple[str, ...]:
    """For each family, our fastest certified solver beside the fastest certified peer; then batch and start."""
    sentences = []
    for result in measured.results:
        ours, peers = _fastest(result, peer=False), _fastest(result, peer=True)
        if ours is None:
            sentences.append(f"{result.title}: none of ours was certified on every instance.")
        elif peers is None:
            slower = [row for row in result.rows if row.peer]
            words = ", ".join(
                f"{ratio(ours.timing, row.timing).value:.3g} times as fast as {row.label} (error {number(row.accuracy.error)})"
                for row in slower
            )
            told = f"; it is {words}" if words else ""
            sentences.append(
                f"{result.title}: {ours.label}, {_us(ours.timing.median)} us; no peer was certified{told}."
            )
        else:
            value = ratio(ours.timing, peers.timing).value
            words = f"{value:.3g} times as fast as" if value >= 1.0 else f"{1.0 / value:.3g} times slower than"
            sentences.append(
                f"{result.title}: {ours.label}, {_us(ours.timing.median)} us, is {words} the fastest certified peer, "
                f"{peers.label}."
            )
    for name, threads, rate in measured.batch:
        if threads == max(t for _, t, _ in measured.batch):
            cores = "1 core" if threads == 1 else f"{threads} cores"
            sentences.append(f"{name}: {number(rate, 3)} a second on {cores}.")
    compiler = "with" if measured.start["compiler"] else "without"
    sentences.append(
        f"import hqp_rp takes {number(measured.start['import'])} s, {compiler} loading the compiler; the first solve with a "
        f"cached kernel {number(measured.start['first solve'])} s."
    )
    return tuple(sentences)


def _fastest(result: Result, *, peer: bool) -> Row | None:
    rows = [row for row in result.rows if row.peer == peer and row.accuracy.ok]
    return min(rows, key=lambda row: row.timing.median, default=None)


def _us(seconds: float) -> str:
    return number(seconds * 1e6, 3)


def _ratios(result: Result) -> Table:
    peers = [row for row in result.rows if row.peer]
    ours = [row for row in result.rows if not row.peer and (row.label in HEADLINE or "mink" in row.label)]
    rows = tuple(
        (own.label, *(f"{ratio(own.timing, peer.timing).value:.3g}" for peer in peers))
        for own in ours
        if own.accuracy.ok
    )
    left = [own.label for own in ours if not own.accuracy.ok]
    inaccurate = [f"{peer.label} (error {number(peer.accuracy.error)})" for peer in peers if not peer.accuracy.ok]
    caption = f"Not certified, so without ratios: {listing(left)}. " if left else ""
    caption += f"Peers that were not certified: {listing(inaccurate)}." if inaccurate else "All peers were certified."
    return Table(result.title, ("times faster than", *(peer.label for peer in peers)), rows, caption)


_CHARTS = (
    ("ratios_7", "7 joints", ("7_3-3", "7_1-5", "7_6-1-7", "7_3-3-7")),
    ("ratios_limits", "Hard rows", ("7_limits", "7_limits_path", *(f"humanoid_{n}" for n in ("20", "40", "60", "40_path")))),
    ("ratios_large", "Many unknowns", ("30", "100")),
    ("ratios_steps", "A whole control step", ("step_sawyer", "step_sawyer_limits", "step_humanoid")),
)  # fmt: skip


def _bars(measured: Measured) -> list[Bars]:
    results = {result.name: result for result in measured.results}
    charts = []
    for name, title, families in _CHARTS:
        groups = []
        for family in families:
            own = _fastest(results[family], peer=False) if family in results else None
            if own is None:
                continue
            rows = sorted(results[family].rows, key=lambda row: row.timing.median)
            bars = tuple(
                (row.label, row.timing.median / own.timing.median, int(row.peer) if row.accuracy.ok else 2)
                for row in rows
            )
            groups.append((f"{results[family].title}: times of {own.label}, {_us(own.timing.median)} us", bars))
        if groups:
            caption = (
                "Median time per call over that of our fastest certified solver. Grey: not certified on every instance."
            )
            charts.append(Bars(name, title, caption, "times slower (log)", tuple(groups), _KINDS))
    return charts


def _growth(over: str, curves: Curves) -> Lines:
    lines = tuple(
        Line(label, np.array([at for at, _ in points]), np.array([1e6 * t for _, t in points]))
        for label, points in curves.items()
    )
    of_n = "three levels of n/4 rows, n = 4 ... 200"
    of_p = f"1 ... 8 levels of {LEVEL_ROWS} rows, n = {LEVEL_UNKNOWNS}"
    caption = (
        f"Median time per call on random equality levels: {of_n if over == 'unknowns' else of_p}. The flop count of an "
        "orthogonal cascade is drawn at the rate that null space reaches at the last point: where a curve lies above it, calls "
        "and short loops cost more than arithmetic."
    )
    return Lines(
        name=f"growth_{over}",
        title=f"Cost over {over}",
        caption=caption,
        x_label=f"number of {over}",
        columns=("solver",),
        rows=("us per call",),
        panels=((lines,),),
        log_x=over == "unknowns",
        log_y=(True,),
        floor=(0.1,),
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
    rows = tuple((name, str(threads), number(rate, 3)) for name, threads, rate in measured.batch)
    return Table(
        "Many at once",
        ("what", "threads", "per second"),
        rows,
        f"Up to {BATCH} problems or configurations in one call; solve_batch on two levels of three rows.",
    )


def _start(measured: Measured) -> Table:
    start = measured.start
    rows = (
        ("import hqp_rp", number(start["import"])),
        ("first solve, kernel cached", number(start["first solve"])),
    )
    caption = "Fresh processes, medians. What an empty cache costs, kernel by kernel, is printed by `hqp-rp warmup`."
    return Table("Start", ("what", "s"), rows, caption)


def _instructions(measured: Measured) -> list[Table]:
    if not measured.instructions:
        return []
    rows = tuple((label, number(count, 3)) for label, count in measured.instructions.items())
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
    caption = (
        f"A ratio is called worse than the last kept one when it fell by more than {MARGIN:.0%} plus its spread in both runs, "
        f"the spread being half its range over {PARTS} consecutive parts of a run."
    )
    return Table("Machine and versions", ("what", "which"), tuple(rows), caption, text=frozenset({0, 1}))
