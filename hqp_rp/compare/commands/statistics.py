"""The subcommand `hqp-rp statistics`."""

from __future__ import annotations

import dataclasses
import pathlib

import tyro

from hqp_rp.compare.exit_codes import stopped
from hqp_rp.core.extras import require_report
from hqp_rp.core.paths import user_path


def statistics(
    solver: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    arm: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    configurations: int | None = None,
    paths: int | None = None,
    seed: int = 0,
    output: pathlib.Path = pathlib.Path("statistics"),
    quick: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
) -> int:
    """Drive three arms along 400 paths each through their singularities: medians, intervals, and which verdicts hang on what.

    It takes some fifteen minutes on two cores. A study that was stopped goes on where it stopped when the same command is given
    again.

    Args:
        solver: as of `compare`; without it, every solver.
        arm: sawyer, panda_like or planar4; repeat it for more. Without it, all three.
        configurations: singular ones, for each arm; 20, or 3 with --quick, when not given.
        paths: through each of them; 20, or 3 with --quick, when not given.
        seed: of every draw.
        output: the folder to write.
        quick: few configurations and paths, for a first look.
        overwrite: replace the report of another run in that folder.
        workers: processes; one for each core when not given.
    """
    require_report("hqp-rp statistics")
    from hqp_rp.compare.statistics.passages import Design
    from hqp_rp.compare.statistics.study import QUICK
    from hqp_rp.compare.statistics.study import statistics as run

    asked = {name: value for name, value in (("configurations", configurations), ("paths", paths)) if value is not None}
    design = dataclasses.replace(QUICK if quick else Design(), seed=seed, **asked)
    output = user_path(output)
    try:
        run(
            design,
            arms=arm or None,
            solvers=solver or None,
            output=output,
            overwrite=overwrite,
            workers=workers,
            progress=True,
        )
    except KeyboardInterrupt:
        return stopped(output)
    print(f"The report: {output / 'report.html'}")
    return 0
