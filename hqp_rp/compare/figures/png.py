"""Charts drawn by matplotlib, for the written report."""

from __future__ import annotations

import io
import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from hqp_rp.compare.figures.chart import Bars, Chart, Dots, Grid, Lines, Picture, Style

_DASH: dict[str, Any] = {"solid": "-", "dash": (0, (4, 1.5)), "dot": (0, (1, 1.5))}
_GREY = "#666666"
_MAP = "RdYlBu_r"


def png(chart: Chart, styles: dict[str, Style]) -> bytes:
    """The chart as a PNG file; the same data gives the same bytes."""
    if isinstance(chart, Picture):
        return chart.png
    buffer = io.BytesIO()
    figure(chart, styles).savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    return buffer.getvalue()


def figure(chart: Chart, styles: dict[str, Style]) -> Figure:
    """The chart as a figure of matplotlib; a `Picture` is none."""
    assert not isinstance(chart, Picture)
    if isinstance(chart, Bars):
        return _bars(chart)
    if isinstance(chart, Grid):
        return _grid(chart)
    return _lines(chart, styles) if isinstance(chart, Lines) else _dots(chart, styles)


def _lines(chart: Lines, styles: dict[str, Style]) -> Figure:
    columns, rows = len(chart.columns), len(chart.rows)
    labels = [
        sorted({line.label: None for row in chart.panels for line in row[c]}, key=_rank(styles)) for c in range(columns)
    ]
    lines = [sum(1 + _name(label).count("\n") for label in own) for own in labels]
    key = 0.165 * max(lines) + 0.35
    width = 0.9 + 3.1 * columns
    title = _title(chart.title, width - 0.85)
    head = 0.45 + 0.2 * title.count("\n")
    height = head + key + 1.75 * rows + 0.6
    figure = Figure(figsize=(width, height), facecolor="white")
    grid = figure.subplots(rows, columns, sharex=True, sharey="row", squeeze=False)
    left, bottom = 0.85 / width, 0.6 / height
    top = 1.0 - (head + key) / height
    figure.subplots_adjust(left=left, right=1.0 - 0.15 / width, bottom=bottom, top=top, wspace=0.06, hspace=0.1)
    figure.text(left, 1.0 - 0.12 / height, title, fontsize=12, fontweight="bold", va="top")
    for c, column in enumerate(chart.columns):
        box = grid[0, c].get_position()
        handles = [_handle(styles[label], label) for label in labels[c]]
        figure.legend(
            handles=handles,
            loc="lower left",
            bbox_to_anchor=(box.x0 - 0.05 / width, top + 0.03 / height),
            title=column,
            title_fontproperties={"size": 9, "weight": "bold"},
            alignment="left",
            fontsize=8.5,
            frameon=False,
            handlelength=1.8,
            labelspacing=0.25,
            borderpad=0.1,
        )
        for r in range(rows):
            _panel(grid[r, c], chart, r, c, styles)
    for r, label in enumerate(chart.rows):
        grid[r, 0].set_ylabel(label, fontsize=9)
    for axes in grid[-1]:
        axes.set_xlabel(chart.x_label, fontsize=8.5)
    return figure


def _title(words: str, width: float) -> str:
    """The title on as many lines as a figure of that width in inches needs."""
    return textwrap.fill(words, max(int(width / 0.105), 20))


def _rank(styles: dict[str, Style]) -> Any:
    return lambda label: styles[label].rank


def _width(style: Style, count: int) -> float:
    """Wide under narrow: of curves that lie on each other, every one stays visible."""
    return 1.1 + 0.75 * (count - 1 - min(style.rank, count - 1))


def _handle(style: Style, label: str) -> Line2D:
    return Line2D([], [], color=style.colour, linestyle=_DASH[style.dash], linewidth=2.2, label=_name(label))


def _name(label: str) -> str:
    """A label on as many lines as the width of a column needs."""
    return textwrap.fill(label, 38)


