"""The chunks of a stress test over worker processes of this machine, or over a dask cluster."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias

import polars as pl

from hqp_rp.compare.machine import usable_cores
from hqp_rp.compare.run_folder import RunFolder
from hqp_rp.compare.stress.plan import Plan, quiet, scene_of
from hqp_rp.compare.stress.rows import chunk_rows
from hqp_rp.compare.stress.subject import Subject
from hqp_rp.compare.workers import in_order, in_processes, progress_bar
from hqp_rp.control.singularities import SingularConfiguration, Start, refine_starts
from hqp_rp.core.errors import SettingError
from hqp_rp.core.extras import require

Finished: TypeAlias = Iterator[tuple[int, pl.DataFrame]]

_CONNECT = 10.0  # s
_RETRIES = 3
_STARTS = 4  # of the search for singularities, that a worker takes at a time


def key(index: int) -> str:
    """The name of a chunk's part, so that parts sort in the order of their samples."""
    return f"chunk-{index:07d}"


def run_chunks(
    plan: Plan, folder: RunFolder, *, workers: int | None = None, client: Any = None, progress: bool = False
) -> None:
    """Make every chunk that `folder` does not hold yet; each finished one is kept at once.

    Args:
        plan: what to run. folder: of this run.
        workers: processes; None means one for each usable core; 1 runs in this process.
        client: a dask client (see `dask_client`); its cluster takes the chunks instead.
        progress: show a progress bar with the time left on standard error.
    """
    left = [chunk.index for chunk in plan.chunks if not folder.has(key(chunk.index))]
    done = plan.samples - sum(plan.chunks[index].count for index in left)
    with progress_bar(progress, plan.samples, done, "samples") as advance:
        if not left:
            return
        advance(0, "solving")
        if client is not None:
            finished = _by_dask(plan, left, client)
        else:
            finished = _by_joblib(plan, left, min(workers or usable_cores(), len(left)))
        for index, frame in finished:
            folder.save(key(index), frame)
            advance(plan.chunks[index].count, plan.chunks[index].kind)


def run_starts(
    subject: Subject, seed: int, jobs: Sequence[Start], *, workers: int | None = None, progress: bool = False
) -> Iterator[SingularConfiguration | None]:
    """What `refine_starts` makes of each start, in their order, over worker processes; other arguments as `run_chunks`."""
    blocks = [jobs[i : i + _STARTS] for i in range(0, len(jobs), _STARTS)]
    names = scene_of(subject).tasks.names
    workers = min(workers or usable_cores(), len(blocks))
    with progress_bar(progress, len(jobs), 0, "starts") as advance:
        found = in_order(in_processes(functools.partial(_refined, subject, seed), blocks, workers))
        for block, refined in zip(blocks, found, strict=True):
            advance(len(block), f"singularities of {names[block[-1][0]]}")
            yield from refined


def _refined(subject: Subject, seed: int, block: Sequence[Start]) -> list[SingularConfiguration | None]:
    with quiet():
        scene = scene_of(subject)
        return list(refine_starts(scene.robot, scene.tasks, block, seed=seed, thorough=True, dt=scene.dt))


def _by_joblib(plan: Plan, left: Sequence[int], workers: int) -> Finished:
    for place, frame in in_processes(functools.partial(chunk_rows, plan), left, workers):
        yield left[place], frame


def dask_client(address: str) -> Any:
    """A client of the dask scheduler at `address`, such as "tcp://10.0.0.1:8786".

    Raises:
        MissingExtraError: dask is not installed.
        SettingError: no scheduler answers there, or it has no workers.
    """
    require("--dask", "dask", "distributed")
    Client: Any = importlib.import_module("dask.distributed").Client
    try:
        client = Client(address, timeout=_CONNECT, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise SettingError(
            f"dask is {address!r}: no scheduler answers there ({error or type(error).__name__}); start one with "
            "`dask scheduler` and give the address that it prints."
        ) from None
    if not client.scheduler_info()["workers"]:
        client.close()
        raise SettingError(
            f"The dask scheduler at {address!r} has no workers; start some with `dask worker {address} --nthreads 1`."
        )
    return client


def _by_dask(plan: Plan, left: Sequence[int], client: Any) -> Finished:
    """Few chunks at a time, so that neither the scheduler nor this process holds more than that; a chunk whose worker dies
    is made again by another."""
    as_completed: Any = importlib.import_module("dask.distributed").as_completed
    waiting = iter(left)
    threads = sum(worker["nthreads"] for worker in client.scheduler_info()["workers"].values())
    submit = _submitter(plan, client)
    first = [submit(index) for _, index in zip(range(3 * max(threads, 1)), waiting, strict=False)]
    pending = as_completed(first, loop=client.loop)
    for future in pending:
        result = future.result()
        future.release()
        following = next(waiting, None)
        if following is not None:
            pending.add(submit(following))
        yield result


def _indexed(plan: Plan, index: int) -> tuple[int, pl.DataFrame]:
    return index, chunk_rows(plan, index)


def _submitter(plan: Plan, client: Any) -> Callable[[int], Any]:
    def submit(index: int) -> Any:
        return client.submit(_indexed, plan, index, pure=False, retries=_RETRIES)

    return submit
