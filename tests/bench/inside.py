"""What is inside a call: kernel and native code, dispatch, a step's parts, the cascade's own QPs, allocations."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence

from tests.bench.allocations import ALLOCATING, ALLOCATION_FAMILIES, Allocations, allocations
from tests.bench.floor import FLOOR, FLOOR_FAMILIES, KERNEL, LEXLS, Floor, measure_floor
from tests.bench.native_qps import QP_FAMILIES, NativeQps, native_qps
from tests.bench.step_parts import StepParts, step_parts
from tests.bench.steps import STEP_FAMILIES
from tests.bench.timing import Ratio, ratio


@dataclasses.dataclass(frozen=True, slots=True)
class Inside:
    """What is inside a call.

    Attributes:
        floor, steps, qps, allocated: one for each family (and entrant) that was asked for.
        missing: a sentence for each part that could not be measured.
    """

    floor: tuple[Floor, ...] = ()
    qps: tuple[NativeQps, ...] = ()
    allocated: tuple[Allocations, ...] = ()
    missing: tuple[str, ...] = ()
    steps: tuple[StepParts, ...] = ()


def measure_inside(
    families: Sequence[str],
    *,
    lexls: tuple[str, str] | None = None,
    quick: bool = False,
    announce: Callable[[str, str], None] = lambda name, what: None,
) -> Inside:
    """Measure it on those of these families that it is about.

    Args:
        lexls: folders of LexLS and of Eigen, or None.
        quick: fewer calls. announce: told the part and what is at work.
    """

    def chosen(known: Sequence[str]) -> list[str]:
        return [name for name in known if name in families]

    budget = 0.05 if quick else 0.25
    floor, missing = measure_floor(
        chosen(FLOOR_FAMILIES),
        lexls=lexls,
        quick=quick,
        budget=budget,
        announce=functools.partial(announce, "inside a call"),
    )
    steps = []
    for name in chosen(STEP_FAMILIES):
        announce("inside a step", name)
        steps.append(step_parts(name, quick=quick))
    qps = native_qps(
        chosen(QP_FAMILIES), quick=quick, budget=budget, announce=functools.partial(announce, "native QPs")
    )
    allocated: tuple[Allocations, ...] = ()
    if names := chosen(ALLOCATION_FAMILIES):
        announce("allocations", "")
        allocated, sentence = allocations(ALLOCATING, names)
        missing += (sentence,) if sentence else ()
    return Inside(floor, qps, allocated, missing, tuple(steps))


def inside_ratios(inside: Inside) -> list[tuple[str, Ratio]]:
    """(family, how many times faster): the kernel than native code, the QP cascade than its own QPs; below 1 when slower."""
    found = [
        (item.name, ratio(item.times[KERNEL], item.times[other]))
        for item in inside.floor
        for other in (FLOOR, LEXLS)
        if other in item.times and item.accuracy[KERNEL].ok and item.accuracy[other].ok
    ]
    return found + [(item.name, ratio(item.cascade, item.native)) for item in inside.qps]