def _panel(axes: Axes, chart: Lines, r: int, c: int, styles: dict[str, Style]) -> None:
    lines = sorted(chart.panels[r][c], key=lambda line: styles[line.label].rank)
    count = 1 + max((styles[line.label].rank for line in lines), default=0)
    for line in lines:
        style = styles[line.label]
        if line.low is not None and line.high is not None:
            axes.fill_between(
                line.x, chart.drawn(r, line.low), chart.drawn(r, line.high), color=style.colour, alpha=0.06, linewidth=0
            )
        look = {"color": style.colour, "linestyle": _DASH[style.dash], "linewidth": _width(style, count)}
        if line.sure is not None:
            axes.plot(line.x, chart.drawn(r, line.y), alpha=0.4, solid_capstyle="butt", **look)
        axes.plot(line.x, chart.drawn(r, line.certain()), solid_capstyle="butt", **look)
    if chart.log_x:
        axes.set_xscale("log")
    if chart.log_y[r]:
        axes.set_yscale("log")
    axes.set_ylim(*chart.limits(r))
    if chart.log_y[r]:
        _log_ticks(axes.yaxis, 7)
    if chart.log_x:
        _log_ticks(axes.xaxis, 8)
    if chart.reverse_x and not axes.xaxis_inverted():
        axes.invert_xaxis()
    for k, (at, words) in enumerate(chart.marks):
        axes.axvline(at, color=_GREY, linewidth=0.8, linestyle=":")
        if r == 0 and words:
            away, side = (2, "left") if chart.in_left_half(at) else (-2, "right")
            axes.annotate(words, (at, 1.0), (away, -2 - 10 * k), xycoords=("data", "axes fraction"), textcoords="offset points",
                          fontsize=7, color=_GREY, va="top", ha=side)  # fmt: skip
    axes.grid(True, which="major", color="#e4e4e4", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, color=_GREY)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _log_ticks(axis: Axis, most: int) -> None:
    """At most so many ticks on a log axis: powers of ten where it holds two of them, else numbers between."""
    low, high = sorted(axis.get_view_interval())
    powers = np.floor(np.log10(high)) - np.ceil(np.log10(low)) + 1
    if powers >= 2:
        axis.set_major_locator(LogLocator(numticks=most))
    else:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)) if high > 5.0 * low else MaxNLocator(4))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def _dots(chart: Dots, styles: dict[str, Style]) -> Figure:
    labels, columns = chart.labels, len(chart.columns)
    places = _row_places(chart)
    widest = max((len(label) for label in labels), default=10)
    margin = 0.3 + 0.075 * widest
    width, height = margin + 4.2 * columns + 0.3, 1.5 + 0.24 * (max(places.values(), default=0.0) + 1)
    figure = Figure(figsize=(width, height), facecolor="white")
    grid = figure.subplots(1, columns, sharey=True, squeeze=False)[0]
    figure.subplots_adjust(
        left=margin / width, right=1.0 - 0.25 / width, top=1.0 - 0.8 / height, bottom=0.65 / height, wspace=0.08
    )
    words = _title(chart.title, width - 0.4)
    figure.text(0.2 / width, 1.0 - 0.12 / height, words, fontsize=12, fontweight="bold", va="top")
    for axes, title, values in zip(grid, chart.columns, chart.values, strict=True):
        axes.set_title(title, fontsize=10, loc="left")
        for label in labels:
            if label not in values or not len(values[label]):
                axes.text(0.5, places[label], "no answer", transform=axes.get_yaxis_transform(), fontsize=7.5,
                          color=_GREY, ha="center", va="center")  # fmt: skip
                continue
            _row(axes, chart, places[label], values[label], styles[label].colour)
        if chart.log_x:
            axes.set_xscale("log")
        axes.set_xlim(*chart.limits)
        if chart.log_x:
            _log_ticks(axes.xaxis, 9)
        axes.axvspan(chart.absent_from, chart.limits[1], color="#f3f3f3", linewidth=0, zorder=0)
        axes.annotate(chart.absent, (chart.absent_at, 1.0), (0, 3), xycoords=("data", "axes fraction"),
                      textcoords="offset points", fontsize=8, color=_GREY, ha="center")  # fmt: skip
        axes.set_xlabel(chart.x_label, fontsize=9)
        axes.grid(True, color="#e4e4e4", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=8, color=_GREY, length=2)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    grid[0].set_ylim(max(places.values(), default=0.0) + 0.8, -0.8)
    grid[0].set_yticks([places[label] for label in labels], labels, fontsize=8.5)
    return figure


def _row(axes: Axes, chart: Dots, place: float, values: Any, colour: str) -> None:
    drawn = chart.place(values)
    middle = chart.middle(values)
    axes.plot([drawn.min(), drawn.max()], [place, place], color=colour, linewidth=1.2, alpha=0.5)
    axes.plot(drawn, np.full(len(drawn), place), "o", color=colour, markersize=3.5, alpha=0.6, markeredgewidth=0)
    finite = bool(np.isfinite(middle))
    axes.plot([middle if finite else chart.absent_at], [place], "o", color=colour, markersize=7.5,
              markerfacecolor=colour if finite else "white", markeredgewidth=1.5)  # fmt: skip


