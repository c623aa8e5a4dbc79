"""What a solve allocates beside its answer, counted in a process of its own by the native workspace and by tracemalloc."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.core import _native
from hqp_rp.core.problem import Level, Problem
from hqp_rp.core.solver import solve
from tests.bench import ROOT
from tests.bench.entrants import our_entrants
from tests.bench.families import family

say = Sentences(__file__)

ALLOCATING = ("null space", "reverse priority", "active set, warm", "QP ProxQP")
"""Labels of our entrants that are looked at."""

ALLOCATION_FAMILIES = ("7_3-3", "7_3-3-7", "30", "100", "7_limits", "humanoid_40")
"""On which families; a solver that refuses one has no row there."""

_PROBE_ARRAYS, _PROBE_SIZE = 3, 1000


@dataclasses.dataclass(frozen=True, slots=True)
class Allocations:
    """One entrant on one family, the median over its instances.

    Attributes:
        label, family: who, on what.
        arrays: blocks that native code allocated for its workspace in one call.
        kept: bytes that are still held when the call has returned and its `Solution` is kept.
        beyond: bytes that were held beside these at the most, inside the call.
    """

    label: str
    family: str
    arrays: float
    kept: float
    beyond: float


def allocations(labels: Sequence[str], families: Sequence[str]) -> tuple[tuple[Allocations, ...], str]:
    """(one for each label and family that fit, ""), or ((), a sentence that says why nothing was counted).

    A probe whose allocations are known is counted first: where it is not seen in full, nothing is reported.
    """
    done = subprocess.run(
        [sys.executable, "-m", __name__, json.dumps([list(labels), list(families)])],
        capture_output=True,
        text=True,
        check=False,
        env=dict(os.environ),
        cwd=ROOT,
    )
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no word"])[-1]
        return (), say("counting_ended", last=last)
    probe, rows = json.loads(done.stdout.splitlines()[-1])
    if probe[0] < 1 or probe[1] + probe[2] < 8 * _PROBE_SIZE * _PROBE_ARRAYS:
        return (), say("probe_unseen")
    return tuple(Allocations(*row) for row in rows), ""


def _counted(call: Callable[[], Any]) -> tuple[float, float, float]:
    """(blocks of native code, bytes kept, bytes beyond these at the most) of one call."""
    for _ in range(3):  # workspaces are made, names are looked up
        call()
    return _seen(call)


def _seen(call: Callable[[], Any]) -> tuple[float, float, float]:
    tracemalloc.start()
    try:
        blocks = _native.workspace_allocations()
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        answer = call()
        after, peak = tracemalloc.get_traced_memory()
        blocks = _native.workspace_allocations() - blocks
    finally:
        tracemalloc.stop()
    del answer
    return float(blocks), float(after - before), float(peak - max(after, before))


def _probe() -> tuple[float, float, float]:
    """A first solve of a larger size, which has to allocate, beside arrays of known size."""
    large = np.eye(_PROBE_SIZE)[:100]
    problem = Problem([Level.equality(large, np.zeros(100))])

    def probe() -> Any:
        return solve(problem, "null_space").x, [np.empty(_PROBE_SIZE) for _ in range(_PROBE_ARRAYS)]

    return _seen(probe)


def main(argument: str) -> None:
    """Count what `allocations` asks for and print it as JSON."""
    labels, families = json.loads(argument)
    entrants = {entrant.label: entrant for entrant in our_entrants()}
    rows = []
    for name in families:
        problems = family(name, quick=True).problems[:8]
        for label in labels:
            entrant = entrants[label]
            if entrant.refuses(problems[0]) is not None:
                continue
            found = [_counted(call) for call in entrant.prepare(problems)]
            rows.append((label, name, *np.median(found, axis=0).tolist()))
    print(json.dumps([_probe(), rows]))


if __name__ == "__main__":
    main(sys.argv[1])
