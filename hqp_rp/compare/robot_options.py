"""How the command line says which robot: its options as arguments of `load_robot`, and what these say in its own words."""

from __future__ import annotations

import contextlib
import re
import sys
import warnings
from collections.abc import Iterator, Sequence
from typing import Any, TextIO

_OPTIONS = (
    (r"\bgive another with neutral=", "give another with --keyframe, or with neutral under [robot] in the stack file"),
    (r"\bgive velocity_limit\b", "give velocity_limit under [robot] in the stack file"),
    (r"\brepair_inertias=True\b", "--repair-inertias"),
    (r"\bfloating_base=True\b", "--floating-base"),
    (r"\bmeshes=False\b", "--no-meshes"),
    (r"\bpackage_paths=\[FOLDER\]", "--package-path FOLDER"),
    (r"\bgive dt, in s, such as dt=(\S+?)\.$", r"write dt = \1 (in s) above the first level of the stack file."),
)


def robot_options(
    library: str | None,
    meshes: bool,
    package_path: Sequence[str],
    floating_base: bool,
    repair_inertias: bool,
    keyframe: str | None,
) -> dict[str, Any]:
    """What was given, as the attributes of a `RobotSource`; what was not given is left out."""
    given: dict[str, Any] = {} if meshes else {"meshes": False}
    asked = {
        "library": library,
        "package_paths": tuple(package_path),
        "floating_base": floating_base,
        "repair_inertias": repair_inertias,
        "neutral": keyframe,
    }
    return given | {name: value for name, value in asked.items() if value}


def as_options(sentence: str) -> str:
    """A sentence that names arguments of Python, with the options of the command line in their place."""
    for argument, option in _OPTIONS:
        sentence = re.sub(argument, option, sentence)
    return sentence


@contextlib.contextmanager
def warnings_in_lines() -> Iterator[None]:
    """What the library warns of is one line on standard error, without the place in the source."""
    before = warnings.showwarning
    told: set[str] = set()  # of several stacks on one robot, each says the same

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if category is not UserWarning:
            before(message, category, filename, lineno, file, line)
        elif (sentence := as_options(str(message))) not in told:
            told.add(sentence)
            print(f"hqp-rp: {sentence}", file=sys.stderr)

    warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = before
