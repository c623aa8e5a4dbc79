"""Charts drawn by plotly, for the page that opens offline."""

from __future__ import annotations

import base64
import math
import textwrap
from typing import Any

import markupsafe
import numpy as np
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

from hqp_rp.compare.figures.chart import Bars, Chart, Dots, Grid, Lines, Picture, Style
from hqp_rp.core.problem import FloatArray

_GREY = "#666666"
_GRID = "#e4e4e4"

# In pixels. A page narrower than a chart's least width scrolls the chart sideways instead of laying words on words.
_LEAST = 620
_COLUMN = 175
_CELL = 62
_PICTURE = 900
_TITLE_LETTERS = 22
_TITLE_LINE = 17
_LEGEND_LINE = 22
_BUTTONS = 24

# Ticks that nobody sees keep the labels of the abscissa clear of the lowest one of the ordinate.
_LOWERED = {"ticks": "outside", "ticklen": 5, "tickcolor": "rgba(0,0,0,0)"}


def script() -> str:
    """plotly.js, to be put into the page once."""
    return str(get_plotlyjs())


def html(chart: Chart, styles: dict[str, Style]) -> str:
    """The chart as a piece of a page that holds `script()`."""
    if isinstance(chart, Picture):
        data = base64.b64encode(chart.png).decode()
        words = markupsafe.escape(chart.title)
        drawn = f'<img alt="{words}" style="width: 100%" src="data:image/png;base64,{data}">'
        return f'<div style="min-width: {_PICTURE}px">{drawn}</div>'
    if isinstance(chart, Bars):
        figure = _bars(chart)
        least = max([_LEAST, *(220 + 7 * len(title) for title, _ in chart.groups)])
    elif isinstance(chart, Grid):
        figure = _grid(chart)
        least = max(_LEAST, 250 + _CELL * len(chart.columns))
    else:
        figure = _lines(chart, styles) if isinstance(chart, Lines) else _dots(chart, styles)
        least = max(_LEAST, 250 + _COLUMN * len(chart.columns))
    figure.update_layout(
        template="plotly_white",
        font={"family": "system-ui, sans-serif", "size": 12},
        hoverlabel={"namelength": -1},
        paper_bgcolor="rgba(0,0,0,0)",
        modebar={"bgcolor": "rgba(255,255,255,0.7)", "color": "#b0b0b0", "activecolor": _GREY},
    )
    piece = figure.to_html(
        full_html=False,
        include_plotlyjs=False,
        div_id=chart.name,
        config={"displaylogo": False, "responsive": True},
    )
    return f'<div style="min-width: {least}px">{piece}</div>'


