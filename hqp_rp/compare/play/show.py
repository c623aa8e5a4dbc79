"""What `hqp-rp play` and `hqp-rp replay` show: the page of a robot and stack, the page or the figure of a recording."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hqp_rp.compare.play.viser_server import require_viser
from hqp_rp.control.stack_file import load_stack
from hqp_rp.core.errors import FileError, MissingExtraError, SettingError
from hqp_rp.core.paths import user_path
from hqp_rp.core.solver import Solver
from hqp_rp.robot.named import ROBOTS, is_named
from hqp_rp.robot.robot_source import RobotSource

if TYPE_CHECKING:
    from hqp_rp.compare.play.page import PlayPage
    from hqp_rp.compare.play.recording import Recording

SOLVER = "null_space"

STACKS = {"panda_like": "sawyer"}
"""The stack of a robot that comes with the library, where it has another name than the robot."""


def page_of(
    robot: str | None,
    stack: str | None,
    solvers: Sequence[str | Solver] = (),
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    starts: int = 16,
    file: str = "play.npz",
    **given: object,
) -> PlayPage:
    """The page for this robot and stack, ready to run.

    Args:
        robot: a model file or a name; None takes what the stack file says. stack: a stack file or a name; None takes the one
            that comes with the library under the robot's name.
        solvers: one, or two to see side by side. given: further attributes of a `RobotSource`.
        host, port, starts, file: as `PlayPage`.

    Raises `SettingError` without a robot and a stack, or with more than two solvers; otherwise as `PlayLoop` and `PlayPage`.
    """
    require_viser("hqp-rp play")
    from hqp_rp.compare.play.loop import PlayLoop
    from hqp_rp.compare.play.page import PlayPage

    if len(solvers) > 2:
        raise SettingError(f"solver is given {len(solvers)} times; two can be seen side by side.")
    if stack is None:
        robot = robot or "sawyer"
        stack = _own_stack(robot)
    content = load_stack(stack)
    source: RobotSource = content.robot_source(robot, **given)
    first, second = (*solvers, None, None)[:2]
    loop = PlayLoop(source, content, SOLVER if first is None else first, beside=second)
    return PlayPage(loop, host=host, port=port, starts=starts, file=file)


def _own_stack(robot: str) -> str:
    """The stack that comes with the library for this robot of its own. Raises `SettingError` where there is none."""
    if not is_named(robot):
        raise SettingError(
            f"{robot!r} comes with no stack: say with --stack FILE what it shall do (see the page on stack files). Robots that "
            f"come with one: {', '.join(ROBOTS)}."
        )
    return "planar4" if robot.startswith("planar") else STACKS.get(robot, robot)


def replay_recording(
    file: pathlib.Path, *, figure: pathlib.Path | None = None, host: str = "127.0.0.1", port: int = 8080
) -> str:
    """Show a recording as a page until it is interrupted, or write it as a figure; what was done, as a sentence.

    figure: where to write the figure, .png, .pdf or .svg. None shows the page, where viser is installed.

    Raises:
        FileError: no recording, or a figure that cannot be written. MissingExtraError: neither viser nor a figure asked for.
    """
    from hqp_rp.compare.play.recording import load_recording

    recording = load_recording(file)
    if figure is not None:
        return f"The figure: {save_figure(recording, figure)}"
    try:
        require_viser("The page of a recording")
    except MissingExtraError as error:
        raise MissingExtraError(f"{error}; or write it as a figure: hqp-rp replay {file} --figure FILE.png") from None
    from hqp_rp.compare.play.replay_page import ReplayPage

    page = ReplayPage(recording, host=host, port=port)
    print(f"{recording!r}\nThe page: {page.address} (Ctrl-C ends it)", flush=True)
    page.run()
    return "Ended."


def save_figure(recording: Recording, path: pathlib.Path) -> pathlib.Path:
    """Write the figure of a recording to .png, .pdf or .svg; errors as `replay_recording`."""
    from hqp_rp.compare.play.figure import figure_of

    target = user_path(path)
    if target.suffix.lower() not in (".png", ".pdf", ".svg"):
        raise FileError(f"{target}: a figure is written as .png, .pdf or .svg.")
    drawn = figure_of(recording)
    try:
        drawn.savefig(target, dpi=150)
    except OSError as error:
        raise FileError(f"{target}: the figure cannot be written ({error.strerror or error}).") from error
    return target
