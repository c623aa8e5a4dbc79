"""Joint position, velocity, acceleration and jerk limits, folded into one box on the velocity that is never empty."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import driven_indices, positive_number, real_array
from hqp_rp.control._coordinates import coordinate_index
from hqp_rp.control._native_rows import Layout, NativeLimit
from hqp_rp.control._row_names import per_second, velocity_names, velocity_units
from hqp_rp.control.limit import PerJoint, checked_per_joint, per_joint
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.core.row_kinds import BOX
from hqp_rp.robot.robot import Robot


class JointLimit(NativeLimit):
    """One box `lower <= v <= upper` from position, velocity, acceleration and jerk limits; it is never empty.

    Per joint, with position q in [l, u], velocity limit V, acceleration limit A, step dt, and u' the velocity before::

        position       phi(l - q) / dt <= v <= phi(u - q) / dt       phi(d) = sign(d) min(gain |d|, X(|d|)), phi odd
        acceleration   u' - A dt <= v <= u' + A dt
        velocity       -V <= v <= V

        X(d) = d / N + a (N - 1) / 2,   a = A dt^2,   N = max(1, ceil((sqrt(1 + 8 d / a) - 1) / 2))

    X(d) is the longest step from which braking at A, one step at a time, still stops within d (the discrete-time form of
    the bound sqrt(2 A d) on the velocity; X(d) = d without acceleration limit). Where the three contradict each other,
    acceleration yields to velocity, and position yields to both: the position interval is clipped into the
    acceleration interval, itself clipped into the velocity interval. So:

    - the box is never empty, whatever q and u' are;
    - |v| <= V always, and |v - u'| <= A dt whenever |u'| <= V + A dt;
    - a robot that starts at rest within its position limits and stays in the box never leaves them, and needs no more
      than A to do so;
    - a robot that starts outside is made to come back: from rest it never moves further out, its distance shrinks at
      every step by at least min(gain d, X(d), V dt, and what A allows), and the return never asks for more than V or A. A
      robot that starts outside and moves further out first brakes at A, then comes back.

    **Jerk.** With a limit J on the change of the acceleration u'' = (u' - velocity before u') / dt, braking takes longer. The
    stop from a velocity v and the acceleration c / dt is, step by step, with X_J the X of a = J dt^2::

        c <- clip(-X_J(v), c - J dt^2, c + J dt^2), clipped to +-A dt;   v <- v + c

    It ends at rest after finitely many steps. With R(v, c) how far it still rises above where it begins::

        position       v dt + R(v, v - u') <= u - q; below alike
        jerk           u' + u'' dt - J dt^2 <= v <= u' + u'' dt + J dt^2
        velocity       u' - X_J(V + u') <= v <= u' + X_J(V - u'), from where c comes to 0 at V

    R is a closed form that grows with both arguments, so the bound is found by false position, on the safe side. Jerk yields to
    acceleration and velocity, position to all. So the box is never empty still, what is said of V and A above holds, and:

    - the acceleration changes by no more than J dt wherever V and A allow that;
    - a robot that starts at rest within its position limits and stays in the box keeps position limits, V, A and J, all of
      them, whatever it chooses in it, and may come to rest at a position limit;
    - a robot that starts at rest outside keeps V, A and J, never moves further out and comes back, with a start and an end that
      take their time: what each step brings has no bound like the above. One that moves further out brakes within J first;
    - `gain` brakes no sooner than the stop does.

    **A floating base.** V, A or J as one number bound every velocity, the six of a free joint included, three of them
    in m/s, m/s^2 or m/s^3; as `{"*": number}` they bound every other joint and leave a floating base alone.

    Where dt, q or the limits jump between steps, V holds and A as above; J may yield to them, and a position limit be passed.

    Args:
        position: whether the robot's position limits count; where infinite, there is none.
        velocity: V, rad/s or m/s: as `limit` of `VelocityLimit`; None takes the robot's own; where the model has none (an MJCF
            says none), a stack warns, unless accelerations or jerks are limited, or what stands beside it bounds the speeds: a
            `VelocityLimit`, mink's or pink's own limits on velocities or accelerations, or `LockedJoints`.
        acceleration: A, rad/s^2 or m/s^2: one number, (nv,) numbers, a mapping from joint name to number (none for the
            others), or None for no limit. Needs the velocity before the step: `stack.problem(robot, dt, v)`.
        jerk: J, rad/s^3 or m/s^3, as `acceleration`, with it or without. Needs the acceleration before the step as well, u'':
            `stack.problem(robot, dt, v, a)`.
        gain: in (0, 1], the fraction of the distance to a position limit that one step may take.
        margin: rad or m, >= 0, by which the position limits are drawn in.
        name: default "joint limits".

    Raises:
        SettingError: a value out of its range; a step without v although accelerations are limited, or without a although
            jerks are.
        RobotError: when it meets a robot that it does not fit, or whose range the margin swallows.

    Source: Flacco, De Luca and Khatib, "Motion control of redundant robots under joint constraints: saturation in the null
    space", ICRA 2012, for the box from the three limits; X(d), jerk, the order in which they yield and the way back are ours.
    """

    __slots__ = ("_acceleration", "_gain", "_jerk", "_margin", "_name", "_position", "_velocity")

    def __init__(
        self,
        *,
        position: bool = True,
        velocity: PerJoint = None,
        acceleration: PerJoint = None,
        jerk: PerJoint = None,
        gain: float = 0.95,
        margin: ArrayLike = 0.0,
        name: str = "joint limits",
    ) -> None:
        self._name = name
        self._position = bool(position)
        self._velocity = checked_per_joint(velocity, f"the velocity of {name!r}")
        self._acceleration = checked_per_joint(acceleration, f"the acceleration of {name!r}")
        self._jerk = checked_per_joint(jerk, f"the jerk of {name!r}")
        self._gain = positive_number(gain, f"the gain of {name!r}")
        if self._gain > 1.0:
            raise SettingError(f"the gain of {name!r} is {gain!r}; it must be in (0, 1], or one step passes the limit.")
        self._margin = real_array(margin, f"the margin of {name!r}")
        if self._margin.ndim > 1 or not ((self._margin >= 0.0) & np.isfinite(self._margin)).all():
            raise SettingError(f"the margin of {name!r} is {self._margin.tolist()}; it must be finite and >= 0.")
        self._alone = self._packed = None

    @property
    def name(self) -> str:
        """What levels, reports and errors call the limit."""
        return self._name

    def jerk_on(self, robot: Robot) -> FloatArray | None:
        """(nv,) J on this robot, infinite for none; None where no jerk is bounded."""
        if self._jerk is None:
            return None
        return per_joint(self._jerk, np.full(robot.nv, math.inf), robot, f"limit {self._name!r}")

    def speed_from_rest(self, robot: Robot, dt: float) -> FloatArray:
        """(nv,) the greatest speed after one step of dt from rest, rad/s or m/s: min(A dt, J dt^2), infinite without both."""
        acceleration = per_joint(self._acceleration, np.full(robot.nv, math.inf), robot, f"limit {self._name!r}")
        jerk = self.jerk_on(robot)
        speed: FloatArray = acceleration * dt if jerk is None else np.minimum(acceleration * dt, jerk * dt**2)
        return speed

    def unlimited_speeds(self, robot: Robot) -> list[str]:
        """The hinges and slides whose speed nothing bounds: no velocity, acceleration or jerk given, none in the model."""
        if not (self._velocity is None and self._acceleration is None and self._jerk is None):
            return []
        widths = np.array(getattr(robot, "joint_widths", (1,) * len(robot.joint_names)), dtype=np.int64)
        single = np.repeat(widths == 1, widths)
        if len(single) != robot.nv:
            return []
        driven = np.isin(np.arange(robot.nv), driven_indices(robot))
        names = velocity_names(robot)
        return [names[i] for i in np.flatnonzero(single & driven & np.isinf(robot.velocity_limit))]

    def bounded_speeds(self, robot: Robot) -> list[str]:
        """The joints whose velocity, acceleration or jerk is bounded on this robot."""
        owner = f"limit {self._name!r}"
        unlimited, names = np.full(robot.nv, math.inf), velocity_names(robot)
        bounds = (self._velocity, robot.velocity_limit), (self._acceleration, unlimited), (self._jerk, unlimited)
        least = np.min([per_joint(given, default, robot, owner) for given, default in bounds], axis=0)
        return [names[i] for i in np.flatnonzero(least < math.inf)]

    @property
    def stops_at_once(self) -> bool:
        """Whether a joint may be asked to stop, or to come back, within one step: position limits, no acceleration, no jerk."""
        return self._position and self._acceleration is None and self._jerk is None

    def stopped_at_once(self, robot: Robot) -> IntArray:
        """Velocity indices that have position limits, and neither acceleration nor jerk bounded."""
        if not self._position:
            return np.zeros(0, dtype=np.int64)
        owner, unlimited = f"limit {self._name!r}", np.full(robot.nv, math.inf)
        acceleration = per_joint(self._acceleration, unlimited, robot, owner)
        jerk = per_joint(self._jerk, unlimited, robot, owner)
        limited = np.isfinite(robot.lower) | np.isfinite(robot.upper)
        return np.flatnonzero(limited & np.isinf(acceleration) & np.isinf(jerk))

    def row_names(self, robot: Robot) -> list[str]:
        """The joints, one for each velocity."""
        return velocity_names(robot)

    def bound_causes(
        self, robot: Robot, dt: float, v: FloatArray | None, lower: FloatArray, upper: FloatArray
    ) -> list[tuple[str, str]]:
        """What made lower (nv,) and upper (nv,), as `rows(robot, dt, v)` returned them, in words: position, velocity or
        acceleration, of two that agree the one that yields last; of a limit on jerks, what is none of these by itself."""
        speed = per_joint(self._velocity, robot.velocity_limit, robot, f"limit {self._name!r}")
        acceleration = per_joint(self._acceleration, np.full(robot.nv, math.inf), robot, f"limit {self._name!r}")
        before = np.zeros(robot.nv) if v is None else v
        units = velocity_units(robot)
        rest = "position" if self._jerk is None else "position, velocity and jerk"

        def cause(bound: float, j: int, side: float) -> str:
            if not math.isfinite(bound):
                return ""
            near = 1e-9 * (abs(bound) + abs(float(before[j])))
            slowest = before[j] + side * acceleration[j] * dt  # what the acceleration allows
            if abs(bound + side * speed[j]) <= near and -side * slowest > speed[j] + near:
                return f"velocity {speed[j]:g} {units[j]}, from {before[j]:.3g} {units[j]} beyond it"
            for end in (side, -side):
                yields = "" if end == side else ", as fast as that allows"
                pushed = "" if end == side else "position: "
                if abs(bound - end * speed[j]) <= near:
                    return f"{pushed}velocity {speed[j]:g} {units[j]}{yields}"
                if abs(bound - before[j] - end * acceleration[j] * dt) <= near:
                    unit = per_second(units[j])
                    start = round(float(before[j]), 6) + 0.0
                    return f"{pushed}acceleration {acceleration[j]:g} {unit} x dt from {start:.3g} {units[j]}{yields}"
            return rest

        return [
            (cause(float(low), j, -1.0), cause(float(high), j, 1.0))
            for j, (low, high) in enumerate(zip(lower, upper, strict=True))
        ]

    def _layout(self, robot: Robot) -> Layout:
        coordinates = [-1] * robot.nv
        if self._position:
            balls = getattr(robot, "limited_balls", ())
            if balls:
                raise RobotError(
                    f"limit {self._name!r}: the ball joint {balls[0]!r} has a range, which no box on velocities holds; give "
                    "position=False and limit the other joints' positions some other way, or take the range out of the model."
                )
            index = coordinate_index(robot, f"limit {self._name!r}")
            coordinates = list(range(robot.nv)) if index is None else index.tolist()
        jerked = self._jerk is not None
        return Layout(BOX, robot.nv, coordinates, accelerated=jerked or self._acceleration is not None, jerked=jerked)

    def _numbers(self, robot: Robot, layout: Layout) -> FloatArray:
        owner = f"limit {self._name!r}"
        if self._margin.ndim and len(self._margin) != robot.nv:
            raise RobotError(f"{owner}: margin has {len(self._margin)} numbers; the robot has nv = {robot.nv}.")
        least, greatest = robot.lower + self._margin, robot.upper - self._margin
        empty = np.flatnonzero(least > greatest)
        if self._position and empty.size:
            i = int(empty[0])
            raise RobotError(
                f"{owner}: at velocity index {i} the margin {np.broadcast_to(self._margin, (robot.nv,))[i]:g} swallows "
                f"the range [{robot.lower[i]:g}, {robot.upper[i]:g}]; give a smaller margin."
            )
        speed = per_joint(self._velocity, robot.velocity_limit, robot, owner)
        acceleration = per_joint(self._acceleration, np.full(robot.nv, math.inf), robot, owner)
        bounded = (least > -math.inf) | (greatest < math.inf) if self._position else np.zeros(robot.nv, dtype=bool)
        if self._acceleration is None and self._jerk is None and not bounded.any() and not np.isfinite(speed).any():
            raise RobotError(
                f"{owner}: the robot has no such limits and none are given; give velocity, acceleration or jerk."
            )
        gain = self._gain if self._position else 0.0
        jerk = self.jerk_on(robot)
        return np.concatenate(([gain], least, greatest, speed, acceleration, [] if jerk is None else jerk))

    def __repr__(self) -> str:
        return f"JointLimit({self._name!r})"
