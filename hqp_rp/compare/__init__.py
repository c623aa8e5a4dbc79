"""Solvers side by side: what they are run on, what was measured, what follows, and how it is told.

What flows: `contestants` (who) are run by `measure` on scenarios, in `workers`, what is finished kept in a `run_folder`;
`limits` and `comparison` rule on that, `stress` samples one robot and stack, `statistics` passages through singularities,
`claims` tests a paper. Each puts its page together from `figures` and `report`. `play` runs one stack
in a loop for a person to look at. `command_line` is the way in: it gathers the `commands`, with
`settings_text` and `robot_options` for what is typed, `exit_codes` for how it ends, and `machine` for where it ran.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from hqp_rp.core.extras import REPORT, absent, missing_of

if TYPE_CHECKING:
    from hqp_rp.compare.comparison.comparison import Comparison, compare
    from hqp_rp.compare.contestants import Contestant, default_contestants

__all__ = ["Comparison", "Contestant", "compare", "default_contestants"]

# The command line lists solvers without loading polars, plotly or matplotlib.
_LAZY = {
    "Comparison": "comparison.comparison",
    "compare": "comparison.comparison",
    "Contestant": "contestants",
    "default_contestants": "contestants",
}

_NEED_REPORT = ("Comparison", "compare")


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'hqp_rp.compare' has no attribute {name!r}")
    if name in _NEED_REPORT and missing_of(REPORT):
        return absent(f"hqp_rp.compare.{name}", *REPORT)
    return getattr(importlib.import_module(f"hqp_rp.compare.{_LAZY[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
