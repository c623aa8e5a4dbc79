"""Joint torques kept within limits, through the mass matrix."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from hqp_rp.control._row_names import effort_units, velocity_names
from hqp_rp.control.limit import PerJoint, checked_per_joint, per_joint
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.robot import Robot


class TorqueLimit:
    """`-limit <= tau <= limit` for the torque that changes the velocity from v' to v within dt: rows on v, in N m (N).

    ::

        tau = M(q) (v - v') / dt + h(q, v') + g(q)
        G = M(q) / dt,   lower = -limit - h - g + M v' / dt,   upper = limit - h - g + M v' / dt

    with M the mass matrix, h the Coriolis and centrifugal and g the gravity torques at the start of the step, v' the velocity
    before it.

    - This is the torque of semi-implicit Euler integration, held for dt: exact for a simulation that integrates so, else to
      first order in dt. Friction, damping, springs and contact forces are not in it; take them off the limit.
    - Neither conservative nor lax beyond that: each row is the limit itself. It looks one step ahead only: a joint
      limit that then needs more torque than there is to stop in time is not foreseen.
    - Starting outside, at a v' that needs more than the limit to be held: M is invertible, so that the rows alone can always
      be met, by a v that gives way within this one step; |v - v'| is bounded by dt |M^-1 (tau - h - g)|. There is no
      overshoot to come back from. With other hard rows (the acceleration of `JointLimit`, a standstill against gravity
      beyond the limit) they may contradict each other: list the limit as the first level where this can happen.

    Args:
        limit: N m or N, > 0: one number, (nv,) numbers (infinite for none, as for a floating base), or a mapping from joint
            name or pattern to number (none for the others). Only the limited velocities have rows.
        gravity: whether tau holds g. False for a robot that compensates its own gravity and gives its limit besides.
        coriolis: whether tau holds h; the robot then needs a method `bias(v)`, as `MujocoRobot` and `PinocchioRobot` have.
        name: default "joint torque".

    Raises:
        SettingError: a limit that is not > 0; a step without v.
        RobotError: when it meets a robot that it does not fit, or that has no `bias`.

    Source: Siciliano et al., Robotics, 2009, equation (7.42), for the equation of motion.
    """

    __slots__ = ("_bound", "_coriolis", "_gravity", "_index", "_limit", "_name", "_torque")

    bounds_accelerations: ClassVar[bool] = True
    """Whether rows on v bound what changes it: an `AccelerationStack` takes them times dt, here M v-dot in N m."""

    def __init__(
        self, limit: PerJoint, *, gravity: bool = True, coriolis: bool = True, name: str = "joint torque"
    ) -> None:
        self._name = str(name)
        self._limit = checked_per_joint(limit, f"the limit of {self._name!r}")
        if self._limit is None:
            raise SettingError(
                f"the limit of {self._name!r} is None: a robot model has no torque limits; give numbers."
            )
        self._gravity, self._coriolis = bool(gravity), bool(coriolis)
        self._bound: Robot | None = None
        self._index: IntArray = np.zeros(0, dtype=np.int64)
        self._torque = np.zeros(0)

    @property
    def name(self) -> str:
        """What levels, reports and errors call the limit."""
        return self._name

    def rows(self, robot: Robot, dt: float, v: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """G (m, nv), lower (m,) and upper (m,) in N m; v is the velocity before this step. One row per limited velocity."""
        if v is None:
            raise SettingError(
                f"limit {self._name!r} needs the velocity before this step: stack.problem(robot, dt, v); zeros for a robot at "
                "rest."
            )
        if robot is not self._bound:
            self._bind(robot)
        M = robot.mass_matrix() / dt
        index = self._index
        free = (M @ v - self._bias(robot, v))[index]
        return M[index], free - self._torque, free + self._torque

    def row_names(self, robot: Robot) -> list[str]:
        """The joints that are limited."""
        if robot is not self._bound:
            self._bind(robot)
        names = velocity_names(robot)
        return [names[i] for i in self._index]

    def limited(self, robot: Robot) -> IntArray:
        """(m,) velocity indices of what is limited on this robot, as the rows stand."""
        if robot is not self._bound:
            self._bind(robot)
        return self._index

    def row_units(self, robot: Robot) -> list[str]:
        """N m, or N of what slides."""
        if robot is not self._bound:
            self._bind(robot)
        units = effort_units(robot)
        return [units[i] for i in self._index]

    def torque(self, robot: Robot, dt: float, v: FloatArray, new_v: FloatArray) -> FloatArray:
        """(nv,) N m: tau of the step from velocity v to `new_v`, both (nv,), at the robot's configuration."""
        if robot is not self._bound:
            self._bind(robot)
        tau: FloatArray = robot.mass_matrix() @ (new_v - v) / dt + self._bias(robot, v)
        return tau

    def _bias(self, robot: Any, v: FloatArray) -> FloatArray:
        if not self._coriolis:
            return np.asarray(robot.gravity()) if self._gravity else np.zeros(robot.nv)
        bias: FloatArray = robot.bias(v)
        return bias if self._gravity else bias - robot.gravity()

    def _bind(self, robot: Robot) -> None:
        owner = f"limit {self._name!r}"
        if self._coriolis and not hasattr(robot, "bias"):
            raise RobotError(
                f"{owner}: a {type(robot).__name__} has no method bias(v) for the Coriolis torque; use a MujocoRobot or a "
                "PinocchioRobot, or coriolis=False."
            )
        torque = per_joint(self._limit, np.full(robot.nv, math.inf), robot, owner)
        self._index = np.flatnonzero(torque < math.inf)
        if not self._index.size:
            raise RobotError(f"{owner}: every limit is infinite; give a number to one joint at least.")
        self._torque, self._bound = torque[self._index], robot

    def __repr__(self) -> str:
        return f"TorqueLimit({self._name!r})"
