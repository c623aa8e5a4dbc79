"""Hard joint limits that look ahead to no brakes, beside torques that have limits: what can contradict each other for good."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from typing import Any

from hqp_rp.control._row_names import velocity_names
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.core.problem import IntArray
from hqp_rp.robot.robot import Robot

_NAMED = 4


def at_once(limits: Iterable[Any]) -> JointLimit | None:
    """The first of these limits that asks a joint to stop, or to come back, within one step; None where none does."""
    return next((limit for limit in limits if isinstance(limit, JointLimit) and limit.stops_at_once), None)


def at_once_on(limits: Iterable[Any], robot: Robot, limited: IntArray) -> tuple[JointLimit, list[str]] | None:
    """The first such limit on this robot and the joints, of those with a torque limit, that it asks so; None for none."""
    names = velocity_names(robot)
    torques = set(limited.tolist())
    for limit in limits:
        if isinstance(limit, JointLimit):
            joints = [names[i] for i in limit.stopped_at_once(robot) if i in torques]
            if joints:
                return limit, joints
    return None


def warn_of_brakes(limit: JointLimit, joints: Sequence[str] = (), *, stacklevel: int) -> None:
    """Say that this limit asks more than limited torques may give; joints: whose, where that is known."""
    whose = "joints"
    if joints:
        whose = ", ".join(map(repr, joints[:_NAMED])) + (
            f" and {len(joints) - _NAMED} more" if len(joints) > _NAMED else ""
        )
    warnings.warn(
        f"{limit.name!r} asks {whose} to stop at a position limit, or to come back to it, within one step, and their torques "
        "are limited: where they cannot, the problem is INFEASIBLE at every step, at rest too. Give "
        "JointLimit(acceleration=...) what the torques can deliver, or list it as the first level.",
        UserWarning,
        stacklevel=stacklevel + 1,
    )