def _bars(chart: Bars) -> Figure:
    rows = chart.rows()
    last = max((at for at, *_ in rows), default=0.0)
    margin = 0.3 + 0.075 * max((len(label) for _, label, _, _ in rows), default=10)
    width = margin + max([6.2, *(0.3 + 0.076 * len(title) for title, _ in chart.groups)])
    height = 1.5 + 0.21 * (last + 1.0)
    figure = Figure(figsize=(width, height), facecolor="white")
    axes = figure.add_axes((margin / width, 0.55 / height, 1.0 - (margin + 0.3) / width, 1.0 - 1.35 / height))
    figure.text(0.2 / width, 1.0 - 0.32 / height, chart.title, fontsize=12, fontweight="bold")
    for at, _, value, kind in rows:
        axes.barh(at, value - 1.0, left=1.0, height=0.72, color=chart.colour(kind), linewidth=0)
        beside, side = ((3, 0), "left") if value >= 1.0 else ((-3, 0), "right")
        axes.annotate(
            chart.written(value), (value, at), beside, textcoords="offset points", fontsize=7.5, va="center", ha=side
        )
    for at, title in chart.titles():
        axes.text(0.0, at, title, fontsize=9, fontweight="bold", va="center", transform=axes.get_yaxis_transform())
    axes.set_xscale("log")
    least = min([1.0, *(value for _, _, value, _ in rows)])
    axes.set_xlim(least * (0.9 if least == 1.0 else 0.5), max([10.0, *(v for _, _, v, _ in rows)]) * 1.6)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_ylim(last + 0.8, -0.8)
    axes.set_yticks([at for at, *_ in rows], [label for _, label, _, _ in rows], fontsize=8)
    axes.set_xlabel(chart.x_label, fontsize=9)
    axes.grid(True, axis="x", color="#e4e4e4", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, color=_GREY, length=2)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    handles = [Line2D([], [], color=chart.colour(k), linewidth=6, label=kind) for k, kind in enumerate(chart.kinds)]
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.15 / width, 1.0 - 0.42 / height), ncols=len(handles),
                  fontsize=8.5, frameon=False)  # fmt: skip
    return figure


def _row_places(chart: Dots) -> dict[str, float]:
    """Label -> height: one unit a row, half a unit between groups."""
    places, at = {}, 0.0
    for _, labels in chart.groups:
        for label in labels:
            places[label] = at
            at += 1.0
        at += 0.6
    return places


def _grid(chart: Grid) -> Figure:
    columns, rows = len(chart.columns), len(chart.rows)
    width, height = 2.4 + 0.78 * columns, 1.6 + 0.42 * rows
    title = _title(chart.title, width - 0.4)
    height += 0.2 * title.count("\n")
    figure = Figure(figsize=(width, height), facecolor="white")
    top = 0.55 + 0.2 * title.count("\n")
    axes = figure.add_axes((1.15 / width, 0.75 / height, 0.78 * columns / width, 1.0 - (0.75 + top) / height))
    figure.text(0.2 / width, 1.0 - 0.12 / height, title, fontsize=12, fontweight="bold", va="top")
    picture = axes.imshow(chart.colours(), origin="lower", aspect="auto", cmap=_MAP, vmin=0.0, vmax=1.0, alpha=0.85)
    for r, row in enumerate(chart.texts):
        for c, words in enumerate(row):
            axes.text(c, r, words, ha="center", va="center", fontsize=8)
    if chart.line is not None:
        words, x, y = chart.line
        axes.plot(x, y, color="black", linewidth=2.0, linestyle=(0, (4, 1.5)), label=words, clip_on=True)
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8, frameon=False, borderpad=0.1)
    axes.set_xlim(-0.5, columns - 0.5)
    axes.set_ylim(-0.5, rows - 0.5)
    axes.set_xticks(range(columns), chart.columns, fontsize=8.5)
    axes.set_yticks(range(rows), chart.rows, fontsize=8.5)
    axes.set_xlabel(chart.x_label, fontsize=9)
    axes.set_ylabel(chart.y_label, fontsize=9)
    axes.tick_params(color=_GREY, length=2)
    bar = figure.colorbar(picture, ax=axes, cax=figure.add_axes((1.0 - 0.95 / width, 0.75 / height, 0.16 / width,
                          1.0 - (0.75 + top) / height)))  # fmt: skip
    ticks = np.geomspace(chart.low, chart.high, 4)
    bar.set_ticks(np.linspace(0.0, 1.0, 4).tolist(), labels=[f"{tick:.2g}" for tick in ticks], fontsize=8)
    bar.set_label(chart.colour_label, fontsize=8.5)
    return figure
