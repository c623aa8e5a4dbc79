"""The limit protocol, and the plain limit on joint velocities."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import is_pattern, joint_indices, real_array
from hqp_rp.control._native_rows import Layout, NativeLimit
from hqp_rp.control._row_names import velocity_names
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.row_kinds import BOX
from hqp_rp.robot.robot import Robot

PerJoint: TypeAlias = ArrayLike | Mapping[str, float] | None


@runtime_checkable
class Limit(Protocol):
    """Two-sided rows `lower <= G v <= upper` on the robot's velocity v (nv,) during the next dt seconds.

    In a stack a limit is hard (`Stack(limits=[...])`) or soft at the level it is listed in. Anything with a `name` and a
    `rows` is a limit; one that also has `frames` has them checked when a stack first meets a robot, and the rows of one that
    has `row_names(robot)`, a string for each row, go by these names in `Solution.conflict`, with the unit that its attribute
    `row_unit` says, such as "m/s", or its `row_units(robot)` of each. An `AccelerationStack` takes times dt the rows of one
    whose attribute `bounds_accelerations` is true, as that of `TorqueLimit`.
    """

    @property
    def name(self) -> str:
        """What levels, reports and errors call the limit."""
        ...

    def rows(self, robot: Robot, dt: float, v: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """G (m, nv), lower (m,) and upper (m,), lower <= upper, infinite for none, at the current configuration.

        Args:
            robot: at its current configuration.
            dt: > 0, s, for how long the velocity will be held.
            v: (nv,) the velocity before this step, or None when nobody told; a limit that needs it raises `SettingError`.
        """
        ...


class VelocityLimit(NativeLimit):
    """`-limit <= v <= limit` for every velocity.

    Args:
        limit: rad/s or m/s, > 0: one number, (nv,) numbers (infinite for none), a mapping from joint name or pattern
            ("left_*") to number (the robot's own limit for the others), or None for the robot's own limits.
        name: default "joint velocity".

    Raises:
        SettingError: a limit that is not > 0.
        RobotError: when it meets a robot that it does not fit, or one without any velocity limit and none is given.
    """

    __slots__ = ("_limit", "_name")

    def __init__(self, limit: PerJoint = None, *, name: str = "joint velocity") -> None:
        self._name = name
        self._limit = checked_per_joint(limit, f"the limit of {name!r}")
        self._alone = self._packed = None

    @property
    def name(self) -> str:
        """What levels, reports and errors call the limit."""
        return self._name

    def row_names(self, robot: Robot) -> list[str]:
        """The joints, one for each velocity."""
        return velocity_names(robot)

    def bounded_speeds(self, robot: Robot) -> list[str]:
        """The joints whose velocity is bounded on this robot."""
        limit, names = (
            per_joint(self._limit, robot.velocity_limit, robot, f"limit {self._name!r}"),
            velocity_names(robot),
        )
        return [names[i] for i in np.flatnonzero(limit < np.inf)]

    def bound_causes(
        self, robot: Robot, dt: float, v: FloatArray | None, lower: FloatArray, upper: FloatArray
    ) -> list[tuple[str, str]]:
        """What made lower (nv,) and upper (nv,): the velocity limit, where there is one."""
        return [
            tuple(f"velocity limit {abs(bound):.3g}" if np.isfinite(bound) else "" for bound in pair)  # type: ignore[misc]
            for pair in zip(lower, upper, strict=True)
        ]

    def _layout(self, robot: Robot) -> Layout:
        return Layout(BOX, robot.nv, [-1] * robot.nv)

    def _numbers(self, robot: Robot, layout: Layout) -> FloatArray:
        limit = per_joint(self._limit, robot.velocity_limit, robot, f"limit {self._name!r}")
        if not np.isfinite(limit).any():
            raise RobotError(f"limit {self._name!r}: the robot has no velocity limit and none is given; give `limit`.")
        unlimited = np.full(robot.nv, np.inf)
        return np.concatenate(([0.0], -unlimited, unlimited, limit, unlimited))

    def __repr__(self) -> str:
        return f"VelocityLimit({self._name!r})"


def checked_per_joint(value: PerJoint, what: str) -> FloatArray | dict[str, float] | None:
    """`value` as an array of positive numbers, a dictionary of them, or None."""
    if value is None:
        return None
    if isinstance(value, Mapping):
        for joint, number in value.items():
            if not isinstance(number, int | float | np.number) or not float(number) > 0.0:
                raise SettingError(f"{what}: {joint!r} has {number!r}; it must be a number > 0.")
        return {str(joint): float(number) for joint, number in value.items()}
    array = real_array(value, what)
    if array.ndim > 1 or not (array > 0.0).all():
        raise SettingError(f"{what} is {array.tolist()}; it must be > 0: one number, or one for each velocity.")
    return array


def per_joint(value: FloatArray | dict[str, float] | None, default: FloatArray, robot: Robot, owner: str) -> FloatArray:
    """(nv,) numbers for this robot from what `checked_per_joint` returned, `default` (nv,) where none is given."""
    if value is None:
        return np.array(default, dtype=np.float64)
    if isinstance(value, dict):
        result = np.array(default, dtype=np.float64)
        # A name outweighs a pattern that it matches too.
        for joint, number in sorted(value.items(), key=lambda item: not is_pattern(item[0])):
            result[joint_indices(robot, [joint], owner)] = number
        return result
    if value.ndim and len(value) != robot.nv:
        raise RobotError(f"{owner}: {len(value)} numbers are given; the robot has nv = {robot.nv} velocities.")
    return np.array(np.broadcast_to(value, (robot.nv,)))
