"""`hqp-rp`: its subcommands, each beside what it runs, and the code that it ends with."""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Callable, Sequence
from typing import Any

import tyro

from hqp_rp.compare.claims.command import claims
from hqp_rp.compare.comparison.command import compare
from hqp_rp.compare.exit_codes import INTERRUPTED, MISUSE
from hqp_rp.compare.listing import scenarios, solvers
from hqp_rp.compare.play.command import play, replay_recording
from hqp_rp.compare.robot_options import as_options, warnings_in_lines
from hqp_rp.compare.statistics.command import statistics
from hqp_rp.compare.stress.command import stress
from hqp_rp.core.errors import HqpError, SettingError


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
    from hqp_rp.compare.play.recording import is_recording

    if len(file) == 1 and is_recording(file[0]):
        if solver is not None:
            raise SettingError(f"{file[0]} is a recorded run, which is shown as it was; leave --solver out.")
        print(replay_recording(file[0], figure=figure, port=port))
        return 0
    if figure is not None:
        raise SettingError("--figure is for one recording of hqp-rp play; these files are other ones.")
    from hqp_rp.compare.stress.worst import replay_all

    if not file:
        raise SettingError("replay needs a file: hqp-rp replay worst/CASE.npz.")
    for sentence in replay_all(file, solver):
        print(sentence)
    return 0


_BENCH_MOVED = (
    "bench is no subcommand: the benchmark is in the repository, beside the tests; in a checkout, run make bench, or "
    "python -m tests.bench with the same options (docs/bench.md)."
)

COMMANDS: dict[str, Callable[..., int]] = {
    "compare": compare,
    "stress": stress,
    "replay": replay,
    "play": play,
    "statistics": statistics,
    "claims": claims,
    "solvers": solvers,
    "scenarios": scenarios,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 done, 2 wrong input (one line says what and the remedy), 130 interrupted."""
    typed = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if typed[:1] == ["bench"]:
            raise SettingError(_BENCH_MOVED)
        with warnings_in_lines():
            code: Any = tyro.extras.subcommand_cli_from_dict(
                COMMANDS,
                prog="hqp-rp",
                description="One prioritized robot task stack, every hierarchical controller, and the truth about each.",
                args=typed,
                config=(tyro.conf.FlagCreatePairsOff,),
            )
    except HqpError as error:
        print(f"hqp-rp: {as_options(str(error))}", file=sys.stderr)
        return MISUSE
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return INTERRUPTED
    return int(code)


if __name__ == "__main__":
    from hqp_rp.script import main as program  # which knows what to do when a reader closes the pipe

    sys.exit(program())
