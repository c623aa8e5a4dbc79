"""The subcommand `hqp-rp check`."""

from __future__ import annotations

import pathlib
from typing import Literal

import tyro

from hqp_rp.compare.robot_options import robot_options
from hqp_rp.compare.settings_text import parse_contestant
from hqp_rp.core.errors import SettingError

FOUND = 1
"""The exit code of a check whose problem is not solved, or whose answer is not certified."""


def check(
    file: tyro.conf.Positional[str],
    *,
    robot: str | None = None,
    q: tuple[float, ...] | None = None,
    dt: float | None = None,
    solver: str = "hierarchical_active_set",
    library: Literal["mujoco", "pinocchio"] | None = None,
    meshes: bool = True,
    package_path: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    floating_base: bool = False,
    repair_inertias: bool = False,
    keyframe: str | None = None,
) -> int:
    """Say why: solve one problem and tell its status, what each level pays, which rows are active, what conflicts.

    Ends with 0 only where the problem is solved and the certificate proves the answer; with 1 where not.

    Args:
        file: a stack file (TOML), or the name of one that comes with the library; or a problem saved as .npz.
        robot: of a stack: as the model of `hqp-rp stress`; without it, the one that the file says under [robot].
        q: of a stack: the configuration, nq numbers, rad or m; without it, the robot's neutral one.
        dt: of a stack, s; without it, what the file says.
        solver: a solver's name, NAME:KEY=VALUE,KEY=VALUE or PACKAGE.MODULE:CLASS.
        library, meshes, package_path, floating_base, repair_inertias, keyframe: as in `hqp-rp stress`.
    """
    from hqp_rp.compare.check import check_problem, described, problem_of
    from hqp_rp.core.io import load_metadata, load_problem

    chosen = parse_contestant(solver)
    given = robot_options(library, meshes, package_path, floating_base, repair_inertias, keyframe)
    if pathlib.PurePath(file).suffix.lower() == ".npz":
        stated = [name for name, value in (("robot", robot), ("q", q), ("dt", dt)) if value is not None]
        for name in (*stated, *given):
            option = {"meshes": "no-meshes", "package_paths": "package-path", "neutral": "keyframe"}.get(name, name)
            raise SettingError(
                f"--{option.replace('_', '-')} is for a stack file; {file} is a saved problem, which holds all there is."
            )
        problem, told = load_problem(file), described(load_metadata(file))
        told = f"{file}: {told}" if told else file
    else:
        from hqp_rp.control.stack_file import load_stack

        content = load_stack(file)
        problem, told = problem_of(content, content.robot_source(robot, **given), q, dt)
    found = check_problem(problem, chosen)
    print("\n".join((told, *found.sentences)))
    return 0 if found.ok else FOUND
