"""`hqp-rp`: its subcommands, each beside what it runs, and the code that it ends with."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

from hqp_rp.compare.commands.check import check
from hqp_rp.compare.commands.claims import claims
from hqp_rp.compare.commands.compare import compare
from hqp_rp.compare.commands.listing import scenarios, solvers
from hqp_rp.compare.commands.play import play
from hqp_rp.compare.commands.replay import replay
from hqp_rp.compare.commands.statistics import statistics
from hqp_rp.compare.commands.stress import stress
from hqp_rp.compare.exit_codes import exit_code_of
from hqp_rp.compare.robot_options import as_options
from hqp_rp.core.errors import SettingError

_BENCH_MOVED = (
    "bench is no subcommand: the benchmark is in the repository, beside the tests; in a checkout, run make bench, or "
    "python -m tests.bench with the same options (docs/bench.md)."
)

COMMANDS: dict[str, Callable[..., int]] = {
    "check": check,
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
    """Run the command line; the exit code: 0 done, 1 a check that found something, 2 wrong input (one line says
    what and the remedy), 130 interrupted."""
    import tyro

    typed = list(sys.argv[1:] if arguments is None else arguments)

    def command() -> object:
        if typed[:1] == ["bench"]:
            raise SettingError(_BENCH_MOVED)
        return tyro.extras.subcommand_cli_from_dict(
            COMMANDS,
            prog="hqp-rp",
            description="One prioritized robot task stack, every hierarchical controller, and the truth about each.",
            args=typed,
            config=(tyro.conf.FlagCreatePairsOff,),
        )

    return exit_code_of("hqp-rp", command, as_options)


if __name__ == "__main__":
    from hqp_rp.script import main as program  # which knows what to do when a reader closes the pipe

    sys.exit(program())
