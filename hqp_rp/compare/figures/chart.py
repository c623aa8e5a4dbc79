"""Charts as data: what is drawn, without saying by what. `chart_png` and `chart_html` draw the same chart."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.problem import FloatArray

# Okabe and Ito's palette, which the common kinds of colour blindness can tell apart, without its yellow.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("solid", "dash", "dot")
LOWEST = 0.01
"""A log axis begins at this quantile: a path that starts at rest does not squeeze everything else."""


@dataclasses.dataclass(frozen=True, slots=True)
class Style:
    """How one contestant is drawn, in every chart: colour, dash, and a rank for the width of its line."""

    colour: str
    dash: str
    rank: int


def styles(groups: Sequence[Sequence[str]]) -> dict[str, Style]:
    """Label -> style: no colour twice in a group of up to seven, and no two contestants alike in colour and dash up to 21."""
    found: dict[str, Style] = {}
    for group in groups:
        for rank, label in enumerate(group):
            i = len(found)
            found[label] = Style(COLOURS[i % len(COLOURS)], DASHES[i // len(COLOURS) % len(DASHES)], rank)
    return found


@dataclasses.dataclass(frozen=True, slots=True)
class Line:
    """One contestant in one panel.

    x, y (N,); a band low, high (N,) around y where there is one; sure (N,) bool, False where rounding alone explains y
    (drawn pale), None when that is not known.
    """

    label: str
    x: FloatArray
    y: FloatArray
    low: FloatArray | None = None
    high: FloatArray | None = None
    sure: NDArray[np.bool_] | None = None

    def certain(self) -> FloatArray:
        """y with nan where it is not sure; a sure point keeps its neighbours, so that no single point is lost."""
        if self.sure is None:
            return self.y
        near = self.sure.copy()
        near[1:] |= self.sure[:-1]
        near[:-1] |= self.sure[1:]
        return np.where(near, self.y, np.nan)


@dataclasses.dataclass(frozen=True, slots=True)
class Lines:
    """A grid of panels: one column for each group of contestants, one row for each quantity; axes are shared.

    Attributes:
        name: file name without ending.
        title: one line. caption: what is drawn and how to read it.
        x_label: label of the abscissa; log_x, reverse_x: its axis (reversed: falling from left to right).
        columns: titles; rows: labels of the quantities; log_y: for each row.
        floor: for each row, what zero is drawn at on a log axis; ceiling: where its axis ends at most; reach: where it ends
            at least, empty for no such end.
        panels: panels[row][column], the lines of one panel.
        marks: abscissas where a thin vertical line stands, with its words.
    """

    name: str
    title: str
    caption: str
    x_label: str
    columns: tuple[str, ...]
    rows: tuple[str, ...]
    panels: tuple[tuple[tuple[Line, ...], ...], ...]
    log_x: bool = False
    reverse_x: bool = False
    log_y: tuple[bool, ...] = ()
    floor: tuple[float, ...] = ()
    ceiling: tuple[float, ...] = ()
    reach: tuple[float, ...] = ()
    marks: tuple[tuple[float, str], ...] = ()

    def limits(self, row: int) -> tuple[float, float]:
        """The y axis of a row: from the data of all its panels, within floor and ceiling."""
        values = np.concatenate([np.ravel(line.y) for panel in self.panels[row] for line in panel] or [np.zeros(0)])
        values = values[np.isfinite(values)]
        if not self.log_y[row]:
            if not values.size:
                return 0.0, 1.0
            room = 0.05 * (float(values.max() - values.min()) or 1.0)
            return float(values.min()) - room, float(values.max()) + room
        shown = np.clip(values, self.floor[row], self.ceiling[row])
        if not shown.size:
            return self.floor[row], self.ceiling[row]
        top = float(shown.max()) * 3.0
        return float(np.quantile(shown, LOWEST, method="lower")) / 3.0, max([top, *self.reach[row : row + 1]])

    @property
    def abscissas(self) -> tuple[float, float]:
        """The ends of what is drawn along x; on a log axis decimal logarithms, at least one apart."""
        x = np.concatenate([line.x for row in self.panels for lines in row for line in lines] or [np.zeros(0)])
        x = x[np.isfinite(x) & ((x > 0.0) | (not self.log_x))]
        if not x.size:
            return 0.0, 1.0
        low, high = float(x.min()), float(x.max())
        if self.log_x:
            low, high = float(np.log10(low)), float(np.log10(high))
            return low, max(high, low + 1.0)
        return low, high if high > low else low + 1.0

    def in_left_half(self, at: float) -> bool:
        """Whether this abscissa is in the left half of a panel."""
        return ((float(np.log10(at)) if self.log_x else at) < sum(self.abscissas) / 2.0) != self.reverse_x

    def drawn(self, row: int, y: FloatArray) -> FloatArray:
        """y as it is drawn: on a log axis, what is below the floor lies on it."""
        return np.maximum(y, self.floor[row]) if self.log_y[row] else y


@dataclasses.dataclass(frozen=True, slots=True)
class Dots:
    """A dot plot: one row for each contestant, one column for each case, a dot for each run and a larger one for the middle.

    Attributes:
        name, title, caption, x_label, log_x, reverse_x: as in `Lines`.
        columns: titles of the cases.
        groups: (title, labels) of the rows, from top to bottom.
        values: values[column][label] is (N,) one value for each run; nan stands for `absent`.
        absent: what a run without a value means ("never"); it is drawn beyond the end of the axis.
    """

    name: str
    title: str
    caption: str
    x_label: str
    columns: tuple[str, ...]
    groups: tuple[tuple[str, tuple[str, ...]], ...]
    values: tuple[dict[str, FloatArray], ...]
    absent: str = "never"
    log_x: bool = False
    reverse_x: bool = False

    @property
    def labels(self) -> list[str]:
        """The rows, from top to bottom."""
        return [label for _, labels in self.groups for label in labels]

    def place(self, values: FloatArray) -> FloatArray:
        """Where each value is drawn: nan goes to `absent_at`."""
        return np.where(np.isfinite(values), values, self.absent_at)

    def middle(self, values: FloatArray) -> float:
        """The median of the runs, where a run without a value counts as beyond the end; nan when it is one of those."""
        beyond = -np.inf if self.reverse_x else np.inf
        ordered = np.sort(np.where(np.isfinite(values), values, beyond))
        middle = float(ordered[len(ordered) // 2])
        return middle if np.isfinite(middle) else float("nan")

    @property
    def _range(self) -> tuple[float, float]:
        together = np.concatenate([v for column in self.values for v in column.values()] or [np.zeros(0)])
        together = together[np.isfinite(together)]
        if not together.size:
            return (0.1, 1.0) if self.log_x else (0.0, 1.0)
        return float(together.min()), float(together.max())

    @property
    def absent_at(self) -> float:
        """The abscissa that stands for `absent`, beyond the values, on the side where the path ends."""
        low, high = self._range
        if self.log_x:
            reach = max(high / low, 10.0) ** 0.15
            return float(low / reach if self.reverse_x else high * reach)
        reach = 0.15 * ((high - low) or 1.0)
        return low - reach if self.reverse_x else high + reach

    @property
    def absent_from(self) -> float:
        """Where the part of the axis that stands for `absent` begins."""
        near = self._range[0 if self.reverse_x else 1]
        return float(np.sqrt(near * self.absent_at)) if self.log_x else (near + self.absent_at) / 2.0

    @property
    def limits(self) -> tuple[float, float]:
        """The x axis from left to right, with room for `absent`."""
        low, high = self._range
        ends = (min(low, self.absent_at), max(high, self.absent_at))
        if self.log_x:
            reach = (ends[1] / ends[0]) ** 0.06
            left, right = ends[0] / reach, ends[1] * reach
        else:
            reach = 0.06 * ((ends[1] - ends[0]) or 1.0)
            left, right = ends[0] - reach, ends[1] + reach
        return (right, left) if self.reverse_x else (left, right)


@dataclasses.dataclass(frozen=True, slots=True)
class Bars:
    """Horizontal bars on a log axis, from 1: how many times one is another.

    Attributes:
        name, title, caption, x_label: as in `Lines`.
        groups: (title, bars) from top to bottom; a bar is (label, value, kind).
        kinds: what the kinds 0, 1, ... stand for; they have the colours of `COLOURS`, the last one is grey.
    """

    name: str
    title: str
    caption: str
    x_label: str
    groups: tuple[tuple[str, tuple[tuple[str, float, int], ...]], ...]
    kinds: tuple[str, ...]

    def colour(self, kind: int) -> str:
        """The colour of a kind."""
        return "#b0b0b0" if kind == len(self.kinds) - 1 else COLOURS[kind % len(COLOURS)]

    @staticmethod
    def written(value: float) -> str:
        """The number beside a bar: 0.0123, 4.56, 1170."""
        return f"{value:.3g}" if value < 1000.0 else f"{value:.0f}"

    def rows(self) -> list[tuple[float, str, float, int]]:
        """(height, label, value, kind), from top to bottom: one unit a bar, room for a title above each group."""
        rows, at = [], 0.0
        for _, bars in self.groups:
            at += 1.0
            for label, value, kind in bars:
                rows.append((at, label, value, kind))
                at += 1.0
            at += 0.4
        return rows

    def titles(self) -> list[tuple[float, str]]:
        """(height, title) of each group."""
        found, at = [], 0.0
        for title, bars in self.groups:
            found.append((at + 0.15, title))
            at += len(bars) + 1.4
        return found


@dataclasses.dataclass(frozen=True, slots=True)
class Grid:
    """A map: one coloured cell for each pair of settings, with its number in it.

    Attributes:
        name, title, caption, x_label: as in `Lines`. y_label: of the rows.
        columns, rows: the settings, in words, from left to right and from bottom to top.
        values: (rows, columns), nan for an empty cell. texts: likewise, what stands in the cell.
        low, high: the ends of the colour scale, which is logarithmic; both > 0. colour_label: what the colour is.
        line: (words, x, y) of a curve over the map, in places of cells counted from 0; None for none.
    """

    name: str
    title: str
    caption: str
    x_label: str
    y_label: str
    columns: tuple[str, ...]
    rows: tuple[str, ...]
    values: FloatArray
    texts: tuple[tuple[str, ...], ...]
    low: float
    high: float
    colour_label: str
    line: tuple[str, FloatArray, FloatArray] | None = None

    def colours(self) -> FloatArray:
        """(rows, columns) in [0, 1], nan for an empty cell."""
        places = np.log(np.clip(self.values, self.low, self.high) / self.low)
        coloured: FloatArray = places / np.log(self.high / self.low)
        return coloured


@dataclasses.dataclass(frozen=True, slots=True)
class Picture:
    """A picture that something else drew. name, title, caption: as in `Lines`. png: the file's bytes."""

    name: str
    title: str
    caption: str
    png: bytes


Chart = Lines | Dots | Bars | Grid | Picture


def thinned(y: FloatArray, points: int = 240) -> NDArray[np.int64]:
    """Indices of at most `points` of a long curve: of each stretch its largest and smallest y, so that no peak is lost."""
    if len(y) <= points:
        return np.arange(len(y))
    keep: set[int] = {0, len(y) - 1}
    for stretch in np.array_split(np.arange(len(y)), max(points // 2 - 1, 1)):
        values = y[stretch]
        if np.isfinite(values).any():
            keep |= {int(stretch[np.nanargmax(values)]), int(stretch[np.nanargmin(values)])}
        else:
            keep.add(int(stretch[0]))
    return np.array(sorted(keep))
