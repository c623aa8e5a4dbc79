"""How a loop keeps pace with the clock."""

from __future__ import annotations

import math

MOST_STEPS = 20
"""Of one frame: a loop that cannot keep up runs slower, and does not fall behind."""


class Pace:
    """Counts the control periods that are due at each frame. ::

        pace = Pace(dt=0.01, now=time.monotonic())
        for _ in range(pace.due(time.monotonic())):
            loop.step()

    Over time as many as fit into the time that passed; after a frame of more than `most` of them, those beyond are left out.

    Args:
        dt: > 0, s, the control period. now: s, of any clock that does not go back. most: of one frame.
    """

    def __init__(self, dt: float, now: float, most: int = MOST_STEPS) -> None:
        self._dt, self._last, self._most, self._behind = dt, now, most, 0.0

    def due(self, now: float, *, running: bool = True) -> int:
        """How many periods are due at `now`, s of the same clock; none where time stands still (running False)."""
        passed, self._last = now - self._last, now
        if not running:
            return 0
        behind = min(self._behind + passed, self._most * self._dt)
        steps = math.floor(behind / self._dt + 1e-9)  # 3 * 0.1 is 3 periods
        self._behind = behind - steps * self._dt
        return steps
