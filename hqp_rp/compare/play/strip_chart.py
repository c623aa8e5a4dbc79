"""A strip chart in the panel: one quantity of the last seconds, a curve for each level and solver."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from hqp_rp.compare.play.arm import ArmState
from hqp_rp.compare.play.panel import COLORS
from hqp_rp.core.problem import FloatArray

QUANTITIES = {
    "error": "log10 error (m, rad)",
    "sigma_min": "log10 sigma_min",
    "residual": "log10 residual of the answer",
    "speed": "log10 |v| (rad/s, m/s)",
}
"""Attribute of `ArmState` -> what the panel calls it."""

FLOOR = 1e-12  # a logarithm has no zero

LEVEL_COLORS = ("#7b3294", "#d62728", "#2ca02c", "#8c564b", "#17becf", "#e377c2", "#7f7f7f", "#bcbd22")
"""Apart from those of the solvers."""


class StripChart:
    """Keeps what was drawn in the last seconds, and draws it.

    Args:
        gui: `server.gui`. container: the tab or folder that it is in. levels: names. seconds: how far back it goes.
    """

    def __init__(self, gui: Any, container: Any, levels: Sequence[str], seconds: float = 15.0) -> None:
        self._gui, self._container = gui, container
        self._levels, self._seconds = tuple(levels), seconds
        self._kept: list[tuple[float, tuple[ArmState | None, ...]]] = []
        self._quantity, self._arms, self._chart = "error", 0, None
        with container:
            self._choice = gui.add_dropdown("quantity", tuple(QUANTITIES.values()), initial_value=QUANTITIES["error"])

    def add(self, time: float, arms: Sequence[ArmState | None]) -> None:
        """One point more; a time before the last one begins the chart anew."""
        if self._kept and time < self._kept[-1][0]:
            self._kept.clear()
        self._kept.append((time, tuple(arms)))
        while self._kept[0][0] < time - self._seconds:
            self._kept.pop(0)

    def draw(self) -> None:
        """Draw what is kept; a chart of other curves takes the place of the last one."""
        if not self._kept:
            return
        quantity = next(name for name, words in QUANTITIES.items() if words == self._choice.value)
        arms = max(len(states) for _, states in self._kept)
        data, labels, styles = self.curves(quantity)
        if self._chart is not None and (quantity, arms) == (self._quantity, self._arms):
            self._chart.data = data
            return
        chart = self._chart
        self._quantity, self._arms = quantity, arms
        series = ({"label": "t (s)"}, *(
            {"label": label, "stroke": color, "width": 2, "dash": dash}
            for label, (color, dash) in zip(labels, styles, strict=True)
        ))  # fmt: skip
        with self._container:
            self._chart = self._gui.add_uplot(
                data, series, scales={"x": {"time": False}}, height=230, legend={"show": True},
                axes=({"size": 30}, {"size": 52}), padding=(10, 20, 0, 0),
            )  # fmt: skip
        if chart is not None:
            chart.remove()

    def curves(self, quantity: str) -> tuple[tuple[FloatArray, ...], list[str], list[tuple[str, list[int]]]]:
        """Time and log10 of a curve for each level and arm, their labels, and (colour, dashes) of each."""
        arms = max(len(states) for _, states in self._kept)
        names = [""] if quantity == "speed" else [f"{k + 1} {name}" for k, name in enumerate(self._levels)]
        time = np.array([t for t, _ in self._kept])
        curves, labels, styles = [], [], []
        for arm in range(arms):
            for k, name in enumerate(names):
                values = [_value(states[arm] if arm < len(states) else None, quantity, k) for _, states in self._kept]
                curves.append(np.array(values))
                labels.append(f"{name}{' ghost' if arm else ''}".strip() or "arm")
                color = COLORS[arm] if quantity == "speed" else LEVEL_COLORS[k % len(LEVEL_COLORS)]
                styles.append((color, [6, 4] if arm else []))
        return (time, *curves), labels, styles


def _value(state: ArmState | None, quantity: str, level: int) -> float:
    """log10 of the value, which counts as `FLOOR` at least; nan where there is none."""
    if state is None:
        return math.nan
    found = state.speed if quantity == "speed" else float(getattr(state, quantity)[level])
    return math.log10(max(found, FLOOR)) if math.isfinite(found) else math.nan
