"""What a solve allocates beside its answer, counted in a process of its own by numba's runtime and by tracemalloc."""

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

from hqp_rp.compare.bench_entrants import our_entrants
from hqp_rp.compare.bench_families import family

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
        arrays: allocations of compiled code in one call, each an array.
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
        env={**os.environ, "NUMBA_NRT_STATS": "1"},
    )
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no word"])[-1]
        return (), f"Allocations are not counted: the process that counts them ended with {last!r}."
    probe, rows = json.loads(done.stdout.splitlines()[-1])
    if probe[0] != _PROBE_ARRAYS or probe[1] + probe[2] < 8 * _PROBE_SIZE * _PROBE_ARRAYS:
        return (), "Allocations are not counted: this numba does not report those of a probe."
    return tuple(Allocations(*row) for row in rows), ""


def _counted(call: Callable[[], Any]) -> tuple[float, float, float]:
    """(arrays of compiled code, bytes kept, bytes beyond these at the most) of one call."""
    from numba.core.runtime import nrt

    runtime: Any = nrt.rtsys
    for _ in range(3):  # workspaces are made, names are looked up
        call()
    tracemalloc.start()
    try:
        call()
        arrays = runtime.get_allocation_stats().alloc
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        answer = call()
        after, peak = tracemalloc.get_traced_memory()
        arrays = runtime.get_allocation_stats().alloc - arrays
    finally:
        tracemalloc.stop()
    del answer
    return float(arrays), float(after - before), float(peak - max(after, before))


def _probe() -> tuple[float, float, float]:
    import numba

    @numba.njit
    def probe(size: int) -> Any:  # returned, so that none is optimized away
        return np.empty(size), np.ones(size), np.zeros(size)

    return _counted(lambda: probe(_PROBE_SIZE))


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
