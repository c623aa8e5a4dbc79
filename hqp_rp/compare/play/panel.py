"""What the panel says of one step, as HTML: a block for each level, in it a bar for each solver, on logarithmic scales."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence

from hqp_rp.compare.play.arm import ArmState
from hqp_rp.control.command import Mode

COLORS = ("#1f77b4", "#e8710a")
"""Of the arm and of its ghost."""

ERRORS, SIGMAS, SPEEDS = (1e-6, 1.0), (1e-6, 1.0), (1e-3, 1e3)
"""Where the bars of errors (m, rad), singular values and |v| (rad/s, m/s) begin and end."""

_WRONG = "#b71c1c"
_MOST_LIMITS = 4


def panel(levels: Sequence[str], arms: Sequence[ArmState], solvers: Sequence[str], driving: bool = False) -> str:
    """HTML of one step.

    Args:
        levels: (p) names. arms: what each solver did. solvers: what each is called. driving: as in `Step`.
    """
    parts = ['<div class="hqp-rp-panel" style="font: 12px/1.35 system-ui, sans-serif; padding: 0 0.75em">']
    for k, level in enumerate(levels):
        parts.append(
            _heading(f"{k + 1} {level}", _ranks([state.rank[k] for state in arms], [state.rows[k] for state in arms]))
        )
        parts += _bars("error", [float(state.error[k]) for state in arms], ERRORS)
        parts += _bars("&sigma;<sub>min</sub>", [float(state.sigma_min[k]) for state in arms], SIGMAS)
    parts.append(_heading("the answer", ""))
    parts += _bars("|v|", [state.speed for state in arms], SPEEDS)
    for color, state, solver in zip(COLORS, arms, solvers, strict=False):
        parts.append(f'<div style="margin-top: 0.7em; color: {color}; font-weight: 600">{html.escape(solver)}</div>')
        parts.append(_told(state, driving))
        parts.append(_limits(state))
    return "".join([*parts, "</div>"])


def _heading(name: str, right: str) -> str:
    return (
        '<div style="display: flex; justify-content: space-between; margin-top: 0.5em">'
        f"<b>{html.escape(name)}</b><span>{right}</span></div>"
    )


def _ranks(ranks: Sequence[float], rows: Sequence[float]) -> str:
    """What rank the level has beside those before it, once where the solvers agree."""
    known = [f"{rank:.0f} of {of:.0f}" for rank, of in zip(ranks, rows, strict=True) if not math.isnan(rank)]
    return f"rank {' | '.join(dict.fromkeys(known))}" if known else ""


def _told(state: ArmState, driving: bool) -> str:
    if driving:
        what = "Driven to a configuration."
    elif state.reason:
        what = state.reason
    else:
        what = state.status.capitalize().replace("_", " ")
        what += (
            "." if state.share == 1.0 else f"; moved at {100.0 * state.share:.3g} % of it, as fast as the joints go."
        )
    wrong = state.mode is not Mode.RUNNING and not driving
    style = f"color: {_WRONG}; font-weight: 600" if wrong else ""
    return f'<div style="min-height: 1.4em; {style}">{html.escape(what)}</div>'


def _limits(state: ArmState) -> str:
    count = len(state.limits)
    of = max(state.bounded, count)
    shown = html.escape("; ".join(state.limits[:_MOST_LIMITS]) + ("; ..." if count > _MOST_LIMITS else ""))
    row = _row("limits", count / of if of else 0.0, _WRONG, f"{count} of {of}" if of else "none")
    return f'{row}<div style="min-height: 1.4em; color: {_WRONG}">{shown}</div>'


def _bars(name: str, values: Iterable[float], scale: tuple[float, float]) -> list[str]:
    """A bar for each value, from scale[0] to scale[1]; empty for a value that is none."""
    rows = []
    for i, value in enumerate(values):
        text = "&ndash;" if math.isnan(value) else "&infin;" if math.isinf(value) else f"{value:.2e}"
        rows.append(_row("" if i else name, share(value, scale), COLORS[i], text))
    return rows


def share(value: float, scale: tuple[float, float]) -> float:
    """How much of a logarithmic bar is filled, in [0, 1]."""
    if math.isnan(value) or value <= scale[0]:
        return 0.0
    if value >= scale[1]:
        return 1.0
    return math.log(value / scale[0]) / math.log(scale[1] / scale[0])


def _row(name: str, filled: float, color: str, text: str) -> str:
    return (
        f'<div style="display: flex; gap: 0.5em; height: 1.25em"><span style="width: 3.2em">{name}</span>'
        '<span style="flex: 1; align-self: center; height: 0.65em; background: #8882">'
        f'<span style="display: block; height: 100%; width: {100.0 * filled:.1f}%; background: {color}"></span></span>'
        f'<span style="width: 5.2em; text-align: right; font-variant-numeric: tabular-nums">{text}</span></div>'
    )