def _lines(chart: Lines, styles: dict[str, Style]) -> Any:
    rows, columns = len(chart.rows), len(chart.columns)
    titles, head = _column_titles(chart.columns)
    listed = {line.label for row in chart.panels for lines in row for line in lines}
    height = head + 50 + max(185 * rows, _LEGEND_LINE * (len(listed) + columns))
    figure = make_subplots(
        rows=rows,
        cols=columns,
        shared_xaxes=True,
        shared_yaxes=True,
        column_titles=titles,
        vertical_spacing=0.02,
        horizontal_spacing=0.025,
    )
    figure.update_annotations(font={"size": 13})
    seen: set[str] = set()
    titled: set[int] = set()
    for r, panels in enumerate(chart.panels):
        for c, lines in enumerate(panels):
            for line in sorted(lines, key=lambda line: styles[line.label].rank):
                if line.label not in seen:
                    title = None if c in titled else chart.columns[c]
                    figure.add_trace(_in_legend(line.label, styles[line.label], title), row=r + 1, col=c + 1)
                    seen.add(line.label)
                    titled.add(c)
                for trace in _traces(chart, r, line.label, line, styles[line.label], len(lines)):
                    figure.add_trace(trace, row=r + 1, col=c + 1)
        low, high = chart.limits(r)
        scale = (
            {"type": "log", "range": [math.log10(low), math.log10(high)], "dtick": _decades(math.log10(high / low), 6)}
            if chart.log_y[r]
            else {"range": [low, high]}
        )
        figure.update_yaxes(exponentformat="power", gridcolor=_GRID, zeroline=False, row=r + 1, **scale)
        figure.update_yaxes(title_text=chart.rows[r].replace("\n", "<br>"), row=r + 1, col=1)
    most = 3 if columns > 2 else 8
    figure.update_xaxes(gridcolor=_GRID, zeroline=False, showgrid=True, nticks=most + 1, tickangle=0, **_LOWERED)
    low, high = chart.abscissas
    if chart.log_x:
        figure.update_xaxes(type="log", exponentformat="power", dtick=_decades(high - low, most))
    room = 0.06 * (high - low)
    ends = [low - room, high + room]
    figure.update_xaxes(range=ends[::-1] if chart.reverse_x else ends)
    _label_below(figure, chart.x_label)
    for k, (at, words) in enumerate(chart.marks):
        figure.add_vline(x=at, line={"color": _GREY, "width": 1, "dash": "dot"})
        figure.add_annotation(
            x=math.log10(at) if chart.log_x else at, xref="x", y=1.0, yref="y domain", text=words, showarrow=False,
            yshift=-14 * k, bgcolor="rgba(255,255,255,0.7)",
            font={"size": 10, "color": _GREY}, xanchor="left" if chart.in_left_half(at) else "right", yanchor="top",
        )  # fmt: skip
    figure.update_layout(
        height=height,
        margin={"l": 70, "r": 10, "t": head, "b": 50},
        legend={"tracegroupgap": 2, "groupclick": "togglegroup", "font": {"size": 11}},
    )
    return figure


def _column_titles(columns: tuple[str, ...]) -> tuple[list[str], int]:
    """The titles on lines that a column of the least width has room for, and the pixels above the panels that they take."""
    lines = [_wrapped(title) for title in columns]
    return ["<br>".join(title) for title in lines], 14 + _TITLE_LINE * max(map(len, lines))


