"""Which methods stand in one column, and how each is drawn."""

from __future__ import annotations

from collections.abc import Sequence

from hqp_rp.compare.claims.methods import (
    CASCADE,
    CLASSICAL,
    DLS,
    DLS_VARIABLE,
    NULL_DAMPED,
    NULL_SPACE,
    NULL_VARIABLE,
    REVERSE,
    REVERSE_DAMPED,
    REVERSE_EVERYWHERE,
    REVERSE_VARIABLE,
    ROBUST,
    UNILATERAL,
    WEIGHTED,
)
from hqp_rp.compare.figures.chart import Chart, Dots, Lines, Style, styles

DESIRED, LAW = "desired", "the law alone"
"""Labels of what is no method."""
GROUPS = (
    (REVERSE, REVERSE_DAMPED, REVERSE_VARIABLE, REVERSE_EVERYWHERE, UNILATERAL),
    (NULL_SPACE, NULL_DAMPED, NULL_VARIABLE, CASCADE, ROBUST),
    (CLASSICAL, DLS, DLS_VARIABLE, WEIGHTED),
)
COLUMNS = ("reverse priority", "other priorities", "no priority")
"""Titles of the columns, one for each of `GROUPS`."""


def chart_styles(charts: Sequence[Chart]) -> dict[str, Style]:
    """A style for every label in the charts; a label of several methods has that of the first."""
    known = dict(styles(GROUPS))
    known |= {DESIRED: Style("#888888", "dot", 3), LAW: Style("#888888", "dash", 3)}
    plain = dict(styles([[*(label for label in _labels(charts) if label.split(" = ")[0] not in known)]]))
    return known | plain | {label: known[label.split(" = ")[0]] for label in _labels(charts) if " = " in label}


def _labels(charts: Sequence[Chart]) -> list[str]:
    found: dict[str, None] = {}
    for chart in charts:
        if isinstance(chart, Lines):
            found |= {line.label: None for row in chart.panels for panel in row for line in panel}
        elif isinstance(chart, Dots):
            found |= dict.fromkeys(chart.labels)
    return list(found)
