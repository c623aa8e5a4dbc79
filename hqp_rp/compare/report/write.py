"""A report's two forms: one page that opens offline, and markdown with figures, made to be diffed."""

from __future__ import annotations

import pathlib
import re
from typing import Any

from hqp_rp.compare.figures.chart import Chart, Style
from hqp_rp.compare.report.report import Report
from hqp_rp.compare.run_folder import write_atomically

_EXPONENT = re.compile(r"-?\d[\d.]*e[+-]?\d+")

FILES = ("report.html", "report.md", "figures", "results")
"""What a report's folder holds beside its manifest and its parts."""


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
