"""What every opening is made of: the first picture, and the solvers that a need is answered with."""

from __future__ import annotations

from collections.abc import Sequence

from hqp_rp.compare.report.report import Section
from hqp_rp.compare.report.sentences import Sentences

say = Sentences(__file__)
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
    return say("advised", found=labels)


def advised_against(found: Sequence[tuple[str, float]]) -> str:
    """The first few solvers to avoid, each with the figure that speaks against it."""
    return say("advised_against", found=found[:_SHOWN], more=max(len(found) - _SHOWN, 0))
