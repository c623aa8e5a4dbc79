"""A report as data, and its two forms: one page that opens offline, and markdown with figures, made to be diffed."""

from __future__ import annotations

import dataclasses
import math
import pathlib
import re
from collections.abc import Mapping, Sequence
from typing import Any

from hqp_rp.compare.figures.chart import Chart, Style
from hqp_rp.compare.run_folder import write_atomically

_EXPONENT = re.compile(r"-?\d[\d.]*e[+-]?\d+")

FILES = ("report.html", "report.md", "figures", "results")
"""What a report's folder holds beside its manifest and its parts."""


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


def write_report(report: Report, folder: pathlib.Path, *, workers: int = 1) -> list[pathlib.Path]:
    """Write report.html, report.md and figures/*.png into `folder`; the paths of the two reports.

    `workers` processes draw the figures. Each file appears whole or not at all; `FileError` when one cannot be written.
    """
    from hqp_rp.compare.figures.html import script

    styles = dict(report.styles)
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    charts = report.charts()
    for old in figures.glob("*.png"):
        if old.stem not in {chart.name for chart in charts}:
            old.unlink()
    if workers > 1 and len(charts) > 1:
        import joblib

        drawn = joblib.Parallel(n_jobs=workers)(joblib.delayed(_drawn)(chart, styles) for chart in charts)
    else:
        drawn = [_drawn(chart, styles) for chart in charts]
    pieces = {}
    for chart, (picture, piece) in zip(charts, drawn, strict=True):
        write_atomically(figures / f"{chart.name}.png", picture)
        pieces[chart.name] = piece
    environment = _environment()
    markdown = environment.get_template("report.md.j2").render(report=report)
    page = environment.get_template("report.html.j2").render(
        report=report, draw=lambda chart: pieces[chart.name], plotly=script()
    )
    paths = [folder / "report.html", folder / "report.md"]
    for path, text in zip(paths, (page, markdown), strict=True):
        write_atomically(path, text.encode())
    return paths


def _drawn(chart: Chart, styles: dict[str, Style]) -> tuple[bytes, str]:
    from hqp_rp.compare.figures.html import html
    from hqp_rp.compare.figures.png import png

    return png(chart, styles), html(chart, styles)


def _environment() -> Any:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(pathlib.Path(__file__).parent / "templates"),
        autoescape=lambda name: name is not None and name.endswith(".html.j2"),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["numbers"] = _kept_together
    return environment


def _kept_together(text: str) -> Any:
    """The text for a page, where no number breaks at the minus of its exponent."""
    import markupsafe

    return markupsafe.Markup(_EXPONENT.sub(r'<span class="n">\g<0></span>', str(markupsafe.escape(text))))


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


def listing(names: Sequence[str]) -> str:
    """Names as a sentence has them: a, b and c."""
    names = list(names)
    if len(names) < 2:
        return "".join(names)
    return f"{', '.join(names[:-1])} and {names[-1]}"
