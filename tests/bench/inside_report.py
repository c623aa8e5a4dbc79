"""The part of the benchmark's report on what is inside a call: ratios first, then the times behind them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hqp_rp.compare.report.report import Section, Table
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number
from tests.bench.accuracy import ACCEPTED
from tests.bench.floor import CALL, FLOOR, KERNEL, LEXLS, SOLVE, Floor
from tests.bench.inside import Inside
from tests.bench.step_parts import PARTS_OF_A_STEP
from tests.bench.timing import ratio

say = Sentences(__file__)


def inside_section(inside: Inside) -> Section | None:
    """The section, or None when nothing of it was measured."""
    makers: Sequence[tuple[Sequence[object], Callable[[Inside], Table]]] = (
        (inside.floor, _native),
        (inside.floor, _shares),
        (inside.steps, _steps),
        (inside.qps, _qps),
        (inside.allocated, _allocated),
    )
    tables = tuple(maker(inside) for found, maker in makers if found)
    return Section("Inside a call", inside.missing, listed=True, tables=tables) if tables or inside.missing else None


def inside_answer(inside: Inside) -> list[str]:
    """One sentence for each part: the range of its ratios."""
    sentences = []
    for other in (FLOOR, LEXLS):
        values = {item.title: 1.0 / _over(item, other) for item in inside.floor if _comparable(item, other)}
        if values:
            low, high = _range(values)
            sentences.append(say("kernel_takes", low=low, high=high, lexls=other == LEXLS))
    shares = {item.title: 1.0 - item.share("kernel") for item in inside.floor}
    if shares:
        (least, share), high = _range(shares)
        sentences.append(say("python_around_kernel", low=(least, max(share, 0.0)), high=high))
    for item in inside.steps:
        kinematics, tasks, solve = (seconds / sum(item.seconds) for seconds in item.seconds)
        sentences.append(say("step_goes_to", title=item.title, kinematics=kinematics, tasks=tasks, solve=solve))
    if inside.qps:
        low, high = _range({item.title: item.times_slower.value for item in inside.qps})
        sentences.append(say("cascade_takes", low=low, high=high))
    return sentences


def _range(values: dict[str, float]) -> tuple[tuple[str, float], tuple[str, float]]:
    """The least and the largest, each with its name; of equal ones the first."""
    return min(values.items(), key=lambda item: item[1]), max(values.items(), key=lambda item: item[1])


def _comparable(item: Floor, other: str) -> bool:
    return other in item.times and item.accuracy[KERNEL].ok and item.accuracy[other].ok


def _over(item: Floor, other: str) -> float:
    return ratio(item.times[KERNEL], item.times[other]).value


def _us(seconds: float) -> str:
    return number(seconds * 1e6, 3)


def _native(inside: Inside) -> Table:
    others = [other for other in (FLOOR, LEXLS) if any(other in item.times for item in inside.floor)]
    rows = tuple(
        (
            item.title,
            *(f"{1.0 / _over(item, other):.3g}" if _comparable(item, other) else "-" for other in others),
            _us(item.times[KERNEL].median),
            *(_us(item.times[other].median) if other in item.times else "-" for other in others),
        )
        for item in inside.floor
    )
    ways = sorted({item.lexls for item in inside.floor if item.lexls})
    bad = [(label, item.title) for item in inside.floor for label, found in item.accuracy.items() if not found.ok]
    caption = say("native_table", ways=ways, tolerance=ACCEPTED, uncertified=bad)
    header = (
        "family",
        *(f"kernel over {other}" for other in others),
        "kernel, us",
        *(f"{other}, us" for other in others),
    )
    return Table("The kernel of null space beside native code", header, rows, caption)


def _shares(inside: Inside) -> Table:
    rows = tuple(
        (
            item.title,
            *(f"{max(item.share(part), 0.0):.0%}" for part in ("kernel", "dispatch", "solution")),
            *(_us(item.times[label].median) for label in (KERNEL, CALL, SOLVE)),
        )
        for item in inside.floor
    )
    header = ("family", "kernel", "dispatch", "solution", "kernel, us", "kernel from Python, us", "Solver.solve, us")
    return Table("Where the time of a null_space call goes", header, rows, say("shares_table"))


def _steps(inside: Inside) -> Table:
    rows = tuple(
        (
            item.title,
            *(f"{seconds / sum(item.seconds):.0%}" for seconds in item.seconds),
            *(_us(seconds) for seconds in (*item.seconds, item.whole)),
        )
        for item in inside.steps
    )
    header = ("family", *PARTS_OF_A_STEP, *(f"{part}, us" for part in PARTS_OF_A_STEP), "a step, us")
    return Table("Where the time of a control step goes", header, rows, say("steps_table"))


def _qps(inside: Inside) -> Table:
    rows = tuple(
        (
            item.title,
            f"{item.times_slower.value:.3g}",
            number(item.qps, 3),
            _us(item.cascade.median),
            _us(item.native.median),
            number(item.deviation),
        )
        for item in inside.qps
    )
    header = ("family", "cascade over its QPs", "QPs a solve", "qp_cascade, us", "its QPs, us", "difference")
    return Table("qp_cascade on ProxQP beside its own native QPs", header, rows, say("qps_table"))


def _allocated(inside: Inside) -> Table:
    rows = tuple(
        (item.family, item.label, number(item.arrays, 3), number(item.beyond, 3), number(item.kept, 3))
        for item in inside.allocated
    )
    header = ("family", "solver", "arrays", "bytes beyond the answer", "bytes kept")
    return Table("Allocations of a solve", header, rows, say("allocations_table"), text=frozenset({0, 1}))
