"""The benchmark's report: ratios first, then how cost grows, times, accuracy, machine and settings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hqp_rp.compare.figures.chart import Line, Lines, styles
from hqp_rp.compare.report.opening import first_chart
from hqp_rp.compare.report.report import Opening, Report, Section, Table
from hqp_rp.compare.report.words import listing, number
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

QUESTION = "How fast is each prioritized solver, next to what a user would pick instead, at equal accuracy?"

_CANNOT_TELL = (
    f"Calls are timed in turns of {TURN}, one entrant after the other within one process and on one thread, so that load on "
    "the machine meets all of them alike: ratios within one run mean something, times of two runs do not compare.",
    f"Certified means that `certify` accepts every judged answer at a relative {ACCEPTED:g}. The time of an entrant that is "
    "not certified buys less: it is shown in grey, and no ratio of ours is stated for a solver of ours that is not.",
    "Peers are called with arrays prepared beforehand, ours with the problem built beforehand; answer and status included.",
    "The families are random or follow smooth made-up paths; another robot's problems differ in how many limits are active.",
    "A weighted front end (mink, pink, placo) solves another problem, with costs in place of priorities: it is there because "
    "users choose it, and its error says what that costs.",
    "placo and roboplan make a whole control step in C++, behind one call; ours goes through Python, robot to task to solver.",
)


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
    labels = [*GROWERS, FLOOR, "flop count"]
    return Report("hqp_rp: benchmark", QUESTION, tuple(sections), styles([labels]), _opening(measured, sections))


def _opening(measured: Measured, sections: Sequence[Section]) -> Opening:
    """For each family the fastest that is certified on every instance, whoever made it; ours against theirs in numbers."""
    advice, against = [], []
    for result in measured.results:
        ours, peers = fastest(result, peer=False), fastest(result, peer=True)
        best = min((row for row in (ours, peers) if row is not None), key=lambda row: row.timing.median, default=None)
        told = (
            "nobody was certified on every instance" if best is None else f"{best.label} ({_us(best.timing.median)} us)"
        )
        advice.append((result.title, told))
        if ours is not None and peers is not None:
            against.append((ratio(ours.timing, peers.timing).value, result.title, peers.label))
    numbers = []
    if against:
        for pick, words in ((max, "at most"), (min, "at least")):
            value, title, label = pick(against)
            numbers.append((f"{value:.3g} times", f"as fast as the fastest certified peer, {words}: {title}, {label}"))
    slowest = max((name for name in measured.start if name != "import"), key=lambda name: measured.start[name])
    numbers.append((f"{number(measured.start[slowest])} s", f"import and first answer of a fresh process ({slowest})"))
    header = ("problems", "the fastest that is right on all of them")
    return Opening(tuple(advice), tuple(numbers), first_chart(sections), header)


def answer(measured: Measured) -> tuple[str, ...]:
    """For each family, our fastest certified solver beside the fastest certified peer; then batch and start."""
    sentences = []
    for result in measured.results:
        ours, peers = fastest(result, peer=False), fastest(result, peer=True)
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
    sentences += inside_answer(measured.inside)
    for name, threads, rate in measured.batch:
        if threads == max(t for _, t, _ in measured.batch):
            cores = "1 core" if threads == 1 else f"{threads} cores"
            sentences.append(f"{name}: {_plain(rate)} a second on {cores}.")
    slowest = max((name for name in measured.start if name != "import"), key=lambda name: measured.start[name])
    sentences.append(
        f"import hqp_rp takes {number(measured.start['import'])} s; with a first answer, in a fresh process, at most "
        f"{number(measured.start[slowest])} s ({slowest})."
    )
    return tuple(sentences)


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
    of_n = "three levels of n/4 rows, n = 4 ... 200"
    of_p = f"1 ... 8 levels of {LEVEL_ROWS} rows, n = {LEVEL_UNKNOWNS}"
    caption = (
        f"Median time per call on random equality levels: {of_n if over == 'unknowns' else of_p}. The {FLOOR} is a plain "
        "cascade in C, without Python. The flop count of an "
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
        f"Up to {BATCH} problems or configurations in one call; solve_batch on two levels of three rows.",
    )


def _start(measured: Measured) -> Table:
    rows = tuple(
        (name if name == "import" else f"import and {name}", number(seconds))
        for name, seconds in measured.start.items()
    )
    caption = "Fresh processes, medians, numpy loaded before the clock starts; nothing is compiled at run time."
    return Table("Start", ("what", "s"), rows, caption)


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
    caption = (
        f"A ratio is called worse than the last kept one when it fell by more than {MARGIN:.0%} plus its spread in both runs, "
        f"the spread being half its range over {PARTS} consecutive parts of a run."
    )
    return Table("Machine and versions", ("what", "which"), tuple(rows), caption, text=frozenset({0, 1}))
