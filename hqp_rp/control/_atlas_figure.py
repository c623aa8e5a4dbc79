"""The atlas of singularities as a figure: one line for each configuration, over the joints, between their limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hqp_rp.control._coordinates import coordinate_index, joint_positions
from hqp_rp.core.extras import require

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hqp_rp.control.catalogue import Catalogue

_COLORS = ("#7b3294", "#d62728", "#2ca02c", "#8c564b", "#17becf", "#e377c2", "#7f7f7f", "#bcbd22")


def atlas_figure(catalogue: Catalogue) -> Figure:
    """`Catalogue.plot`. Raises `MissingExtraError` without matplotlib."""
    require("Catalogue.plot", "matplotlib")
    from matplotlib.figure import Figure

    robot = catalogue.robot
    index = coordinate_index(robot, "drawing an atlas")
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    groups = list(dict.fromkeys((place.level, place.name, place.kind) for place in catalogue))
    figure = Figure(figsize=(max(6.0, 0.55 * robot.nv + 2.0), 1.0 + 2.4 * max(len(groups), 1)), layout="constrained")
    axes = figure.subplots(max(len(groups), 1), 1, sharex=True, squeeze=False)[:, 0]
    for axis, color, (level, name, kind) in zip(axes, _cycled(len(groups)), groups, strict=False):
        places = catalogue.of(level, kind)
        for place in places:
            share = (joint_positions(place.q, index) - lower) / np.where(upper > lower, upper - lower, 1.0)
            axis.plot(np.arange(robot.nv), share, "o-", color=color, lw=1.0, ms=3.0, alpha=0.6)
        axis.set_title(f"{level + 1} {name}: {len(places)} {kind.name.lower()}", loc="left", fontsize="medium")
    for axis in axes:
        axis.set_ylim(-0.05, 1.05)
        axis.set_yticks([0.0, 0.5, 1.0], ["lower", "", "upper"])
        axis.grid(alpha=0.25)
    if not groups:
        axes[0].set_title("No singularity was found.", loc="left", fontsize="medium")
    names = robot.joint_names if len(robot.joint_names) == robot.nv else [str(i) for i in range(robot.nv)]
    axes[-1].set_xticks(np.arange(robot.nv), names, rotation=60, ha="right")
    return figure


def _cycled(count: int) -> list[str]:
    return [_COLORS[i % len(_COLORS)] for i in range(count)]
