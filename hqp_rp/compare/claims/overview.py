"""One picture of the whole: each claim with its verdict, its number, the conditions that decide, and a thumbnail."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Mapping, Sequence

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from hqp_rp.compare.claims.experiments import POSTURES
from hqp_rp.compare.claims.judges.criteria import FAILS
from hqp_rp.compare.claims.verdicts import DEPENDS, HOLDS, UNRULED, Verdict
from hqp_rp.compare.figures.chart import Chart, Grid, Lines, Picture, Style
from hqp_rp.compare.report.sentences import Sentences

say = Sentences(__file__)

_COLOURS = {HOLDS: "#0072B2", DEPENDS: "#E69F00", FAILS: "#D55E00", UNRULED: "#999999"}
_THUMBNAILS = {
    # claim -> chart, row and column of its panel
    "secondary never disturbs primary": ("wipe", 0, 0),
    "no algorithmic singularities": ("wipe", 2, 0),
    "tracks the alternating force": ("tracking", 0, 0),
    "F_x better than classical": ("corner", 0, 2),
    "close approach goes well": ("wall", 0, 0),
    "overwhelms classical impedance": ("sweep-wall", 0, 2),
    "30 N in the end, stable": ("delay-map-paper-30", 0, 0),
    "M_d and B_d adjust the response": ("wall", 0, 1),
    "(47) gives the desired impedance": ("push", 2, 0),
    "any number of strict levels": ("sweep-conflict", 2, 1),
    "primary kept in conflict": ("conflict", 0, 0),
    "hierarchy improves accuracy": ("conflict", 0, 2),
    "hybrid control with S": ("tilted-wipe", 1, 1),
}
_WIDTH, _ROW, _HEAD = 13.0, 0.9, 0.75  # inches
_SQUARE, _SQUARES = 0.19, 8.2
_IN_A_ROW = 12


def overview(verdicts: Sequence[Verdict], charts: Sequence[Chart], styles: Mapping[str, Style]) -> Picture:
    """The picture; thumbnails are taken from the charts that are there."""
    height = _HEAD + _ROW * len(verdicts) + 0.1
    figure = Figure(figsize=(_WIDTH, height), facecolor="white")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, _WIDTH)
    axes.set_ylim(height, 0.0)
    axes.axis("off")
    blues = colormaps["RdYlBu"]
    for x, words in ((0.15, "verdict"), (1.75, "claim of the paper, and the one number"), (_SQUARES, "conditions")):
        axes.text(x, _HEAD - 0.35, words, fontsize=10, fontweight="bold", color="#444444")
    axes.text(_SQUARES, _HEAD - 0.12, "a square each: holds in", fontsize=7.5, color="#666666")
    for k, words in enumerate(("none", "half", "all of the runs")):
        axes.add_patch(Rectangle((9.6 + 0.62 * k, _HEAD - 0.24), 0.13, 0.13, color=blues(0.1 + 0.4 * k)))
        axes.text(9.77 + 0.62 * k, _HEAD - 0.12, words, fontsize=7.5, color="#666666")
    by_name = {chart.name: chart for chart in charts}
    for i, verdict in enumerate(verdicts):
        top = _HEAD + _ROW * i
        axes.plot([0.1, _WIDTH - 0.1], [top, top], color="#dddddd", linewidth=0.8)
        colour = _COLOURS[verdict.word]
        axes.add_patch(Rectangle((0.15, top + 0.2), 1.4, 0.42, color=colour))
        axes.text(
            0.85, top + 0.42, verdict.word, fontsize=10.5, fontweight="bold", color="white", ha="center", va="center"
        )
        axes.text(1.75, top + 0.24, verdict.claim, fontsize=10, va="center")
        number = textwrap.shorten(verdict.number or verdict.why, 105, placeholder=" ...")
        axes.text(1.75, top + 0.47, number, fontsize=8.5, color="#222222", va="center")
        axes.text(1.75, top + 0.69, _conditions(verdict), fontsize=7.5, color="#666666", va="center")
        for k, outcome in enumerate(verdict.outcomes):
            place = _SQUARES + _SQUARE * (k % _IN_A_ROW), top + 0.16 + 0.24 * (k // _IN_A_ROW)
            axes.add_patch(Rectangle(place, _SQUARE - 0.03, _SQUARE - 0.03, color=blues(0.1 + 0.8 * outcome.passed)))
        name, r, c = _THUMBNAILS.get(verdict.name, ("", 0, 0))
        if name in by_name:
            box = (10.85 / _WIDTH, 1.0 - (top + _ROW - 0.06) / height, 1.9 / _WIDTH, (_ROW - 0.14) / height)
            _thumbnail(figure.add_axes(box), by_name[name], r, c, styles)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    return Picture(
        "overview",
        say("overview_title"),
        say("overview_caption", postures=POSTURES),
        buffer.getvalue(),
    )


def _conditions(verdict: Verdict) -> str:
    """Whether algebra has a say, where it holds and where it does not, as far as there is room."""
    parts = ["theorem below"] if verdict.proven else []
    for state, words in ((True, "holds"), (False, "does not")):
        own = [o.label for o in verdict.outcomes if o.holds is state]
        if own and verdict.word == DEPENDS:
            parts.append(f"{words}: " + textwrap.shorten("; ".join(own), 48, placeholder=" ..."))
    return "   |   ".join(parts)


def _thumbnail(axes: Axes, chart: Chart, r: int, c: int, styles: Mapping[str, Style]) -> None:
    axes.set_xticks([])
    axes.set_yticks([])
    for side in axes.spines.values():
        side.set_color("#bbbbbb")
    if isinstance(chart, Grid):
        axes.imshow(chart.colours(), origin="lower", aspect="auto", cmap="RdYlBu_r", vmin=0.0, vmax=1.0, alpha=0.85)
        if chart.line is not None:
            axes.plot(chart.line[1], chart.line[2], color="black", linewidth=1.0)
            axes.set_ylim(-0.5, len(chart.rows) - 0.5)
    elif isinstance(chart, Lines):
        for line in chart.panels[r][c]:
            axes.plot(line.x, chart.drawn(r, line.y), color=styles[line.label].colour, linewidth=1.1)
        if chart.log_x:
            axes.set_xscale("log")
        if chart.log_y[r]:
            axes.set_yscale("log")
        axes.minorticks_off()
        axes.set_xticks([])
        axes.set_yticks([])
        axes.text(
            0.02,
            0.95,
            chart.rows[r].split(" (")[0],
            transform=axes.transAxes,
            fontsize=6.5,
            bbox={"facecolor": "white", "alpha": 0.7, "pad": 0.5, "linewidth": 0},
            va="top",
            color="#666666",
        )
