"""Angles that look like degrees where radians are meant."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core.warned import warn

TURN = 2.0 * math.pi


def warn_of_degrees(what: str, names: Sequence[str], angles: ArrayLike) -> None:
    """Say, in one warning, that finite angles of more than a turn either way look like degrees.

    Args:
        what: that holds them, as the beginning of a sentence. names: one for each angle.
        angles: (k,) rad.
    """
    given = np.asarray(angles, dtype=np.float64)
    found = np.flatnonzero(np.isfinite(given) & (np.abs(given) > TURN))
    if found.size:
        i = int(found[0])
        more = "" if found.size == 1 else f", and {found.size - 1} more like it"
        warn(
            f"{what} has {names[i]} = {given[i]:g} rad, {abs(given[i]) / TURN:.1f} turns{more}: are these degrees? Angles are "
            "in radians; np.radians(...) converts them."
        )
