"""How a command ends: the codes of the program, and what one that was interrupted says."""

from __future__ import annotations

import pathlib
import sys

MISUSE = 2
"""Wrong input."""

INTERRUPTED = 130
"""As shells have it for Ctrl-C."""


def stopped(output: pathlib.Path) -> int:
    """Say on standard error that what is finished is kept in `output`; the exit code."""
    print(f"\nStopped. What is finished is kept in {output}; the same command goes on from there.", file=sys.stderr)
    return INTERRUPTED
