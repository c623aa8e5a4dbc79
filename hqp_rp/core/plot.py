"""A solution as a figure: what each level misses and how near it is to a singularity, and the answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hqp_rp.core.extras import require

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hqp_rp.core.solution import Solution

_FLOOR = 1e-17


def solution_figure(solution: Solution) -> Figure:
    """`Solution.plot`. Raises `MissingExtraError` without matplotlib, `ValueError` where there is no x."""
    require("Solution.plot", "matplotlib")
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullLocator

    levels, x = solution.levels, solution.x
    assert x is not None  # levels has raised
    figure = Figure(figsize=(9.0, 1.6 + 0.5 * len(levels)), layout="constrained")
    left, middle, right = figure.subplots(1, 3, width_ratios=(2, 2, 3))
    places = np.arange(len(levels))
    names = [f"{k + 1} {level.name}\nrank {level.rank} of {len(level.violation)}" for k, level in enumerate(levels)]
    for axis, values, title in (
        (left, [level.residual for level in levels], "residual"),
        (middle, [level.sigma_min for level in levels], "$\\sigma_{min}$"),
    ):
        finite = np.array([value if np.isfinite(value) else np.nan for value in values])
        axis.barh(places, np.maximum(finite, _FLOOR), color="#1f77b4")
        axis.set_xscale("log")
        shown = np.maximum(finite[finite > 0.0], _FLOOR)
        least, most = (shown.min(), shown.max()) if len(shown) else (0.1, 1.0)
        axis.set_xlim(10.0 ** (np.floor(np.log10(least)) - 1.0), 10.0 ** np.ceil(np.log10(1.01 * most)))
        axis.set_yticks(places, names if axis is left else [""] * len(levels))
        axis.invert_yaxis()
        axis.set_title(title)
        axis.xaxis.set_major_locator(LogLocator(numticks=5))
        axis.xaxis.set_minor_locator(NullLocator())
        axis.grid(axis="x", alpha=0.25)
    right.bar(np.arange(len(x)), x, color="#1f77b4")
    right.axhline(0.0, color="0.4", lw=0.8)
    right.set_title(f"x, |x| = {np.linalg.norm(x):.3g}")
    right.set_xlabel("unknown")
    figure.suptitle(f"{solution.status.name}: {solution.status.value}", fontsize="medium")
    return figure
