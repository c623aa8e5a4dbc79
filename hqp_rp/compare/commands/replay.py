"""The subcommand `hqp-rp replay`."""

from __future__ import annotations

import pathlib

import tyro

from hqp_rp.core.errors import SettingError
from hqp_rp.core.extras import missing_of, require_report


def replay(
    file: tyro.conf.Positional[tuple[pathlib.Path, ...]],
    solver: str | None = None,
    figure: pathlib.Path | None = None,
    port: int = 8080,
) -> int:
    """Solve saved cases again and judge the answers; or show a run again that `hqp-rp play` recorded.

    Args:
        file: .npz files, as a stress test keeps its worst cases; of several, by how much x changes from each to the next.
            Or one recording, which is shown as a page.
        solver: a solver's name, NAME:KEY=VALUE,KEY=VALUE or PACKAGE.MODULE:CLASS; without it, the one that the case was
            saved for.
        figure: of a recording, the figure to write instead of showing it: .png, .pdf or .svg.
        port: of the page of a recording.
    """
    if missing_of(("mujoco", "scipy")):  # without which a recording is not told from a case
        require_report("hqp-rp replay")
    from hqp_rp.compare.play.recording import is_recording

    if len(file) == 1 and is_recording(file[0]):
        if solver is not None:
            raise SettingError(f"{file[0]} is a recorded run, which is shown as it was; leave --solver out.")
        from hqp_rp.compare.play.show import replay_recording

        print(replay_recording(file[0], figure=figure, port=port))
        return 0
    if figure is not None:
        raise SettingError("--figure is for one recording of hqp-rp play; these files are other ones.")
    if not file:
        raise SettingError("replay needs a file: hqp-rp replay worst/CASE.npz.")
    require_report("hqp-rp replay")
    from hqp_rp.compare.stress.worst import replay_all

    for sentence in replay_all(file, solver):
        print(sentence)
    return 0
