"""The words of a chart can be read: none is missing, cut off or laid on another, on a page and in a figure."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp.compare.contestants import default_contestants
from hqp_rp.compare.figures.chart import Bars, Chart, Dots, Grid, Line, Lines, styles
from hqp_rp.compare.figures.html import html
from hqp_rp.compare.figures.panels import grouped
from hqp_rp.compare.figures.png import figure
from hqp_rp.compare.report.report import Report, Section
from hqp_rp.compare.report.write import write_report
from hqp_rp.core.variant import GROUPS
from tests.compare.figures.drawn_texts import CHROMIUM, Drawn, Page, in_figure, on_page, tick_labels

WIDTHS = (1280, 420)
LINE_UP = grouped(default_contestants())
COLUMNS = tuple(group for group, _ in LINE_UP)
LABELS = [label for _, labels in LINE_UP for label in labels]
LOOK = styles([labels for _, labels in LINE_UP])


def lines(name: str, x: list[float], y: list[float], rows: tuple[str, ...] = (), **changes: object) -> Lines:
    """Every solver of the line-up in one chart, on x and y as long as each other."""
    rows = rows or ("1: tool position\nexcess error", "velocity limit\nviolation [rad/s]")
    panels = tuple(tuple(Line(label, np.array(x), np.array(y)) for label in labels) for _, labels in LINE_UP)
    settings: dict[str, object] = {
        "name": name, "title": "What each level misses (a scenario, a case)", "caption": "",
        "x_label": "distance to the singularity",
        "columns": COLUMNS, "rows": rows, "panels": (panels,) * len(rows), "log_y": (True,) * len(rows),
        "floor": (1e-17,) * len(rows), "ceiling": (1e14,) * len(rows),
    }  # fmt: skip
    return Lines(**{**settings, **changes})  # type: ignore[arg-type]


def dots(name: str, low: float, high: float, log: bool = True) -> Dots:
    """Two runs of every solver on four cases; the second run of half of them has no value."""
    groups = tuple((group, tuple(labels)) for group, labels in LINE_UP)
    values = {label: np.array([low if i % 3 else high, np.nan if i % 2 else high]) for i, label in enumerate(LABELS)}
    columns = ("position [rad]", "acceleration violation added [rad/s^2]", "distance [m]", "three levels, hard rows")
    x_label = "largest violation, in the unit of the column"
    return Dots(name, "Parting", "", x_label, columns, groups, (values,) * 4, log_x=log, reverse_x=log)


def bars(name: str, least: float, most: float) -> Bars:
    values = np.geomspace(least, most, len(LABELS))
    bars = tuple((label, float(value), i % 3) for i, (label, value) in enumerate(zip(LABELS, values, strict=True)))
    title = "7 joints, 3+3+7, hard velocity limits, along a path: times of active set, warm, 4.15 us"
    return Bars(
        name, "7 joints", "", "times slower (log)", ((title, bars), ("30", bars)), ("hqp_rp", "peer", "uncertified")
    )


def grid(name: str, columns: int, rows: int) -> Grid:
    """A map with a curve over it."""
    values = np.geomspace(1e-3, 300.0, columns * rows).reshape(rows, columns)
    texts = tuple(tuple(f"{v:.2g}" for v in row) for row in values.tolist())
    curve = ("delay margin of the law alone", np.arange(float(columns)), np.linspace(0.0, rows - 1.0, columns))
    title = "Force error at the end, by delay of the reading (paper's numbers, servo x 30)"
    across = tuple(f"{10.0**k:.0e}" for k in range(columns))
    return Grid(
        name, title, "", "wall stiffness (N/m)", "delay (ms)", across, tuple(f"{k:g}" for k in range(rows)), values, texts,
        0.03, 30.0, "late RMS error (N)", curve,
    )  # fmt: skip


GROWTH = tuple(Line(label, np.array([1.0, 8.0]), np.array([1.0, 2e5])) for label in LABELS[:7])
DECADES = [10.0**-k for k in range(17)]
CHARTS: tuple[Chart, ...] = (
    lines("approach", DECADES, DECADES, log_x=True, reverse_x=True, marks=((1e-12, "rank rule cuts"), (0.1, "damping begins"))),
    lines("one_row", DECADES, DECADES[::-1], ("|x|",), log_x=True, reverse_x=True),
    lines("profile", [1.0, 1e4, 1e8], [0.0, 0.5, 1.0], log_x=True, log_y=(False, False)),
    lines("over_time", [0.0, 2.0, 4.0], [1e-15, 1e-4, 1.0]),
    lines("level", [0.0, 1.23], [3.1, 3.2]),
    lines("decade", [0.0, 12000.0], [0.3, 6.0]),
    lines("large", [0.0, 0.002], [-12345.0, 54321.0], log_y=(False, False)),
    lines("levels", [1.0, 8.0], [], ("us per call",), columns=("solver",), panels=((GROWTH,),)),
    dots("parting", 1e-13, 1.0),
    dots("alike", 0.0071, 0.0074),
    dots("near", 0.02, 0.3),
    dots("when", 0.0, 3.75, log=False),
    bars("ratios", 1.0, 1170.0),
    bars("faster", 0.012, 2.0),
    bars("equal", 1.0, 1.05),
    grid("map", 7, 7),
    grid("small_map", 3, 2),
)  # fmt: skip
NAMES = [chart.name for chart in CHARTS]


@pytest.mark.parametrize("chart", CHARTS, ids=NAMES)
def test_in_a_figure_nothing_overlaps_and_every_axis_has_numbers(chart: Chart) -> None:
    drawing = figure(chart, LOOK)
    assert in_figure(drawing).faults() == []
    bare = 1 if isinstance(chart, Grid) else 0  # a colour bar has numbers along it, none across
    assert sum(len(numbers) < 2 for numbers in tick_labels(drawing)) == bare


@pytest.mark.parametrize("chart", CHARTS, ids=NAMES)
def test_a_figure_names_every_contestant(chart: Chart) -> None:
    words = {word.text for word in in_figure(figure(chart, LOOK)).words}
    assert words >= names(chart)


def test_words_on_each_other_and_cut_words_are_found() -> None:
    drawing = figure(CHARTS[0], LOOK)
    drawing.text(0.5, 0.5, "over the panels")
    drawing.text(0.5, 0.51, "laid on it")
    drawing.text(0.99, 0.5, "beyond the edge")
    assert in_figure(drawing).faults() == ["'over the panels' on 'laid on it'", "'beyond the edge' is cut off"]


def names(chart: Chart) -> set[str]:
    """What a reader must find in words."""
    if isinstance(chart, Lines):
        return {line.label for row in chart.panels for panel in row for line in panel}
    if isinstance(chart, Grid):
        inside = {words for row in chart.texts for words in row}
        return inside | {*chart.columns, *chart.rows} | ({chart.line[0]} if chart.line else set())
    return set(LABELS) | (set(chart.kinds) if isinstance(chart, Bars) else set())


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Page]:
    """A report of all charts, at each width."""
    folder = tmp_path_factory.mktemp("page")
    page = write_report(Report("t", "q?", (Section("s", charts=CHARTS),), LOOK), folder)[0]
    return on_page(page, WIDTHS, folder)


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine to render a page in")
@pytest.mark.parametrize("width", WIDTHS)
def test_on_a_page_nothing_overlaps_and_every_name_is_there(pages: dict[int, Page], width: int) -> None:
    assert not pages[width].scrolls
    drawn: dict[str, Drawn] = {chart.name: chart for chart in pages[width].charts}
    assert list(drawn) == NAMES
    assert {name: found for name, chart in drawn.items() if (found := chart.faults())} == {}
    for chart in CHARTS:
        assert {word.text for word in drawn[chart.name].words} >= names(chart)


def test_a_page_gives_a_chart_the_width_that_its_columns_need() -> None:
    least = [int(html(chart, LOOK).split("min-width: ")[1].split("px")[0]) for chart in CHARTS[:2] + CHARTS[7:8]]
    assert least[0] == least[1] > 150 * len(GROUPS)
    assert least[2] < 700
