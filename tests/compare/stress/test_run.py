"""The same rows whatever happens on the way: workers, kill -9, a cluster, a worker of it that dies."""

from __future__ import annotations

import contextlib
import os
import pathlib
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import polars as pl
import pytest

from hqp_rp.compare.stress.run import dask_client
from hqp_rp.compare.stress.stress import stress
from hqp_rp.core.errors import MissingExtraError, SettingError

SAMPLES, SOLVERS, STARTS = 1350, ("null_space",), 4
TIMEOUT = 120.0


def rows_of(folder: pathlib.Path) -> pl.DataFrame:
    frame = pl.concat([pl.read_parquet(path) for path in sorted((folder / "parts").glob("*.parquet"))])
    return frame.drop("time")


def run(folder: pathlib.Path, workers: int | None = 1, dask: str | None = None) -> pl.DataFrame:
    stress(
        "planar4", "planar4", samples=SAMPLES, solvers=SOLVERS, starts=STARTS, output=folder, workers=workers, dask=dask
    )
    return rows_of(folder)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    rows = run(tmp_path_factory.mktemp("stress") / "whole")
    assert rows["sample"].to_list()[: rows["sample"].n_unique()] != []
    assert sorted(set(rows["sample"])) == list(range(SAMPLES))
    return rows


def parts(folder: pathlib.Path) -> int:
    return len(list((folder / "parts").glob("chunk-*.parquet"))) if folder.exists() else 0


def wait_for(condition: object, process: subprocess.Popen[bytes] | None = None) -> None:
    end = time.monotonic() + TIMEOUT
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < end
        assert process is None or process.poll() is None
        time.sleep(0.01)


def test_two_workers_make_the_same_rows(uninterrupted: pl.DataFrame, tmp_path: pathlib.Path) -> None:
    assert run(tmp_path / "two", workers=2).equals(uninterrupted)


def test_killed_at_any_moment_it_goes_on(uninterrupted: pl.DataFrame, tmp_path: pathlib.Path) -> None:
    folder = tmp_path / "killed"
    arguments = ["--samples", str(SAMPLES), "--starts", str(STARTS), "--output", str(folder), "--workers", "1"]
    command = [
        sys.executable,
        "-m",
        "hqp_rp.compare.command_line",
        "stress",
        "planar4",
        "--stack",
        "planar4",
        *arguments,
    ]
    for solver in SOLVERS:
        command += ["--solver", solver]
    for more in (1, 3):  # twice: also a run that was resumed is killed
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        before = parts(folder)
        wait_for(lambda before=before, more=more: parts(folder) >= before + more, process)
        process.send_signal(signal.SIGKILL)
        process.wait()
    kept = {path: path.stat().st_mtime_ns for path in (folder / "parts").glob("chunk-*.parquet")}
    assert len(kept) < uninterrupted.height
    assert run(folder).equals(uninterrupted)
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in kept.items())  # what was finished was not made again


@contextlib.contextmanager
def cluster(folder: pathlib.Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A real scheduler and two worker processes on this machine: its address, and the workers."""
    environment = os.environ | {"OMP_NUM_THREADS": "1", "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "10"}
    scheduler_file = folder / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment, "cwd": folder}
    started: list[subprocess.Popen[bytes]] = []
    try:
        ports = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(scheduler_file)]
        started.append(subprocess.Popen([*dask, "scheduler", *ports], **silent))  # type: ignore[call-overload]
        wait_for(scheduler_file.exists, started[0])
        import json

        address = json.loads(scheduler_file.read_text())["address"]
        alone = ["--nthreads", "1", "--nworkers", "1", "--no-nanny", "--no-dashboard"]
        workers = [subprocess.Popen([*dask, "worker", address, *alone], **silent) for _ in range(2)]  # type: ignore[call-overload]
        started += workers
        from dask.distributed import Client

        with Client(address, timeout=TIMEOUT, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=TIMEOUT)
        yield address, workers
    finally:
        for process in reversed(started):
            process.kill()
            process.wait()


def test_a_cluster_makes_the_same_rows_also_when_a_worker_is_killed(
    uninterrupted: pl.DataFrame, tmp_path: pathlib.Path
) -> None:
    import threading

    with cluster(tmp_path) as (address, workers):
        folder = tmp_path / "cluster"
        killed = threading.Event()

        def kill() -> None:
            end = time.monotonic() + TIMEOUT
            while parts(folder) < 1 and time.monotonic() < end:
                time.sleep(0.005)
            if parts(folder) < uninterrupted.height:
                workers[0].kill()
                killed.set()

        killer = threading.Thread(target=kill)
        killer.start()
        rows = run(folder, workers=None, dask=address)
        killer.join()
        assert killed.is_set()
        assert workers[0].poll() is not None
        assert rows.equals(uninterrupted)


def test_a_scheduler_without_workers_and_dask_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SettingError, match="dask is 'nowhere': no scheduler answers there"):
        dask_client("nowhere")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r'pip install distributed, .*"cluster"'):
        dask_client("tcp://127.0.0.1:8786")
