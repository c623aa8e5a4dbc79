"""How notebooks show a problem, a solution and a certificate: short tables in HTML, every word of a user escaped."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hqp_rp.core.certificate import Certificate
    from hqp_rp.core.problem import FloatArray, Problem
    from hqp_rp.core.solution import Solution

_MOST_ROWS = 30
_MOST_NUMBERS = 12


def table(caption: str, header: Sequence[str], rows: Iterable[Sequence[object]], note: str = "") -> str:
    """An HTML table; 30 rows at most, and how many more there are.

    Args:
        caption: above it, in bold. header: of the columns. rows: a cell for each column; numbers are written with 3 digits.
        note: below it.
    """
    cells = [[_cell(value) for value in row] for row in rows]
    left_out = len(cells) - _MOST_ROWS
    lines = [f"<div><b>{html.escape(caption)}</b>"]
    if cells:
        lines.append(
            f"<table><thead><tr>{''.join(f'<th>{html.escape(name)}</th>' for name in header)}</tr></thead><tbody>"
        )
        lines += [f"<tr>{''.join(row)}</tr>" for row in cells[:_MOST_ROWS]]
        lines.append("</tbody></table>")
    if left_out > 0:
        lines.append(f"<div>and {left_out} more</div>")
    if note:
        lines.append(f"<div>{html.escape(note)}</div>")
    return "".join([*lines, "</div>"])


def problem_html(problem: Problem) -> str:
    """Hard rows and levels: how many rows of each are equalities and bounds, and what damps them."""
    hard = problem.hard
    levels = [("hard", hard, None)] if hard is not None and hard.m else []
    damping = problem.damping or (None,) * problem.p
    levels += [(str(k + 1), level, damping[k]) for k, level in enumerate(problem.levels)]
    rows = []
    for number, level, policy in levels:
        equalities = int((level.lower == level.upper).sum())
        rows.append(
            (number, level.name, level.m, equalities, level.m - equalities, "" if policy is None else repr(policy))
        )
    metric = ", with a metric" if problem.metric is not None else ""
    caption = f"Problem: {problem.n} unknowns, {problem.p} levels{metric}"
    return table(caption, ("level", "name", "rows", "equalities", "two-sided", "damping"), rows)


def solution_html(solution: Solution) -> str:
    """The status, and residual, rank and sigma_min of each level where there is an x."""
    x = solution.x
    caption = f"{solution.status.name}: {solution.status.value} {solution.message}".rstrip()
    if x is None or not np.isfinite(x).all():
        return table(caption, (), ())
    rows = [
        (
            k + 1,
            level.name,
            level.residual,
            f"{level.rank} of {len(level.violation)}",
            level.sigma_min,
            level.singularity.name,
        )
        for k, level in enumerate(solution.levels)
    ]
    active = solution.active_rows
    held = f"; at a bound: {', '.join(active[:6])}{', ...' if len(active) > 6 else ''}" if active else ""
    note = f"|x| = {_number(float(np.linalg.norm(x)))}, x = {_vector(x)}{held}"
    return table(caption, ("level", "name", "residual", "rank", "sigma_min", "singularity"), rows, note)


def certificate_html(certificate: Certificate) -> str:
    """The verdict, and of each level the residual and how much of it could be avoided."""
    rows = [
        (k + 1, level.name, level.residual, level.excess, level.relative_excess, level.uncertainty, level.multipliers)
        for k, level in enumerate(certificate.levels)
    ]
    header = ("level", "name", "residual", "avoidable", "relative", "rounding explains", "held by rows")
    note = (
        f"hard rows violated by {_number(certificate.hard_violation)}; x nearer to least norm by "
        f"{_number(certificate.deviation)} at no level's cost; tolerance {_number(certificate.tolerance)}"
    )
    return table(certificate.sentence, header, rows, note)


def _cell(value: object) -> str:
    if isinstance(value, bool | str) or not isinstance(value, int | float | np.number):
        return f'<td style="text-align: left">{html.escape(str(value))}</td>'
    return f"<td>{value if isinstance(value, int) else _number(float(value))}</td>"


def _number(value: float) -> str:
    return "0" if value == 0.0 else f"{value:.3g}" if math.isfinite(value) else str(value)


def _vector(x: FloatArray) -> str:
    shown = ", ".join(_number(value) for value in x[:_MOST_NUMBERS].tolist())
    return f"[{shown}{f', ... {len(x)} numbers' if len(x) > _MOST_NUMBERS else ''}]"
