"""Where the words of a drawn chart stand: on a page, asked of a browser, and in a figure, asked of matplotlib."""

from __future__ import annotations

import dataclasses
import html
import itertools
import json
import pathlib
import re
import shutil
import subprocess
from collections.abc import Sequence

from matplotlib.axis import Axis, Tick
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

_QUIET = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-sync",
)

# A headless window is never narrower than 500 pixels, a frame in it is as narrow as it is told to be.
_FRAMES = """<!DOCTYPE html><body><pre id="measured"></pre>
<script>
const measured = {};
window.addEventListener("message", (event) => {
  measured[event.data.width] = event.data.page;
  document.getElementById("measured").textContent = JSON.stringify(measured);
});
</script>
%s
</body>"""

_MEASURE = """<script>
const visible = (text) => text.textContent.trim() && !text.closest(".hoverlayer");
const box = (r) => [r.left, r.top, r.right, r.bottom];
window.addEventListener("load", () => setTimeout(() => parent.postMessage({
  width: window.innerWidth,
  page: {
    scrolls: document.documentElement.scrollWidth > window.innerWidth,
    charts: [...document.querySelectorAll(".js-plotly-plot")].map((plot) => ({
      name: plot.id,
      frame: box(plot.querySelector(".svg-container").getBoundingClientRect()),
      words: [...plot.querySelectorAll("svg.main-svg text")].filter(visible)
        .map((text) => [text.textContent.replaceAll("\\u200b", ""), ...box(text.getBoundingClientRect())])
        .concat([...plot.querySelectorAll(".modebar-group")].map((group) => ["buttons", ...box(group.getBoundingClientRect())]))
        .filter(([, left, , right]) => right > left),
    })),
  },
}, "*"), 1000));
</script></body>"""


@dataclasses.dataclass(frozen=True, slots=True)
class Word:
    """A piece of text and its box; y grows downwards on a page and upwards in a figure."""

    text: str
    left: float
    low: float
    right: float
    high: float

    def overlaps(self, other: Word, slack: float) -> bool:
        """Whether more than `slack` pixels are shared both ways."""
        across = min(self.right, other.right) - max(self.left, other.left)
        along = min(self.high, other.high) - max(self.low, other.low)
        return across > slack and along > slack

    def within(self, frame: Word, slack: float) -> bool:
        """Whether nothing of it stands outside the frame."""
        return (
            self.left > frame.left - slack
            and self.low > frame.low - slack
            and self.right < frame.right + slack
            and self.high < frame.high + slack
        )


@dataclasses.dataclass(frozen=True, slots=True)
class Drawn:
    """The words of one chart as it was drawn, in pixels, and the frame that they must stay in."""

    name: str
    frame: Word
    words: tuple[Word, ...]

    def faults(self, slack: float = 1.0) -> list[str]:
        """Which words overlap, and which are cut off."""
        pairs = [(a, b) for a, b in itertools.combinations(self.words, 2) if a.overlaps(b, slack)]
        cut = [word for word in self.words if not word.within(self.frame, slack)]
        return [f"{a.text!r} on {b.text!r}" for a, b in pairs] + [f"{word.text!r} is cut off" for word in cut]


@dataclasses.dataclass(frozen=True, slots=True)
class Page:
    """A page at one width: its charts, and whether all of it scrolls sideways."""

    charts: tuple[Drawn, ...]
    scrolls: bool


def _dumped(page: pathlib.Path, profile: pathlib.Path) -> subprocess.CompletedProcess[str]:
    """What a browser makes of the page."""
    command = [str(CHROMIUM), *_QUIET, f"--user-data-dir={profile}", "--window-size=1400,900"]
    command += ["--virtual-time-budget=15000", "--dump-dom", page.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def on_page(page: pathlib.Path, widths: Sequence[int], folder: pathlib.Path) -> dict[int, Page]:
    """The page as a browser lays it out at each of the widths; `folder` is where the browser may write."""
    measuring = folder / "measuring.html"
    measuring.write_text(page.read_text(encoding="utf-8").replace("</body>", _MEASURE), encoding="utf-8")
    frames = [f'<iframe src="measuring.html" width="{w}" height="900" style="border: 0"></iframe>' for w in widths]
    (folder / "frames.html").write_text(_FRAMES % "\n".join(frames), encoding="utf-8")
    try:
        done = _dumped(folder / "frames.html", folder / "first profile")
    except subprocess.TimeoutExpired:  # Chromium hangs at times on a machine that does much else
        done = _dumped(folder / "frames.html", folder / "second profile")
    told = re.search(r'<pre id="measured">(.+?)</pre>', done.stdout, re.DOTALL)
    assert told, done.stderr
    found = json.loads(html.unescape(told[1]))
    return {
        int(width): Page(
            tuple(
                Drawn(chart["name"], Word("", *chart["frame"]), tuple(Word(*word) for word in chart["words"]))
                for chart in page["charts"]
            ),
            page["scrolls"],
        )
        for width, page in found.items()
    }


def in_figure(figure: Figure) -> Drawn:
    """The figure as matplotlib draws it."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    beyond = {
        label for axis in _axes(figure) for tick in _ticks(axis, beyond=True) for label in (tick.label1, tick.label2)
    }
    texts = [text for text in figure.findobj(Text) if isinstance(text, Text) and text not in beyond]
    shown = [text for text in texts if text.get_visible() and text.get_text().strip()]
    boxes = [text.get_window_extent(canvas.get_renderer()) for text in shown]
    words = tuple(Word(text.get_text(), *box.extents) for text, box in zip(shown, boxes, strict=True))
    return Drawn("", Word("", *figure.bbox.extents), words)


def tick_labels(figure: Figure) -> list[list[str]]:
    """For each axis that shows its numbers, those numbers."""
    FigureCanvasAgg(figure).draw()
    found = []
    for axis in _axes(figure):
        labels = [tick.label1 for tick in _ticks(axis, beyond=False)]
        if not labels or any(label.get_visible() for label in labels):
            found.append([label.get_text() for label in labels])
    return found


def _axes(figure: Figure) -> list[Axis]:
    return [axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]


def _ticks(axis: Axis, *, beyond: bool) -> list[Tick]:
    low, high = sorted(axis.get_view_interval())
    ticks = (*axis.get_major_ticks(), *axis.get_minor_ticks())
    return [tick for tick in ticks if (not low <= tick.get_loc() <= high) == beyond]
