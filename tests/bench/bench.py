"""The benchmark: our solvers beside what a user would pick instead, in one run, with a history of ratios."""

from __future__ import annotations

import concurrent.futures
import dataclasses
import datetime
import multiprocessing
import pathlib
from collections.abc import Sequence
from typing import Any

from hqp_rp.compare.machine import machine, versions
from hqp_rp.compare.report.write import write_report
from hqp_rp.compare.workers import one_thread_each
from hqp_rp.core.errors import FileError, SettingError, unknown_name
from hqp_rp.core.paths import user_path
from tests.bench.entrants import SOLVER_PEERS
from tests.bench.families import FAMILIES
from tests.bench.history import HISTORY, Entry, compared, keep, key, load_history
from tests.bench.lexls import checked_lexls
from tests.bench.measure import Asked, headline_ratios, measure
from tests.bench.record import Bench
from tests.bench.remote import REMOTE_PEERS
from tests.bench.report import bench_report
from tests.bench.steps import STEP_FAMILIES

PEERS = (*SOLVER_PEERS, "mink", *REMOTE_PEERS)
"""What `--peer` knows."""

EVERY_FAMILY = (*FAMILIES, *STEP_FAMILIES)
"""What `--family` knows."""


def bench(
    output: str | pathlib.Path,
    *,
    families: Sequence[str] | None = None,
    peers: Sequence[str] | None = None,
    peer_python: Sequence[str | pathlib.Path] = (),
    quick: bool = False,
    lexls: str | pathlib.Path | None = None,
    eigen: str | pathlib.Path | None = None,
    progress: bool = False,
    fresh_process: bool = True,
) -> Bench:
    """Time every solver of ours and the peers that are installed, and write a report with the ratios first.

    Args:
        output: the folder: report.html, report.md, figures, and history.jsonl, to which each run adds a line.
        families: of `EVERY_FAMILY`; None for all. peers: of `PEERS`; None for all.
        peer_python: interpreters of environments in which pink, placo or roboplan may be found.
        quick: fewer calls and instances, and no figures of growth.
        lexls: a checkout of github.com/jrl-umi3218/lexls, to compile a loop against; eigen: the folder that holds Eigen's
            folder `Eigen`, when it is not where it usually is.
        progress: say on standard error what is at work.
        fresh_process: measure in a process of its own that has one thread from its start; False measures here.

    Raises:
        UnknownNameError: a family or a peer that there is not.
        SettingError: an interpreter that does not exist, a folder without LexLS or without Eigen.
        FileError: the folder holds files that no benchmark wrote, a damaged history, or cannot be written.
    """
    native = checked_lexls(None if lexls is None else user_path(lexls), None if eigen is None else user_path(eigen))
    asked = dataclasses.replace(checked(families, peers, peer_python, quick), lexls=native)
    folder = user_path(output)
    history = _opened(folder)
    if fresh_process:
        with (
            one_thread_each(),
            concurrent.futures.ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool,
        ):
            measured = pool.submit(measure, asked, progress).result()
    else:
        measured = measure(asked, progress)
    entry = Entry(
        datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        asked.words(),
        machine(),
        {**versions(), **measured.versions},
        {key(name, ratio): ratio for name, ratio in headline_ratios(measured)},
    )
    against = compared(history, entry)
    done = Bench(measured, against, entry, folder)
    write_report(bench_report(done), folder)
    keep(folder, [*history, entry])
    return done


def checked(
    families: Sequence[str] | None, peers: Sequence[str] | None, peer_python: Sequence[Any], quick: bool
) -> Asked:
    """What a run is asked for, or the error that names what is wrong with it."""
    for name in families or ():
        if name not in EVERY_FAMILY:
            raise unknown_name("family of the benchmark", name, EVERY_FAMILY)
    for name in peers or ():
        if name not in PEERS:
            raise unknown_name("peer", name, PEERS)
    pythons = tuple(str(user_path(path)) for path in peer_python)
    for path in pythons:
        if not pathlib.Path(path).is_file():
            raise SettingError(f"peer_python is {path!r}, which does not exist; give the path of a Python interpreter.")
    chosen = tuple(name for name in EVERY_FAMILY if families is None or name in families or not families)
    return Asked(chosen, tuple(name for name in PEERS if not peers or name in peers), pythons, quick)


def _opened(folder: pathlib.Path) -> list[Entry]:
    """The history of `folder`, which is made when it does not exist."""
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder}: is a file; give a folder for the report.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        history = load_history(folder)
        if not (folder / HISTORY).exists():
            if any(folder.iterdir()):
                raise FileError(
                    f"{folder}: holds files that no benchmark wrote; give an empty or a new folder as --output."
                )
            keep(folder, [])  # the folder is the benchmark's from now on, also when it is stopped
    except OSError as error:
        raise FileError(f"{folder}: cannot be used as the report's folder ({error.strerror or error}).") from error
    return history
