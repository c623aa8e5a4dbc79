"""The subcommand `hqp-rp compare`."""

from __future__ import annotations

import pathlib

import tyro

from hqp_rp.compare.exit_codes import stopped
from hqp_rp.core.extras import require_report
from hqp_rp.core.paths import user_path


def compare(
    scenario: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    solver: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    seeds: int | None = None,
    output: pathlib.Path = pathlib.Path("report"),
    quick: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
) -> int:
    """Compare solvers on scenarios and write a report: report.html, report.md with figures, Parquet files.

    A comparison that was stopped goes on where it stopped when the same command is given again.

    Args:
        scenario: a scenario's name; repeat it for more. Without it, every scenario. See `hqp-rp scenarios`.
        solver: a solver's name, which picks all its variants, or NAME:KEY=VALUE,KEY=VALUE for settings of your own, such as
            reverse_priority:damping=constant(0.1),form=projector, or PACKAGE.MODULE:CLASS for a solver of your own; repeat it
            for more. See `hqp-rp solvers`.
        seeds: how many seeds; 3, or 1 with --quick, when not given.
        output: the folder to write.
        quick: fewer steps, for a first look.
        overwrite: replace the report of another run in that folder.
        workers: processes; one for each core when not given.
    """
    require_report("hqp-rp compare")
    from hqp_rp.compare.comparison.comparison import compare as run

    output = user_path(output)
    try:
        found = run(
            scenario or None,
            solver or None,
            seeds=seeds,
            output=output,
            quick=quick,
            overwrite=overwrite,
            workers=workers,
            progress=True,
        )
    except KeyboardInterrupt:
        return stopped(output)
    for sentence in (*found.left_out, *found.answer):
        print(f"- {sentence}")
    print(f"The report: {output / 'report.html'}")
    return 0
