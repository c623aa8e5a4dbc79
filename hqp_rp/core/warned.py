"""Warnings that point at the line of the user, however deep in the library they arise."""

from __future__ import annotations

import sys
import warnings

_PASSED = ("hqp_rp", "contextlib", "functools", "importlib", "dataclasses")
"""Packages whose lines are nobody's: the library, and what calls it back."""


def warn(message: str) -> None:
    """A `UserWarning` at the innermost line outside the library that led here."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and str(frame.f_globals.get("__name__", "")).partition(".")[0] in _PASSED:
        level, frame = level + 1, frame.f_back
    warnings.warn(message, UserWarning, stacklevel=level)
