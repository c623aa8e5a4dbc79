"""What a run says about a law: how far a pushed tool is from the ideal, and gain and lag of a tracked force."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import polars as pl

from hqp_rp.control._checks import TWIST_AXES
from hqp_rp.core.problem import FloatArray

_TRANSIENT = 0.2  # s


def push_figures(steps: pl.DataFrame) -> dict[str, float]:
    """For each axis A: "off A", the largest |deviation - ideal| over the largest |ideal|; "moved A", the largest |deviation|.

    "translation" and "rotation" are the worst of three.
    """
    found: dict[str, float] = {}
    for axis in TWIST_AXES:
        deviation, ideal = (steps[f"{what} {axis}"].to_numpy() for what in ("deviation", "ideal"))
        found[f"off {axis}"] = float(np.abs(deviation - ideal).max() / np.abs(ideal).max())
        found[f"moved {axis}"] = float(np.abs(deviation).max())
    for what, axes in (("translation", TWIST_AXES[:3]), ("rotation", TWIST_AXES[3:])):
        found[what] = max(found[f"off {axis}"] for axis in axes)
    return found


def tracking_figures(
    time: FloatArray, force: FloatArray, frequencies: Sequence[float], amplitude: float
) -> list[tuple[float, float]]:
    """Gain (1: as desired) and lag in s of each frequency in `force`, Hz, by one least-squares fit of all of them.

    Over the last whole number of periods of the lowest one in `time` (s), but for the first 0.2 s; the desired force is the
    sum of amplitude sin(2 pi f t), N.
    """
    w, longest = 2.0 * math.pi * np.array(frequencies), 1.0 / min(frequencies)
    step = float(time[1] - time[0])
    count = math.floor((float(time[-1] - time[0]) - _TRANSIENT) / longest) * longest
    last = time > time[-1] - count + 0.5 * step
    t = time[last] + step  # a row's force is that of the end of its period
    phase = w * t[:, None]
    A = np.concatenate((np.ones((len(t), 1)), np.sin(phase), np.cos(phase)), axis=1)
    _, *parts = np.linalg.lstsq(A, force[last], rcond=None)[0]
    in_phase, quadrature = np.array(parts).reshape(2, -1)
    return [
        (float(math.hypot(s, c) / amplitude), float(math.atan2(-c, s) / f))
        for s, c, f in zip(in_phase.tolist(), quadrature.tolist(), w.tolist(), strict=True)
    ]
