"""What every opening is made of: the first picture, and the solvers that a need is answered with."""

from __future__ import annotations

from collections.abc import Sequence

from hqp_rp.compare.report.report import Section
from hqp_rp.compare.report.words import listing, number

NOBODY = "no solver here: see the tables for who comes near"
_SHOWN = 3


def first_chart(sections: Sequence[Section]) -> str:
    """The name of the first chart there is, "" for none."""
    for section in sections:
        if section.charts:
            return section.charts[0].name
        inner = first_chart(section.sections)
        if inner:
            return inner
    return ""


def advised(labels: Sequence[str]) -> str:
    """The solvers that answer a need, or that none does."""
    return listing(labels) or NOBODY


def advised_against(found: Sequence[tuple[str, float]]) -> str:
    """The first few solvers to avoid, each with the figure that speaks against it."""
    more = len(found) - _SHOWN
    names = listing([f"{label} ({number(value)})" for label, value in found[:_SHOWN]])
    return f"{names}{f' and {more} more' if more > 0 else ''}"
