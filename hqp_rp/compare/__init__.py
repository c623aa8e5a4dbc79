"""Solvers side by side on scenarios: runs, metrics, figures, the written report and the command line."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

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


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'hqp_rp.compare' has no attribute {name!r}")
    return getattr(importlib.import_module(f"hqp_rp.compare.{_LAZY[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
