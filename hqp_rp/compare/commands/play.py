"""The subcommand `hqp-rp play`."""

from __future__ import annotations

import tyro

from hqp_rp.compare.robot_options import robot_options
from hqp_rp.compare.settings_text import parse_contestant
from hqp_rp.core.extras import require


def play(
    robot: tyro.conf.Positional[str | None] = None,
    *,
    stack: str | None = None,
    solver: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    meshes: bool = True,
    package_path: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    floating_base: bool = False,
    repair_inertias: bool = False,
    keyframe: str | None = None,
    starts: int = 16,
    file: str = "play.npz",
    host: str = "127.0.0.1",
    port: int = 8080,
) -> int:
    """Play with a robot on a page in the browser: drag its target, switch the solver, drive to singularities, record it.

    Args:
        robot: an MJCF or URDF file, or sawyer, panda_like, planar4 (planarN), dual_sawyer, humanoid; without it, the one
            that the stack file says under [robot], or the Sawyer.
        stack: a stack file (TOML), or the name of one that comes with the library; without it, the one of the robot's name.
        solver: as in `hqp-rp compare`; a second one is seen beside the first, as a ghost. Without it, null_space.
        meshes, package_path, floating_base, repair_inertias, keyframe: as in `hqp-rp stress`.
        starts: of the search for singularities, for each level; 0 for none.
        file: where the page saves recordings.
        host: the address to serve the page at; 0.0.0.0 lets other machines see it, and play.
        port: of the page; 0 for any that is free.
    """
    require("hqp-rp play", "viser", "mujoco")
    from hqp_rp.compare.play.show import page_of

    given = robot_options(None, meshes, package_path, floating_base, repair_inertias, keyframe)
    solvers = [parse_contestant(text) for text in solver]
    page = page_of(robot, stack, solvers, host=host, port=port, starts=starts, file=file, **given)
    print(f"The page: {page.address} (Ctrl-C ends it)", flush=True)
    page.run()
    return 0
