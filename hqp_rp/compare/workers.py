"""Worker processes: work shared among them, one thread each, solvers loaded before anything is timed, and a progress bar."""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from hqp_rp.core.problem import Level, Problem
from hqp_rp.core.solver import Solver


def warm_up(solvers: Iterable[Solver]) -> None:
    """Load what each solver needs, so that no loading is taken for solve time."""
    rng = np.random.default_rng(0)
    levels = [Level.equality(rng.standard_normal((2, 7)), rng.standard_normal(2)) for _ in range(3)]
    problems = [Problem(levels[:2]), Problem(levels)]
    for solver in solvers:
        fresh = dataclasses.replace(solver)
        for problem in problems:
            fresh.solve(problem)
            fresh.solve(problem, np.zeros(7))


def in_processes(work: Callable[[Any], Any], items: Sequence[Any], workers: int) -> Iterator[tuple[int, Any]]:
    """(index, work(item)) of each item as soon as it is done, over so many processes; 1 works in this one, in their order."""
    if workers == 1:
        yield from ((index, work(item)) for index, item in enumerate(items))
        return
    import joblib

    with one_thread_each(), joblib.parallel_config("loky", inner_max_num_threads=1):
        pool = joblib.Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1, pre_dispatch="2*n_jobs")
        yield from pool(joblib.delayed(_indexed)(work, index, item) for index, item in enumerate(items))


def in_order(found: Iterable[tuple[int, Any]]) -> Iterator[Any]:
    """What `in_processes` finds, in the order of the items: what is done early waits."""
    waiting: dict[int, Any] = {}
    following = 0
    for index, result in found:
        waiting[index] = result
        while following in waiting:
            yield waiting.pop(following)
            following += 1


def _indexed(work: Callable[[Any], Any], index: int, item: Any) -> tuple[int, Any]:
    return index, work(item)


@contextlib.contextmanager
def one_thread_each() -> Iterator[None]:
    """Libraries that read their thread count when a worker imports them, polars among them, get one thread."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextlib.contextmanager
def progress_bar(show: bool, total: int, done: int, unit: str = "steps") -> Iterator[Callable[[int, str], None]]:
    """A progress bar with the time left on standard error; what it yields takes how many units are done, and a word."""
    if not show:
        yield lambda steps, what: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("", total=total, completed=done)
        yield lambda steps, what: bar.update(task, advance=steps, description=what)
