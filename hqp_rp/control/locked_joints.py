"""Joints that must not move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hqp_rp.control._checks import driven_indices, joint_indices
from hqp_rp.control._row_names import velocity_names, velocity_units
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot


class LockedJoints:
    """`v_j = 0` for some joints, or for all but some.

    Args:
        joints: names, patterns of names ("left_*") or velocity indices of those that are locked; they may overlap.
        all_but: of those that alone may move; everything else is locked, free and ball joints included.
        name: default "locked joints".

    Raises:
        SettingError: both joints and all_but, or neither.
        RobotError: when it meets a robot without such a joint.
    """

    __slots__ = ("_all_but", "_bound", "_joints", "_locked", "_name")

    def __init__(
        self,
        joints: Sequence[str | int] | None = None,
        *,
        all_but: Sequence[str | int] | None = None,
        name: str = "locked joints",
    ) -> None:
        if (joints is None) == (all_but is None):
            raise SettingError(f"{name!r} has joints={joints!r}, all_but={all_but!r}; give one of the two.")
        for what, value in (("joints", joints), ("all_but", all_but)):
            if value is not None and (isinstance(value, str) or not len(value)):
                raise SettingError(
                    f"{what} of {name!r} is {value!r}; give a sequence of joint names or velocity indices."
                )
        self._joints = None if joints is None else tuple(joints)
        self._all_but = None if all_but is None else tuple(all_but)
        self._name = name
        self._bound: Robot | None = None
        self._locked = np.zeros(0, dtype=np.int64)

    @property
    def name(self) -> str:
        """What levels, reports and errors call the limit."""
        return self._name

    def rows(self, robot: Robot, dt: float, v: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rows of the identity (m, nv) and zeros (m,); dt and v are not needed."""
        if robot is not self._bound:
            self._bind(robot)
        G, zero = np.zeros((len(self._locked), robot.nv)), np.zeros(len(self._locked))
        G[np.arange(len(self._locked)), self._locked] = 1.0
        return G, zero, zero

    def row_names(self, robot: Robot) -> list[str]:
        """The joints that are locked."""
        if robot is not self._bound:
            self._bind(robot)
        names = velocity_names(robot)
        return [names[i] for i in self._locked]

    def row_units(self, robot: Robot) -> list[str]:
        """rad/s, or m/s of what slides."""
        if robot is not self._bound:
            self._bind(robot)
        units = velocity_units(robot)
        return [units[i] for i in self._locked]

    def _bind(self, robot: Robot) -> None:
        named = self._joints if self._joints is not None else self._all_but
        assert named is not None
        found = joint_indices(robot, named, f"limit {self._name!r}", distinct=False)
        self._locked = found if self._joints is not None else np.setdiff1d(driven_indices(robot), found)
        self._bound = robot

    def __repr__(self) -> str:
        return f"LockedJoints({self._name!r})"
