"""One piece of work over many items, shared among threads: for native code, which runs without the interpreter's lock."""

from __future__ import annotations

import concurrent.futures
import os
from collections.abc import Callable

import numpy as np

from hqp_rp.core.errors import SettingError


def in_shares(work: Callable[[slice], None], count: int, threads: int | None, *, least: int = 1) -> None:
    """Call `work` on consecutive slices that together are `range(count)`, each in a thread of its own.

    Args:
        work: fills its slice of arrays that the caller holds. count: items, >= 0.
        threads: how many at most; None means one for each core.
        least: items that are worth a thread: with fewer for each, fewer threads are used.

    Raises `SettingError` for threads below 1, and whatever `work` raises.
    """
    workers = os.cpu_count() or 1 if threads is None else threads
    if not isinstance(workers, int) or workers < 1:
        raise SettingError(f"threads is {threads!r}; it must be None or an integer of at least 1.")
    if not count:
        return
    shares = np.array_split(np.arange(count), min(workers, max(1, count // least)))
    spans = [slice(int(share[0]), int(share[-1]) + 1) for share in shares]
    if len(spans) == 1:
        work(spans[0])
        return
    with concurrent.futures.ThreadPoolExecutor(len(spans)) as pool:
        for done in [pool.submit(work, span) for span in spans]:
            done.result()
