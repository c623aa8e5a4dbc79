"""The subcommand `hqp-rp stress`."""

from __future__ import annotations

import pathlib
from typing import Literal

import tyro

from hqp_rp.compare.exit_codes import stopped
from hqp_rp.compare.robot_options import robot_options
from hqp_rp.core.extras import require_report
from hqp_rp.core.paths import user_path


def stress(
    model: tyro.conf.Positional[str | None] = None,
    *,
    stack: str,
    library: Literal["mujoco", "pinocchio"] | None = None,
    meshes: bool = True,
    package_path: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    floating_base: bool = False,
    repair_inertias: bool = False,
    keyframe: str | None = None,
    samples: int = 10_000,
    solver: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    output: pathlib.Path = pathlib.Path("stress"),
    seed: int = 0,
    starts: int = 64,
    overwrite: bool = False,
    workers: int | None = None,
    dask: str | None = None,
) -> int:
    """Stress every solver on a robot and a stack: at random, near the joint limits, towards every singularity found.

    Writes a report: report.html, report.md with figures, worst cases as .npz, all rows as Parquet parts. A test that was
    stopped, or killed, goes on where it stopped when the same command is given again.

    Args:
        model: an MJCF or URDF file, or sawyer, panda_like, planar4 (planarN), dual_sawyer, humanoid; without it, the one
            that the stack file says under [robot]. What is given here counts before what that says.
        stack: a stack file (TOML), or the name of one that comes with the library: sawyer, sawyer_limits, planar4,
            dual_sawyer, humanoid.
        library: what computes the robot; mujoco when not given.
        meshes: --no-meshes reads no mesh files; otherwise those that are there, and that MuJoCo reads, are read.
        package_path: a folder where packages of package://PACKAGE/FILE are; repeat it for more. The folders above the robot
            file, ROS_PACKAGE_PATH and AMENT_PREFIX_PATH are looked through as well.
        floating_base: give the root link of a URDF a free joint.
        repair_inertias: replace inertias that MuJoCo refuses by the nearest that it accepts.
        keyframe: the keyframe of an MJCF that is the robot's neutral configuration, such as home.
        samples: how many configurations.
        solver: as in `hqp-rp compare`, and closed_forms for all of them; repeat it for more. Without it, every solver.
        output: the folder to write.
        seed: of every draw.
        starts: of the search for singularities, for each level.
        overwrite: replace the report of another run in that folder.
        workers: processes; one for each core when not given.
        dask: address of a running dask scheduler that takes the work instead, such as tcp://10.0.0.1:8786.
    """
    require_report("hqp-rp stress")
    from hqp_rp.compare.stress.stress import stress as run
    from hqp_rp.control.stack_file import load_stack

    file = load_stack(stack)
    given = robot_options(library, meshes, package_path, floating_base, repair_inertias, keyframe)
    robot, output = file.robot_source(model, **given), user_path(output)
    try:
        found = run(
            robot,
            file,
            samples=samples,
            solvers=solver or None,
            output=output,
            seed=seed,
            starts=starts,
            overwrite=overwrite,
            workers=workers,
            dask=dask,
            progress=True,
        )
    except KeyboardInterrupt:
        return stopped(output)
    for sentence in found.answer:
        print(f"- {sentence}")
    print(f"The report: {output / 'report.html'}")
    return 0
