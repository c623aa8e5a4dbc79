"""Paths as people write them."""

from __future__ import annotations

import os
import pathlib


def user_path(path: str | os.PathLike[str]) -> pathlib.Path:
    """The path, with a leading `~` or `~NAME` replaced by that home folder, as a shell does it.

    A shell leaves `--output=~/report` alone, and nothing expands what Python is given. Without such a home folder the path
    stays as it is.
    """
    return pathlib.Path(os.path.expanduser(path))
