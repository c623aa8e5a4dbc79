"""One picture of all passages: which method keeps level 1, which keeps level 2, which stays bounded."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.figures.chart import Picture
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.statistics.arms import arm_named
from hqp_rp.compare.statistics.settings import FACTOR
from hqp_rp.compare.statistics.verdicts import (
    BOUNDED,
    KEPT_FIRST,
    KEPT_SECOND,
    NO,
    PARTLY,
    QUESTIONS,
    YES,
    Result,
)
from hqp_rp.core.variant import GROUPS

say = Sentences(__file__)

NAME = "passages"
_COLUMNS = (
    (QUESTIONS[0], "error_1", "level 1: largest error\nof a path, share of what is asked", KEPT_FIRST, (1e-16, 3.0)),
    (QUESTIONS[1], "error_2_far", "level 2: the same,\nfar from the singularity", KEPT_SECOND, (1e-16, 30.0)),
    (QUESTIONS[2], "growth", "largest ||x|| of a path,\nof what is needed far away", BOUNDED, (1e-2, 1e6)),
)
_GROUND = {YES: "#cfe6f5", PARTLY: "#f3f3f3", NO: "#fbdcc4"}
_HEAD, _ROW, _FOOT = 0.55, 0.27, 1.0  # inches
_ARMS = (("o", "#0072B2"), ("^", "#009E73"), ("s", "#CC79A7"))


def picture(found: Sequence[Result], contestants: Sequence[Contestant]) -> Picture:
    """A row for each contestant, a column for each of `QUESTIONS`, a mark for each arm."""
    arms = list(dict.fromkeys(result.arm for result in found))
    rows = _rows(contestants)
    by_key = {(result.contestant, result.arm): result for result in found}
    height = _HEAD + _ROW * len(rows) + _FOOT
    figure = Figure(figsize=(12.0, height), facecolor="white")
    axes = figure.subplots(1, len(_COLUMNS), sharey=True)
    for ax, (question, quantity, title, threshold, ends) in zip(axes, _COLUMNS, strict=True):
        _column(ax, rows, arms, by_key, question, quantity, threshold, ends)
        ax.set_title(title, fontsize=9.5)
    axes[0].set_yticks([i for i, row in enumerate(rows) if row], [row for row in rows if row], fontsize=9)
    axes[0].set_ylim(len(rows) - 0.5, -0.5)
    marks = [
        Line2D([], [], marker=_ARMS[k % 3][0], color=_ARMS[k % 3][1], markersize=5, label=arm_named(arm).title)
        for k, arm in enumerate(arms)
    ]
    grounds = [Rectangle((0, 0), 1, 1, color=_GROUND[word], label=f"{_words(word)}") for word in (YES, PARTLY, NO)]
    star = Line2D([], [], marker="$*$", linestyle="", color="black", label=say("star"))
    figure.legend(handles=[*marks, *grounds, star], loc="lower center", ncols=4, fontsize=8.5, frameon=False)
    figure.subplots_adjust(left=0.165, right=0.985, top=1.0 - _HEAD / height, bottom=_FOOT / height, wspace=0.06)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=120, metadata={"Software": None})
    return Picture(
        NAME,
        say("picture_title"),
        say("picture_caption", factor=FACTOR),
        buffer.getvalue(),
    )


def _rows(contestants: Sequence[Contestant]) -> list[str]:
    """Labels from top to bottom, an empty one between groups."""
    rows: list[str] = []
    for group in GROUPS:
        labels = [contestant.label for contestant in contestants if contestant.group == group]
        if labels:
            rows += [*([""] if rows else []), *labels]
    return rows


def _column(
    ax: Axes,
    rows: Sequence[str],
    arms: Sequence[str],
    by_key: dict[tuple[str, str], Result],
    question: str,
    quantity: str,
    threshold: float,
    ends: tuple[float, float],
) -> None:
    ax.set_xscale("log")
    ax.set_xlim(*ends)
    ax.axvline(threshold, color="black", linestyle=":", linewidth=1.0)
    ax.grid(axis="x", color="#e5e5e5", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.tick_params(axis="x", labelsize=8)
    ax.tick_params(axis="y", length=0)
    for i, label in enumerate(rows):
        own = [by_key[label, arm] for arm in arms if (label, arm) in by_key]
        if not own:
            continue
        verdicts = [result.verdicts[question] for result in own]
        worst = max((verdict.word for verdict in verdicts), key=(YES, PARTLY, NO).index)
        ax.axhspan(i - 0.5, i + 0.5, color=_GROUND[worst], zorder=0)
        if any(verdict.hangs_on for verdict in verdicts):
            ax.annotate("*", (1.0, i), (-8, -5), ("axes fraction", "data"), textcoords="offset points", fontsize=11)
        for result in own:
            k = arms.index(result.arm)
            spread = result.spreads[quantity]
            y = i + 0.26 * (k - 0.5 * (len(arms) - 1))
            low, middle, high = np.clip([spread.q05, spread.median, spread.q95], *ends)
            marker, colour = _ARMS[k % 3]
            ax.plot([low, high], [y, y], color=colour, linewidth=1.2, solid_capstyle="butt")
            ax.plot(middle, y, marker=marker, color=colour, markersize=4.2, markeredgewidth=0.0)


def _words(word: str) -> str:
    return {YES: "yes, on every arm", PARTLY: "on some of an arm's paths", NO: "no, on an arm"}[word]
