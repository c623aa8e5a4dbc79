"""The part of the benchmark's report on what is inside a call: ratios first, then the times behind them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hqp_rp.compare.report.report import Section, Table
from hqp_rp.compare.report.words import listing, number
from tests.bench.accuracy import ACCEPTED
from tests.bench.floor import CALL, FLOOR, KERNEL, LEXLS, SOLVE, Floor
from tests.bench.inside import Inside
from tests.bench.step_parts import PARTS_OF_A_STEP
from tests.bench.timing import ratio


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
    for other, words in ((FLOOR, "a plain cascade in C"), (LEXLS, "LexLS in C++")):
        values = {item.title: 1.0 / _over(item, other) for item in inside.floor if _comparable(item, other)}
        if values:
            sentences.append(
                f"The native kernel of null space, no call from Python counted, takes {_range(values)} {words}."
            )
    shares = {item.title: 1.0 - item.share("kernel") for item in inside.floor}
    if shares:
        low, high = min(shares, key=lambda title: shares[title]), max(shares, key=lambda title: shares[title])
        least = max(shares[low], 0.0)
        sentences.append(
            f"Of one null_space call, {least:.0%} ({low}) to {shares[high]:.0%} ({high}) is Python around the kernel."
        )
    for item in inside.steps:
        kinematics, tasks, solve = (seconds / sum(item.seconds) for seconds in item.seconds)
        sentences.append(f"{item.title}: {kinematics:.0%} kinematics, {tasks:.0%} tasks, {solve:.0%} solve.")
    if inside.qps:
        values = {item.title: item.times_slower.value for item in inside.qps}
        sentences.append(f"qp_cascade on ProxQP takes {_range(values)} the sum of its own native QPs.")
    return sentences


def _range(values: dict[str, float]) -> str:
    low, high = min(values, key=lambda title: values[title]), max(values, key=lambda title: values[title])
    if low == high:
        return f"{values[low]:.3g} times as long ({low}) as"
    return f"{values[low]:.3g} ({low}) to {values[high]:.3g} times ({high}) as long as"


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
    caption = (
        "In loops without Python, processor time. The floor is tests/bench/native/cascade.c, compiled here with -O3 "
        "-march=native: rows padded to whole vectors, a level's reflections applied to four rows at a time; no pivoting, no "
        "proof of the rank, no check."
    )
    ways = sorted({item.lexls for item in inside.floor if item.lexls})
    if ways:
        caption += f" LexLS by the fastest of its ways to x that is certified ({listing(ways)})."
    bad = [
        f"{label} on {item.title}" for item in inside.floor for label, found in item.accuracy.items() if not found.ok
    ]
    caption += f" Not certified at {ACCEPTED:g}: {listing(bad)}." if bad else " All answers were certified."
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
    caption = (
        "kernel: in a native loop. dispatch: what calling it from Python adds. solution: what Solver.solve adds to that, "
        "with the array for the answer, the checks and the Solution. Shares of Solver.solve, from differences of times: those "
        "below a few per cent are noise."
    )
    header = ("family", "kernel", "dispatch", "solution", "kernel, us", "kernel from Python, us", "Solver.solve, us")
    return Table("Where the time of a null_space call goes", header, rows, caption)


def _steps(inside: Inside) -> Table:
    rows = tuple(
        (
            item.title,
            *(f"{seconds / sum(item.seconds):.0%}" for seconds in item.seconds),
            *(_us(seconds) for seconds in (*item.seconds, item.whole)),
        )
        for item in inside.steps
    )
    caption = (
        "kinematics: robot.update(q). tasks: stack.problem(robot), which asks the robot for poses and Jacobians and builds the "
        "problem. solve: null_space, with limits the active set, warm. Medians along the path; shares of their sum."
    )
    header = ("family", *PARTS_OF_A_STEP, *(f"{part}, us" for part in PARTS_OF_A_STEP), "a step, us")
    return Table("Where the time of a control step goes", header, rows, caption)


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
    caption = (
        "The QPs that the cascade hands to ProxQP on these problems, recorded, then updated and solved again on the same "
        "objects. On levels of equalities alone such a QP has no rows, and the Hessian M^T M of the triangle M to which the "
        "cascade has turned the level's rows in the freedom left: there the ratio is the cost of turning and of polishing, "
        "which no QP contains. difference: the largest relative one between a replayed answer and the recorded one."
    )
    header = ("family", "cascade over its QPs", "QPs a solve", "qp_cascade, us", "its QPs, us", "difference")
    return Table("qp_cascade on ProxQP beside its own native QPs", header, rows, caption)


def _allocated(inside: Inside) -> Table:
    rows = tuple(
        (item.family, item.label, number(item.arrays, 3), number(item.beyond, 3), number(item.kept, 3))
        for item in inside.allocated
    )
    caption = (
        "One warm call, medians over instances. arrays: blocks that native code allocated. beyond the answer: "
        "the most bytes held at once inside the call and released by its end, by tracemalloc. "
        "kept: the Solution with its x. What LAPACK and ProxQP allocate for themselves is not seen."
    )
    header = ("family", "solver", "arrays", "bytes beyond the answer", "bytes kept")
    return Table("Allocations of a solve", header, rows, caption, text=frozenset({0, 1}))