def _wrapped(title: str) -> list[str]:
    """The title on as few lines as a column needs, of about equal length."""
    lines = textwrap.wrap(title, _TITLE_LETTERS) or [""]
    narrower = (textwrap.wrap(title, letters) for letters in range(-(-len(title) // len(lines)), _TITLE_LETTERS))
    return next((found for found in narrower if len(found) == len(lines)), lines)


def _label_below(figure: Any, words: str) -> None:
    """One label for the abscissas of all columns."""
    figure.add_annotation(
        text=words, x=0.5, xref="paper", xanchor="center", y=0.0, yref="paper", yanchor="top", yshift=-26,
        showarrow=False, font={"size": 11},
    )  # fmt: skip


def _decades(shown: float, ticks: int) -> float | str | None:
    """The step of a log axis over so many decades with at most so many ticks; None leaves it to plotly."""
    if shown < 1.0:
        return None
    return "D2" if shown < 2.0 else math.ceil(shown / ticks)


def _in_legend(label: str, style: Style, title: str | None) -> Any:
    """The entry of a contestant in the legend, whatever there is to draw of it; `title` of the group that it begins."""
    group = None if title is None else {"text": f"<b>{title}</b>"}
    return go.Scatter(
        x=[None], y=[None], mode="lines", name=label, legendgroup=label, legendgrouptitle=group, showlegend=True,
        line={"color": style.colour, "dash": style.dash, "width": 2.5},
    )  # fmt: skip


def _traces(chart: Lines, row: int, label: str, line: Any, style: Style, count: int) -> list[Any]:
    look = {"color": style.colour, "dash": style.dash, "width": 1.3 + 0.7 * max(count - 1 - style.rank, 0)}
    common = {"mode": "lines", "legendgroup": label, "showlegend": False}
    traces = []
    if line.sure is not None:
        traces.append(
            go.Scatter(
                x=_short(line.x), y=_short(chart.drawn(row, line.y)), line=look, opacity=0.4, hoverinfo="skip", **common
            )
        )
    words = f"<b>{label}</b><br>%{{x:.3g}}: %{{y:.3g}}<extra></extra>"
    if line.sure is not None and not np.isfinite(line.certain()).any():  # still in the legend and under the pointer
        look = {**look, "width": 0.1}
        y = line.y
    else:
        y = line.certain()
    traces.append(
        go.Scatter(
            x=_short(line.x),
            y=_short(chart.drawn(row, y)),
            name=label,
            line=look,
            hovertemplate=words,
            connectgaps=False,
            **common,
        )
    )
    return traces


def _dots(chart: Dots, styles: dict[str, Style]) -> Any:
    labels = chart.labels
    titles, head = _column_titles(chart.columns)
    figure = make_subplots(rows=1, cols=len(chart.columns), shared_yaxes=True, horizontal_spacing=0.025,
                           column_titles=titles)  # fmt: skip
    figure.update_annotations(font={"size": 13}, yshift=_TITLE_LINE)
    for c, values in enumerate(chart.values):
        for label in labels:
            if label not in values or not len(values[label]):
                continue
            drawn = chart.place(values[label])
            words = [f"{v:.3g}" if np.isfinite(v) else chart.absent for v in values[label]]
            figure.add_trace(
                go.Scatter(
                    x=_short(drawn), y=[label] * len(drawn), mode="markers", name=label, showlegend=False, text=words,
                    marker={"color": styles[label].colour, "size": 6, "opacity": 0.6},
                    hovertemplate="<b>%{y}</b>: %{text}<extra></extra>",
                ), row=1, col=c + 1,
            )  # fmt: skip
            middle = chart.middle(values[label])
            finite = bool(np.isfinite(middle))
            figure.add_trace(
                go.Scatter(
                    x=[middle if finite else chart.absent_at], y=[label], mode="markers", showlegend=False,
                    text=[f"{middle:.3g}" if finite else chart.absent],
                    marker={"color": styles[label].colour, "size": 12, "symbol": "circle" if finite else "circle-open",
                            "line": {"width": 2, "color": styles[label].colour}},
                    hovertemplate="<b>%{y}</b>, median: %{text}<extra></extra>",
                ), row=1, col=c + 1,
            )  # fmt: skip
        figure.add_annotation(
            x=math.log10(chart.absent_at) if chart.log_x else chart.absent_at, y=1.0, yref="y domain", row=1, col=c + 1,
            text=chart.absent, showarrow=False, yanchor="bottom", font={"size": 10, "color": _GREY},
        )  # fmt: skip
    limits = [math.log10(v) for v in chart.limits] if chart.log_x else list(chart.limits)
    figure.update_xaxes(range=limits, gridcolor=_GRID, zeroline=False, tickangle=0, **_LOWERED)
    if chart.log_x:
        tick = _decades(abs(limits[1] - limits[0]), 4)
        figure.update_xaxes(type="log", exponentformat="power", dtick=tick, nticks=2)
    _label_below(figure, chart.x_label)
    figure.update_yaxes(categoryorder="array", categoryarray=labels[::-1], gridcolor=_GRID,
                        range=[-0.7, len(labels) - 0.3])  # fmt: skip
    head += _TITLE_LINE + _BUTTONS  # the line of `absent`, and plotly's buttons above the titles
    figure.update_layout(height=head + 70 + 24 * len(labels), margin={"l": 150, "r": 10, "t": head, "b": 50})
    return figure


def _bars(chart: Bars) -> Any:
    rows = chart.rows()
    figure = go.Figure()
    for k, kind in enumerate(chart.kinds):
        own = [row for row in rows if row[3] == k]
        figure.add_trace(
            go.Bar(
                y=[at for at, *_ in own], x=[value - 1.0 for _, _, value, _ in own], base=[1.0] * len(own), orientation="h",
                name=kind, marker={"color": chart.colour(k)}, width=0.72, text=[chart.written(value) for _, _, value, _ in own],
                textposition="outside", customdata=[label for _, label, _, _ in own],
                hovertemplate="<b>%{customdata}</b>: %{text}<extra></extra>",
            )
        )  # fmt: skip
    for at, title in chart.titles():
        figure.add_annotation(x=0.0, xref="paper", y=at, text=f"<b>{title}</b>", showarrow=False, xanchor="left")
    values = [value for _, _, value, _ in rows]
    least = min([1.0, *values])
    limits = [math.log10(least * (0.9 if least == 1.0 else 0.5)), math.log10(max([10.0, *values]))]
    limits[1] += 0.18 * (limits[1] - limits[0])  # the number beside the longest bar
    steps = (1.0, 2.0, 5.0) if limits[1] - limits[0] < 4.0 else (1.0,)
    ticks = [step * 10.0**k for k in range(math.floor(limits[0]), math.ceil(limits[1]) + 1) for step in steps]
    figure.update_xaxes(type="log", range=limits, title_text=chart.x_label, gridcolor=_GRID, tickvals=ticks,
                        ticktext=[f"{tick:g}" for tick in ticks], tickangle=0)  # fmt: skip
    last = max((at for at, *_ in rows), default=0.0)
    figure.update_yaxes(tickvals=[at for at, *_ in rows], ticktext=[label for _, label, _, _ in rows],
                        range=[last + 0.8, -0.8], showgrid=False)  # fmt: skip
    legend = {"orientation": "h", "y": 1.0, "yanchor": "bottom"}
    figure.update_layout(barmode="overlay", height=140 + 20 * int(last + 1.0), legend=legend,
                         margin={"l": 190, "r": 20, "t": 60, "b": 50})  # fmt: skip
    return figure


def _grid(chart: Grid) -> Any:
    figure = go.Figure()
    ticks = np.geomspace(chart.low, chart.high, 4)
    scale = {"tickvals": [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0], "ticktext": [f"{tick:.2g}" for tick in ticks],
             "title": {"text": chart.colour_label, "side": "right"}}  # fmt: skip
    figure.add_trace(
        go.Heatmap(
            z=[_short(row) for row in chart.colours()], x=list(range(len(chart.columns))), y=list(range(len(chart.rows))),
            text=[list(row) for row in chart.texts], texttemplate="%{text}", colorscale="RdYlBu_r", zmin=0.0, zmax=1.0,
            colorbar=scale, hovertemplate="%{text}<extra></extra>", opacity=0.85,
        )
    )  # fmt: skip
    if chart.line is not None:
        words, x, y = chart.line
        figure.add_trace(
            go.Scatter(x=_short(x), y=_short(y), mode="lines", name=words, line={"color": "black", "dash": "dash"})
        )
    figure.update_xaxes(tickvals=list(range(len(chart.columns))), ticktext=list(chart.columns), title_text=chart.x_label,
                        range=[-0.5, len(chart.columns) - 0.5], showgrid=False)  # fmt: skip
    figure.update_yaxes(tickvals=list(range(len(chart.rows))), ticktext=list(chart.rows), title_text=chart.y_label,
                        range=[-0.5, len(chart.rows) - 0.5], showgrid=False)  # fmt: skip
    figure.update_layout(height=150 + 38 * len(chart.rows), showlegend=chart.line is not None,
                         legend={"orientation": "h", "y": 1.0, "yanchor": "bottom"},
                         margin={"l": 90, "r": 20, "t": 40, "b": 60})  # fmt: skip
    return figure


def _short(values: FloatArray) -> list[float | None]:
    """Four significant digits are more than a screen shows; nan is a gap."""
    return [float(f"{v:.4g}") if math.isfinite(v) else None for v in values.tolist()]
