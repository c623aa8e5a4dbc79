"""The subcommands `hqp-rp solvers` and `hqp-rp scenarios`: what there is, from the registries."""

from __future__ import annotations

import dataclasses
import shutil
import textwrap
from collections.abc import Sequence

from hqp_rp.core.solver import all_solvers
from hqp_rp.scenarios.scenario import all_scenarios


def solvers() -> int:
    """List every solver: name, what it does, what it accepts, its settings and where it comes from."""
    blocks = []
    for name, kind in all_solvers().items():
        taken = ["equalities"]
        taken += ["two-sided rows"] if kind.takes_inequalities else []
        taken += ["hard rows"] if kind.takes_hard else []
        settings = [f"{field.name}={field.default!r}" for field in dataclasses.fields(kind) if field.init]
        blocks.append((name, [
            ("does", kind.summary.rstrip(".")),
            ("accepts", ", ".join(taken)),
            ("settings", ", ".join(settings) or "none"),
            ("source", kind.source),
        ]))  # fmt: skip
    _print_blocks(blocks)
    return 0


def scenarios() -> int:
    """List every scenario: name, its question, its settings."""
    blocks = []
    for name, kind in all_scenarios().items():
        settings = [f"{field.name}={field.default!r}" for field in dataclasses.fields(kind) if field.init]
        blocks.append((name, [
            ("asks", kind.question),
            ("along", kind.abscissa),
            ("settings", ", ".join(settings) or "none"),
        ]))  # fmt: skip
    _print_blocks(blocks)
    return 0


def _print_blocks(blocks: Sequence[tuple[str, Sequence[tuple[str, str]]]]) -> None:
    width = max(min(shutil.get_terminal_size((100, 24)).columns, 110), 40)
    for name, lines in blocks:
        print(name)
        for key, text in lines:
            first = f"  {key:<10}"
            print(textwrap.fill(text, width, initial_indent=first, subsequent_indent=" " * len(first)))
        print()
