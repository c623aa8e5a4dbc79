"""A report as data: sections of sentences, charts and tables, with what is said first."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from hqp_rp.compare.figures.chart import Chart, Style


@dataclasses.dataclass(frozen=True, slots=True)
class Table:
    """A table of ready-made cells: numbers come formatted, so that both forms of a report show the same digits.

    `text` names the columns that hold words and are set flush left; the others hold numbers.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    text: frozenset[int] = frozenset({0})


@dataclasses.dataclass(frozen=True, slots=True)
class Section:
    """A heading, then sentences (as a list when `listed`), charts, tables and sections of its own, in this order."""

    title: str
    sentences: tuple[str, ...] = ()
    listed: bool = False
    charts: tuple[Chart, ...] = ()
    tables: tuple[Table, ...] = ()
    sections: tuple[Section, ...] = ()


@dataclasses.dataclass(frozen=True, slots=True)
class Opening:
    """The first screen: (need, which solver), at most three (number, what it is), and the name of one of the charts.

    `header` says what the two columns of `advice` are.
    """

    advice: tuple[tuple[str, str], ...]
    numbers: tuple[tuple[str, str], ...]
    chart: str
    header: tuple[str, str] = ("need", "take")


@dataclasses.dataclass(frozen=True, slots=True)
class Report:
    """The whole: a title, the question, and sections; how each contestant is drawn; what is said first."""

    title: str
    question: str
    sections: tuple[Section, ...]
    styles: Mapping[str, Style]
    opening: Opening | None = None

    @property
    def picture(self) -> Chart | None:
        """The chart of the opening; the sections then show it no more."""
        name = self.opening.chart if self.opening else ""
        return next((chart for chart in self.charts() if chart.name == name), None)

    def charts(self) -> list[Chart]:
        """Every chart, in the order in which the report shows them."""
        return [chart for section in self.sections for chart in _charts(section)]


def _charts(section: Section) -> list[Chart]:
    return [*section.charts, *(chart for inner in section.sections for chart in _charts(inner))]
