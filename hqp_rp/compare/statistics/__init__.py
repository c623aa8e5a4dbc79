"""Many passages through singularities, so that a verdict is one on methods and not on one path.

What flows through: `arms` says which arms and stacks; `passages` finds singular configurations of each and draws paths through
them; `trials` puts every problem of a path to every contestant, at the `settings` beside its own too, and keeps one row for
each; `verdicts` boils the rows down to medians, intervals and verdicts, and says what they hang on; `record` holds all;
`picture` and `report` draw and write, in the sentences of `sentences.j2`. `study` runs it.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from hqp_rp.core.extras import require_report

if TYPE_CHECKING:
    from hqp_rp.compare.statistics.passages import Design
    from hqp_rp.compare.statistics.record import Statistics
    from hqp_rp.compare.statistics.study import statistics

require_report("hqp_rp.compare.statistics")

__all__ = ["Design", "Statistics", "statistics"]

# polars and matplotlib are loaded only for a study.
_LAZY = {"Design": "passages", "Statistics": "record", "statistics": "study"}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'hqp_rp.compare.statistics' has no attribute {name!r}")
    return getattr(importlib.import_module(f"hqp_rp.compare.statistics.{_LAZY[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
