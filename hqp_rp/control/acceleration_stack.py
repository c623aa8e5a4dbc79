"""The stack of tasks one level deeper: levels in order of priority and limits, as a problem whose unknown is v-dot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._acceleration_rows import AccelerationRows
from hqp_rp.control._checks import positive_number
from hqp_rp.control._displacement import DisplacementTask
from hqp_rp.control._stack_metric import StackMetric
from hqp_rp.control._stack_rows import StackRows
from hqp_rp.control.limit import Limit
from hqp_rp.control.stack import Item, Stack
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.damping import LevelDamping
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray, IntArray, Problem
from hqp_rp.robot.robot import Robot


class AccelerationStack(Stack):
    """Levels of tasks and limits, most important first, and hard limits, for a robot's acceleration v-dot (nv,).

    It reads like `Stack`, and takes the same tasks and limits. With J v = r what a task asks for at the velocity level::

        task     J v-dot = a_ff + kd (feedforward - J v) + kp error - (Jdot v - d/dt feedforward)
        limit    lower <= G (v + dt v-dot) <= upper      with the rows G, lower, upper that bound the velocity in a `Stack`

    so that `JointLimit` keeps positions, velocities, accelerations and jerks in the same box, which is never empty, as long as
    the answer is applied as it is meant::

        stack = AccelerationStack([hand, posture], limits=[JointLimit(acceleration=20.0)])
        robot.update(q)
        a = hqp_rp.solve(stack.problem(robot, dt, v), solver).require()
        v = v + dt * a
        q = robot.integrate(q, v, dt)

    A `TorqueLimit`, whose G is M / dt, has its rows times dt: M v-dot, in N m.

    Gains are those of the tasks: `kp`, `kd`, by default gain^2 and 2 gain. Any solver takes the problem: the recursions of
    reverse priority and of null-space priority are the same at this level, and so is saturation in the null space.

    Jdot v is exact for the library's own tasks. A task of mink or pink, and a class of one's own, states a velocity alone: its
    rows are `J v-dot = kd (rate - J v) - Jdot v`, with the attribute `kd` of the class of one's own, or the stack's. Where its
    rate is g times its error (in mink and pink g = gain / dt), kd = 4 g is critically damped and a smaller one swings, which is
    warned of in tasks of mink and pink: their gain should be kd dt / 4, 5 dt with the kd of 20. Its
    Jdot v is what its method `bias_acceleration(robot, v)` (m,) says, where it has one and that is not None; else it is the
    central difference of J v along v, right to about 1e-10 of |J| |v|^2, for which the robot is moved there and back.

    Args:
        levels, limits, names, damping, metric: as of `Stack`; `lm_damping` of tasks of mink and pink is not taken
            over, which is warned of. An error that damping looks at is that of the rows on v-dot.
        kd: 1/s, > 0, of tasks that state a velocity alone.

    Raises:
        SettingError: as `Stack`; a kd that is not > 0.

    Source: Sadeghian, Villani, Keshmiri and Siciliano 2013 for priorities among accelerations; bounds on what follows a step
    are those of the velocity level, see `JointLimit`, and Del Prete 2018.
    """

    __slots__ = ("_kd", "_told")

    _of_velocities = False

    def __init__(
        self,
        levels: Sequence[Item | Sequence[Item]],
        limits: Sequence[Item] = (),
        *,
        names: Sequence[str] | None = None,
        damping: LevelDamping | Sequence[LevelDamping | None] | None = None,
        metric: StackMetric = None,
        kd: float = 20.0,
    ) -> None:
        self._kd = positive_number(kd, "kd")
        self._told: set[int] = set()  # tasks of mink and pink that were warned of
        super().__init__(levels, limits, names=names, damping=damping, metric=metric)

    def problem(
        self, robot: Robot, dt: float | None = None, v: ArrayLike | None = None, a: ArrayLike | None = None
    ) -> Problem:
        """The prioritized problem at the robot's current configuration and the velocity v.

        Args:
            robot: at its current configuration; `robot.update(q)` sets it.
            dt: > 0, s, for how long the answer will be held. Needed by limits and by tasks of mink and pink only.
            v: (nv,) velocity now, rad/s or m/s.
            a: (nv,) acceleration before this step, rad/s^2 or m/s^2. Needed by limits on jerks only.

        Raises as `Stack.problem`; `SettingError` where v is missing, `RobotError` for a robot that does not tell Jdot v.

        Warns:
            UserWarning: a dt of more than 1 s, or kd dt > 1; a task of mink or pink with a gain above kd dt / 4, or with an
                `lm_damping`, once for each.
        """
        if v is None:
            raise SettingError("accelerations need the velocity: problem(robot, dt, v); zeros for a robot at rest.")
        return super().problem(robot, dt, v, a)

    def batch(
        self, robot: Robot, q: ArrayLike, *args: Any, **settings: Any
    ) -> tuple[FloatArray, FloatArray, Any, IntArray]:
        """Not for accelerations. Raises `SettingError`."""
        raise SettingError(
            f"{self!r} makes no batches: its rows depend on the velocity; call problem() for each q and v."
        )

    def _too_quick(self, item: Any, dt: float) -> str | None:
        """Of v + dt v-dot, q + dt v: e changes its sign at each step where kd dt > 1, and grows where kp dt^2 + 2 kd dt > 4."""
        kp, stated = item._feedback() if isinstance(item, FeedbackTask) else (0.0, getattr(item, "kd", None))
        kd = np.asarray(self._kd if stated is None else stated, dtype=np.float64)
        if isinstance(item, DisplacementTask):
            told = self._theirs_not_served(item, dt)
            if told is not None:
                return told
        if isinstance(item, Limit) or (np.max(kd) * dt <= 1.0 + 1e-9 and np.max(kp * dt**2 + 2.0 * kd * dt) <= 4.0):
            return None
        return (
            f"kp {np.max(kp):g} 1/s^2 and kd {np.max(kd):g} 1/s at dt {dt:g} s: each step goes past what it aims at. Take a "
            f"kd of at most 1/dt = {1.0 / dt:g}, a gain of at most {0.5 / dt:g}, and a kp of at most kd^2."
        )

    def _theirs_not_served(self, item: DisplacementTask, dt: float) -> str | None:
        """What of a task of mink or pink swings or is left out at this level, the first time; else None."""
        if id(item) in self._told:
            return None
        told, rate = [], item.feedback_gain / dt
        if rate > 0.25 * self._kd * (1.0 + 1e-9):
            told.append(
                f"the gain {item.feedback_gain:g} at dt {dt:g} s, which feeds its error back at {rate:g} 1/s: with kd "
                f"{self._kd:g} 1/s it swings (damping ratio {0.5 * math.sqrt(self._kd / rate):.2g}). Take a gain of at most "
                f"kd dt / 4 = {0.25 * self._kd * dt:g}, or a task of the library's own"
            )
        if any(task is item for _, _, task in self._displacement_tasks) and item.lm_damping:
            told.append(
                f"lm_damping {item.lm_damping:g}, which damps displacements and is left out here. Give the stack damping=, "
                "such as ErrorDamping(0.003, power=1), for its level, or set lm_damping to 0"
            )
        if not told:
            return None
        self._told.add(id(item))
        return ". It has ".join(told) + "."

    def _with_theirs(
        self, rows: StackRows, lower: FloatArray, dt: float | None
    ) -> tuple[LevelDamping | None, ...] | None:
        """The `lm_damping` of mink and pink is one of displacements, and not taken over."""
        return self._policies

    def _rows_on(self, robot: Robot, two_sided: bool) -> StackRows:
        return AccelerationRows((*self._hard, *self._items), robot, two_sided, self._where, kd=self._kd)
