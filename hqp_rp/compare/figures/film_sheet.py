"""The picture of a film: for each shot a title, the arm, the force in figures and its curve; below all the time."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageFont

from hqp_rp.compare.figures.film_shot import Run
from hqp_rp.compare.figures.film_stage import ARROW, COLOURS, MOST, NEAR, WHOLE, Stage

COLUMN, HEAD, CURVE, FOOT = 420, 58, 180, 34
"""Pixels: the width of a shot, the heights of its title, its curve and of the line below all shots."""

_INK, _GREY, _RED = "#111111", "#6b6b6b", "#c00000"
_DPI = 100


class Sheet:
    """The picture of a film: what stays, drawn once, and the rest for every frame."""

    def __init__(self, runs: Sequence[Run], stages: Sequence[Stage], end: float) -> None:
        self._runs, self._stages, self._end = runs, stages, end
        size = (COLUMN * len(runs), HEAD + WHOLE[0] + CURVE + FOOT)
        self._base = Image.new("RGB", size, "white")
        draw = ImageDraw.Draw(self._base)
        for i, run in enumerate(runs):
            shot = run.shot
            name = type(shot.scenario).name.removeprefix("sawyer_").replace("_", " ")
            for words, y, largest, colour in (
                (shot.title or shot.contestant.label, 8, 22, _INK),
                (f"{shot.contestant.label}, " * bool(shot.title) + f"{name}: {shot.case.name}", 36, 14, _GREY),
            ):
                draw.text((COLUMN * i + 12, y), words, fill=colour, font=_fitting(words, largest))
        self._bare, self._full, self._left, self._right, self._rise = _curves(runs, end)

    def frame(self, time: float, shown: float) -> Image.Image:
        """The arms at a time, s, and the curves up to another."""
        sheet = self._base.copy()
        draw = ImageDraw.Draw(sheet)
        y = HEAD + WHOLE[0]
        sheet.paste(self._bare, (0, y))
        for i, (run, stage) in enumerate(zip(self._runs, self._stages, strict=True)):
            left, k = COLUMN * i, run.at(time)
            force = {axis: float(values[k]) for axis, values in run.force.items()}
            wish = {axis: float(values[k]) for axis, values in run.desired.items()}
            whole, near = map(Image.fromarray, stage.pictures(run.q[k], force, wish))
            sheet.paste(whole, (left + 4, HEAD))
            corner = (left + COLUMN - NEAR[1] - 8, HEAD + 4)
            sheet.paste(near, corner)
            draw.rectangle((corner[0] - 1, corner[1] - 1, corner[0] + NEAR[1], corner[1] + NEAR[0]), outline="#b0b0b0")
            self._tell(draw, (corner[0], corner[1] + NEAR[0] + 8), force, wish, self._stopped(run, time))
            until = left + self._across(shown)
            sheet.paste(self._full.crop((left, 0, until, CURVE)), (left, y))
            mark = left + self._across(time)
            draw.line([(mark, y + self._rise[0]), (mark, y + self._rise[1])], fill=_INK, width=2)
            if left:
                draw.line([(left, 0), (left, sheet.height - FOOT)], fill="#d0d0d0")
        self._foot(draw, time)
        return sheet

    def _across(self, time: float) -> int:
        return round(self._left + (self._right - self._left) * time / self._end)

    def _stopped(self, run: Run, time: float) -> str:
        last = float(run.time[-1])
        return "" if run.complete or time < last else f"stopped at {last:.2f} s"

    def _tell(
        self,
        draw: ImageDraw.ImageDraw,
        corner: tuple[int, int],
        force: Mapping[str, float],
        wish: Mapping[str, float],
        stopped: str,
    ) -> None:
        x, y = corner
        for axis, value in force.items():
            words, where = f"{value:.0f} N", f"on the wall in {axis}" if len(force) > 1 else "on the wall"
            draw.text((x, y), words, fill=COLOURS[axis], font=_font(30))
            beside = x + max(84, round(_font(30).getlength(words)) + 8)
            draw.text((beside, y + 2), where, fill=COLOURS[axis], font=_font(13))
            draw.text((beside, y + 17), f"desired {wish[axis]:.0f} N", fill=_GREY, font=_font(13))
            y += 38
        if stopped:
            draw.text((x, y), stopped, fill=_RED, font=_font(20))

    def _foot(self, draw: ImageDraw.ImageDraw, time: float) -> None:
        y = self._base.height - FOOT + 8
        draw.text((12, y), f"t = {time:.2f} s", fill=_INK, font=_font(18))
        words = f"arrow: force of the orange ball on the brown wall, 30 N = {3000 * ARROW:.0f} cm; grey: desired"
        draw.text((120, y + 3), words, fill=_GREY, font=_fitting(words, 15, self._base.width - 130))


def _curves(runs: Sequence[Run], end: float) -> tuple[Image.Image, Image.Image, float, float, tuple[int, int]]:
    """The charts without and with the measured curves, and where a column's axes begin and end: across, and from above."""
    width = COLUMN * len(runs)
    figure = Figure(figsize=(width / _DPI, CURVE / _DPI), facecolor="white")
    wish = max(float(values.max()) for run in runs for values in run.desired.values())
    most = max(float(values.max()) for run in runs for values in run.force.values())
    top = 1.12 * min(max(most, wish), MOST * wish)
    left, right, low, high = 52, COLUMN - 16, 38, CURVE - 24
    measured = []
    for i, run in enumerate(runs):
        axes = figure.add_axes(((COLUMN * i + left) / width, low / CURVE, (right - left) / width, (high - low) / CURVE))
        for axis, values in run.desired.items():
            label = "desired" if axis == next(iter(run.desired)) else "_"
            axes.plot(run.time, values, color="#a0a0a0", linewidth=3.0, label=label)
            label = f"measured in {axis}" if len(run.force) > 1 else "measured"
            measured += axes.plot(run.time, run.force[axis], color=COLOURS[axis], linewidth=1.6, label=label)
        axes.set_xlim(0.0, end)
        axes.set_ylim(min(0.0, -0.02 * top), top)
        axes.set_xlabel("time (s)", fontsize=8, labelpad=1.0)
        axes.set_ylabel("force (N)", fontsize=8)
        axes.tick_params(labelsize=8)
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), fontsize=8, frameon=False, ncols=3, borderpad=0.0)
        axes.spines[["top", "right"]].set_visible(False)
    pictures = []
    for visible in (False, True):
        for line in measured:
            line.set_visible(visible)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=_DPI)
        pictures.append(Image.open(buffer).convert("RGB"))
    return pictures[0], pictures[1], left, right, (CURVE - high, CURVE - low)


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size=size)


def _fitting(words: str, size: int, width: int = COLUMN - 24) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """The largest font up to a size in which the words are no wider than so many pixels, but a readable one."""
    while size > 11 and _font(size).getlength(words) > width:
        size -= 1
    return _font(size)
