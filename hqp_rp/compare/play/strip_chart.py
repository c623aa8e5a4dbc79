"""A strip chart in the panel: one quantity of the last seconds, a curve for each level and solver."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from hqp_rp.compare.play.arm import ArmState
from hqp_rp.core.problem import FloatArray

QUANTITIES = {
    "error": "error of each level (m, rad)",
    "sigma_min": "sigma_min of each level",
    "residual": "what the answer misses of each level",
    "speed": "|v| of the answer (rad/s, m/s)",
}
"""Attribute of `ArmState` -> what the panel calls it."""

FLOOR = 1e-12  # a logarithmic scale has no zero

LEVEL_COLORS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22")


class StripChart:
    """Keeps what was drawn in the last seconds, and draws it.

    Args:
        gui: `server.gui`, or whatever else adds to the panel. levels: names. seconds: how far back it goes.
    """

    def __init__(self, gui: Any, levels: Sequence[str], seconds: float = 15.0) -> None:
        self._gui, self._levels, self._seconds = gui, tuple(levels), seconds
        self._kept: list[tuple[float, tuple[ArmState | None, ...]]] = []
        self._quantity, self._arms, self._chart = "error", 0, None
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
            {"label": label, "stroke": color, "width": 2, "dash": dash} for label, (color, dash) in zip(labels, styles, strict=True)
        ))  # fmt: skip
        scales = {"x": {"time": False}, "y": {"distr": 3, "log": 10}}
        self._chart = self._gui.add_uplot(
            data, series, scales=scales, height=220, legend={"show": True}, order=self._choice.order + 0.5,
            axes=({"size": 30}, {"size": 52}),
        )  # fmt: skip
        if chart is not None:
            chart.remove()

    def curves(self, quantity: str) -> tuple[tuple[FloatArray, ...], list[str], list[tuple[str, list[int]]]]:
        """Time and a curve for each level and arm, their labels, and (colour, dashes) of each."""
        arms = max(len(states) for _, states in self._kept)
        names = [""] if quantity == "speed" else [f"{k + 1} {name}" for k, name in enumerate(self._levels)]
        time = np.array([t for t, _ in self._kept])
        curves, labels, styles = [], [], []
        for arm in range(arms):
            for k, name in enumerate(names):
                values = [_value(states[arm] if arm < len(states) else None, quantity, k) for _, states in self._kept]
                curves.append(np.array(values))
                labels.append(f"{name}{' ghost' if arm else ''}".strip() or "arm")
                styles.append((LEVEL_COLORS[(k if len(names) > 1 else arm) % len(LEVEL_COLORS)], [6, 4] if arm else []))
        return (time, *curves), labels, styles


def _value(state: ArmState | None, quantity: str, level: int) -> float:
    """The value on a logarithmic scale: at least `FLOOR`; nan where there is none."""
    if state is None:
        return math.nan
    found = state.speed if quantity == "speed" else float(getattr(state, quantity)[level])
    return max(found, FLOOR) if math.isfinite(found) else math.nan
