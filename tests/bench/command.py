"""The command of the benchmark: `make bench`, or `python -m tests.bench` with its options."""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Sequence

import tyro

from hqp_rp.compare.exit_codes import exit_code_of
from hqp_rp.core.paths import user_path

PROGRAM = "python -m tests.bench"


def bench(
    family: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    peer: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    peer_python: tyro.conf.UseAppendAction[tuple[pathlib.Path, ...]] = (),
    output: pathlib.Path = pathlib.Path("bench"),
    quick: bool = False,
    lexls: pathlib.Path | None = None,
    eigen: pathlib.Path | None = None,
) -> int:
    """Time every solver beside what a user would pick instead, in one run, and say what got worse since the last one.

    Writes a report with the ratios first: report.html, report.md with figures; and adds a line to history.jsonl.

    Args:
        family: a family of problems (7_3-3, 30, humanoid_40, 100, step_sawyer ...); repeat it for more. Without it, all.
        peer: daqp, numpy, qpsolvers, mink, pink, placo or roboplan; repeat it for more. Without it, all that are installed.
        peer_python: the Python interpreter of an environment where pink, placo or roboplan is installed; repeat it for more.
        output: the folder to write; it is the history that the next run is compared with.
        quick: fewer calls, and no figures of how cost grows.
        lexls: a checkout of github.com/jrl-umi3218/lexls (C++), timed beside our kernel; needs a C++ compiler and Eigen.
        eigen: the folder that holds the folder Eigen, when it is not where it usually is.
    """
    from tests.bench.bench import bench as run

    output = user_path(output)
    found = run(
        output,
        families=family or None,
        peers=peer or None,
        peer_python=peer_python,
        quick=quick,
        lexls=lexls,
        eigen=eigen,
        progress=True,
    )
    from tests.bench.report import answer

    for sentence in (*answer(found.measured), *found.against, *found.measured.missing, *found.measured.inside.missing):
        print(f"- {sentence}")
    print(f"The report: {output / 'report.html'}")
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark; the exit code: 0 done, 2 wrong input (one line says what and the remedy), 130 interrupted."""
    typed = list(sys.argv[1:] if arguments is None else arguments)
    return exit_code_of(
        PROGRAM, lambda: tyro.cli(bench, prog=PROGRAM, args=typed, config=(tyro.conf.FlagCreatePairsOff,))
    )
