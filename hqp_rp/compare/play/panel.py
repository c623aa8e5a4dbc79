"""What the panel says of one step, as HTML: a column for each solver, a row for each level, bars on logarithmic scales."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

import numpy as np

from hqp_rp.compare.play.arm import ArmState
from hqp_rp.control.command import Mode

COLORS = ("#1f77b4", "#e8710a")
"""Of the arm and of its ghost."""

ERRORS, SIGMAS, SPEEDS = (1e-6, 1.0), (1e-6, 1.0), (1e-3, 1e3)
"""Where the bars of errors (m, rad), singular values and |v| (rad/s, m/s) begin and end."""

_MOST_LIMITS = 4


def panel(levels: Sequence[str], arms: Sequence[ArmState], solvers: Sequence[str], driving: bool = False) -> str:
    """HTML of one step.

    Args:
        levels: (p) names. arms: what each solver did. solvers: what each is called. driving: as in `Step`.
    """
    parts = ['<div class="hqp-rp-panel" style="font: 12px/1.35 system-ui, sans-serif; padding: 0 0.75em">']
    for color, state, solver in zip(COLORS, arms, solvers, strict=False):
        parts.append(_arm(levels, state, solver, color, driving))
    return "".join([*parts, "</div>"])


def _arm(levels: Sequence[str], state: ArmState, solver: str, color: str, driving: bool) -> str:
    parts = [f'<div style="margin: 0.4em 0 0.1em; color: {color}; font-weight: 600">{html.escape(solver)}</div>']
    for k, level in enumerate(levels):
        rank, rows = state.rank[k], state.rows[k]
        held = "" if math.isnan(rank) else f"rank {rank:.0f} of {rows:.0f}"
        parts.append(f'<div style="display: flex; justify-content: space-between"><b>{k + 1} {html.escape(level)}</b>'
                     f"<span>{held}</span></div>")  # fmt: skip
        parts.append(_bar("error", float(state.error[k]), ERRORS, color))
        parts.append(_bar("&sigma;<sub>min</sub>", float(state.sigma_min[k]), SIGMAS, "#2e7d32"))
    parts.append(_bar("|v|", state.speed, SPEEDS, color))
    moved = "" if state.share == 1.0 else f" Moved at {state.share:.2g} of it: the joints are no faster."
    what = "Driven to a configuration." if driving else state.reason or f"{state.status.lower()}.{moved}"
    weight = "600; color: #b71c1c" if state.mode is not Mode.RUNNING else "400"
    parts.append(f'<div style="font-weight: {weight}; min-height: 2.7em">{html.escape(what)}</div>')
    parts.append(_limits(state))
    return "".join(parts)


def _limits(state: ArmState) -> str:
    count = len(state.limits)
    of = max(state.bounded, count)
    shown = html.escape("; ".join(state.limits[:_MOST_LIMITS]) + ("; ..." if count > _MOST_LIMITS else ""))
    bar = _track(count / of if of else 0.0, "#b71c1c")
    figure = f"{count} of {of}" if of else "none"
    return (
        f'<div style="display: flex; gap: 0.5em"><span style="width: 4em">limits</span>{bar}'
        f'<span style="width: 5.5em; text-align: right">{figure}</span></div>'
        f'<div style="min-height: 2.7em; color: #b71c1c">{shown}</div>'
    )


def _bar(name: str, value: float, scale: tuple[float, float], color: str) -> str:
    """A bar from scale[0] to scale[1] on a logarithmic scale; nothing for a value that is none."""
    text = "&ndash;" if math.isnan(value) else "&infin;" if math.isinf(value) else f"{value:.2e}"
    return (
        f'<div style="display: flex; gap: 0.5em"><span style="width: 4em">{name}</span>{_track(share(value, scale), color)}'
        f'<span style="width: 5.5em; text-align: right; font-variant-numeric: tabular-nums">{text}</span></div>'
    )


def share(value: float, scale: tuple[float, float]) -> float:
    """How much of the bar is filled, in [0, 1]."""
    if math.isnan(value) or value <= scale[0]:
        return 0.0
    if value >= scale[1]:
        return 1.0
    return float(np.log(value / scale[0]) / np.log(scale[1] / scale[0]))


def _track(filled: float, color: str) -> str:
    return (
        '<span style="flex: 1; align-self: center; height: 0.6em; background: #8882">'
        f'<span style="display: block; height: 100%; width: {100.0 * filled:.1f}%; background: {color}"></span></span>'
    )
