"""A recorded run as a figure for a report: errors, singular values, |v| and limits over time."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hqp_rp.compare.play.panel import COLORS
from hqp_rp.compare.play.recording import Recording
from hqp_rp.compare.play.strip_chart import FLOOR, LEVEL_COLORS
from hqp_rp.control.command import Mode
from hqp_rp.core.extras import require

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DASHES = ("-", "--")
_RUNNING = list(Mode).index(Mode.RUNNING)


def figure_of(recording: Recording) -> Figure:
    """Four panels over time: the error and sigma_min of each level, |v| of the answer, and how many rows are at a bound.

    A colour for each level, full lines for the arm and dashed ones for its ghost. Grey: driven to a configuration. Red: no
    answer came, and the robot braked. A vertical line: another solver from there on, or another damping.

    Raises `MissingExtraError` without matplotlib.
    """
    require("A figure", "matplotlib")
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.ticker import MaxNLocator

    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    axes = figure.subplots(4, 1, sharex=True, height_ratios=(3, 3, 2, 1))
    time, arms = recording.time, range(recording.arms)
    for axis, name, label in (
        (axes[0], "error", "error of each level\n(m, rad)"),
        (axes[1], "sigma_min", "$\\sigma_{min}$ of each level"),
    ):
        values = getattr(recording, name)
        for arm, k in itertools.product(arms, range(len(recording.levels))):
            axis.plot(time, _positive(values[:, arm, k]), _DASHES[arm], color=_color(k), lw=1.4)
        axis.set_ylabel(label)
        axis.set_yscale("log")
    for arm in arms:
        axes[2].plot(time, _positive(recording.speed[:, arm]), _DASHES[arm], color=COLORS[arm], lw=1.4)
        axes[3].step(time, _limits(recording, arm), _DASHES[arm], color=COLORS[arm], lw=1.4, where="post")
    axes[2].set_yscale("log")
    axes[2].set_ylabel("|v| asked\n(rad/s, m/s)")
    axes[3].set_ylabel("rows at\na bound")
    most = max((np.nanmax(_limits(recording, arm)) for arm in arms), default=0.0)
    axes[3].set_ylim(0.0, 1.1 * max(float(most), 1.0))
    axes[3].yaxis.set_major_locator(MaxNLocator(nbins=4, integer=True))
    axes[3].set_xlabel("time (s)")
    for axis in axes:
        axis.grid(alpha=0.25)
        axis.set_xlim(time[0], time[-1] + recording.dt)
        for begin, end in _spans(recording.driving):
            axis.axvspan(time[begin], time[end - 1] + recording.dt, color="0.5", alpha=0.15, lw=0)
        for arm in arms:
            failed = (recording.mode[:, arm] >= 0) & (recording.mode[:, arm] != _RUNNING) & ~recording.driving
            for begin, end in _spans(failed):
                axis.axvspan(time[begin], time[end - 1] + recording.dt, color="#b71c1c", alpha=0.15, lw=0)
            for step in _changes(recording, arm):
                axis.axvline(time[step], color=COLORS[arm], lw=1.0, ls=":")
    handles: list[Any] = [Line2D([], [], color=_color(k)) for k in range(len(recording.levels))]
    labels = [f"{k + 1} {name}" for k, name in enumerate(recording.levels)]
    for arm in arms:
        handles.append(Line2D([], [], color=COLORS[arm], ls=_DASHES[arm]))
        labels.append(f"{'ghost' if arm else 'arm'}: {_solvers(recording, arm)}")
    figure.legend(handles, labels, loc="outside upper left", ncols=2, fontsize="small", frameon=False)
    return figure


def _color(level: int) -> str:
    return LEVEL_COLORS[level % len(LEVEL_COLORS)]


def _positive(values: Any) -> Any:
    """What a logarithmic axis can show: at least `FLOOR`, infinities left out."""
    return np.where(np.isfinite(values), np.maximum(values, FLOOR), np.nan)


def _limits(recording: Recording, arm: int) -> NDArray[np.float64]:
    counts = np.array([len(word.split("; ")) if word else 0 for word in recording.words], dtype=np.float64)
    return np.where(recording.mode[:, arm] >= 0, counts[recording.limits[:, arm]], np.nan)


def _spans(chosen: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(begin, end) of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], chosen, [False])).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _there(recording: Recording, arm: int) -> NDArray[np.int64]:
    return np.flatnonzero(recording.mode[:, arm] >= 0)


def _changes(recording: Recording, arm: int) -> list[int]:
    """The steps at which this arm's solver is another than before."""
    steps = _there(recording, arm)
    names = recording.solver[steps, arm]
    return [int(step) for step in steps[1:][names[1:] != names[:-1]]]


def _solvers(recording: Recording, arm: int) -> str:
    """The solvers in their order."""
    steps = [*_there(recording, arm)[:1], *_changes(recording, arm)]
    names = [recording.solver_of(int(step), arm) for step in steps]
    return ", then ".join(names if len(names) <= 3 else [*names[:2], "...", names[-1]])
