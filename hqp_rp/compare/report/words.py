"""Figures, shares and counts as a report spells them."""

from __future__ import annotations

import math


def number(value: float | None, digits: int = 2) -> str:
    """A figure with few significant digits, so that reports of equal runs are equal: 1.2e-07, 1e-06, 0.53, 12; - for none."""
    if value is None or math.isnan(value):
        return "-"
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    if value == 0.0:
        return "0"
    if 1e-2 <= abs(value) < 1e4:
        rounded = float(f"{value:.{digits}g}")
        return f"{rounded:g}"
    return f"{value:.{digits - 1}e}".replace(".0e", "e")


def share(value: float | None) -> str:
    """A share as percent: 100 %, 99.7 %, 0 %."""
    if value is None:
        return "-"
    if value in (0.0, 1.0):
        return f"{100 * value:.0f} %"
    return f"{min(max(100.0 * value, 0.1), 99.9):.1f} %"


def counted(count: int, noun: str) -> str:
    """How many of something: 1 path, 2 paths."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
