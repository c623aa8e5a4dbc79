"""The program `hqp-rp`: the command line of `hqp_rp.compare`, or a sentence on what it lacks."""

from __future__ import annotations

import contextlib
import os
import sys

from hqp_rp.core.errors import MissingExtraError
from hqp_rp.core.extras import require

READER_GONE = 141
"""The exit code of a program whose reader closed the pipe, as shells have it."""


def main() -> int:
    """Run the command line; 2 where tyro, which reads it, is not installed. Each subcommand says itself what else it needs."""
    try:
        require("The command line hqp-rp", "tyro")
    except MissingExtraError as error:
        print(f"hqp-rp: {error}", file=sys.stderr)
        return 2
    from hqp_rp.compare.command_line import main as command_line

    with contextlib.suppress(OSError):  # a folder that is gone
        sys.path.append(os.getcwd())  # last, for --solver module:Class of a file beside the user
    try:
        code = command_line()
        sys.stdout.flush()
    except BrokenPipeError:  # whoever read the output has enough of it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return READER_GONE
    return code


if __name__ == "__main__":
    sys.exit(main())
