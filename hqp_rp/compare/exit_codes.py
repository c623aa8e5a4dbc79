"""How a command ends: the codes of the program, and what one that was interrupted says."""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Callable
from typing import Any

from hqp_rp.compare.robot_options import warnings_in_lines
from hqp_rp.core.errors import HqpError

MISUSE = 2
"""Wrong input."""

INTERRUPTED = 130
"""As shells have it for Ctrl-C."""


def exit_code_of(program: str, command: Callable[[], Any], told: Callable[[str], str] = str) -> int:
    """The code that `command` returns; wrong input ends in one line on standard error, its sentence as `told` puts it."""
    try:
        with warnings_in_lines():
            return int(command())
    except HqpError as error:
        print(f"{program}: {told(str(error))}", file=sys.stderr)
        return MISUSE
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return INTERRUPTED


def stopped(output: pathlib.Path) -> int:
    """Say on standard error that what is finished is kept in `output`; the exit code."""
    print(f"\nStopped. What is finished is kept in {output}; the same command goes on from there.", file=sys.stderr)
    return INTERRUPTED
