"""The metric of a stack: the joint-space inertia, or weights by joint."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np

from hqp_rp.control.limit import checked_per_joint, per_joint
from hqp_rp.core.errors import SettingError
from hqp_rp.core.level import frozen
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

INERTIA = "inertia"
StackMetric: TypeAlias = str | Mapping[str, float] | FloatArray | None
"""What `Stack(metric=...)` takes."""


class MetricOnRobot:
    """W (nv, nv) of a stack on a robot, at its current configuration.

    Args:
        metric: "inertia", weights > 0 by joint name or pattern (1 for the others), (nv,) weights > 0, or None.

    Raises `SettingError` for anything else.
    """

    __slots__ = ("_given", "_kept", "_robot", "stated")

    def __init__(self, metric: StackMetric) -> None:
        self.stated = metric
        self._given: FloatArray | dict[str, float] | None = None
        self._robot: Robot | None = None
        self._kept: FloatArray | None = None
        if isinstance(metric, str):
            if metric != INERTIA:
                raise SettingError(f'metric is {metric!r}; give "inertia", weights by joint name, or None.')
        elif metric is not None:
            given = checked_per_joint(metric, "metric")
            weights = list(given.values()) if isinstance(given, dict) else given
            self._given = given
            if weights is not None and not np.isfinite(weights).all():
                raise SettingError(f"metric is {metric!r}; every weight must be finite and > 0.")

    @property
    def kind(self) -> str | None:
        """ "full" for a matrix that couples velocities, "diagonal", or None where the plain norm is meant."""
        return None if self.stated is None else "full" if isinstance(self.stated, str) else "diagonal"

    def on(self, robot: Robot) -> FloatArray | None:
        """W, or None where the plain norm is meant."""
        if self.stated is None:
            return None
        if self._given is None:
            return robot.mass_matrix()
        if robot is not self._robot:
            self._kept = frozen(np.diag(per_joint(self._given, np.ones(robot.nv), robot, "metric")))
            self._robot = robot
        return self._kept

    def __reduce__(self) -> tuple[object, ...]:
        return MetricOnRobot, (self.stated,)
