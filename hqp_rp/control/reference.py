"""What force, impedance and hybrid references share: a law that is integrated, and a task that carries its rate."""

from __future__ import annotations

import abc
import math
from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import TWIST_AXES, WORLD, axis_rows, finite_vector, positive_number, real_array
from hqp_rp.control._native_rows import NativeRows
from hqp_rp.control.admittance import AdmittanceLaw
from hqp_rp.control.twist_task import TwistTask
from hqp_rp.control.wrench import Wrench
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

Feedback: TypeAlias = Literal["commanded", "measured"]


class Reference(abc.ABC):
    """A task whose rate comes from integrating a law: mass, damper and spring, driven by the measured contact force.

    Not used by itself: see `ForceReference`, `ImpedanceReference`, `HybridReference`. Put references into the levels of a
    `Stack`, in any order, beside any other task. `InteractionController` runs the loop, with safe behaviour when a
    reading or a solve fails; by hand it is, at every step::

        robot.update(q)
        for reference in references:
            reference.advance(robot, wrench, dt, v)
        v = hqp_rp.solve(stack.problem(robot, dt), solver).x
        for reference in references:
            reference.deliver(robot, v)

    **State and rate.** The state is V (m,), the velocity that the law commands along the chosen axes: the integral in
    (40), (45), (50). Force and desired motion are held during dt and the law is solved exactly (`AdmittanceLaw`); V becomes
    the velocity at the end of the period, and the rate of the task is the mean velocity during it. A robot that holds the
    rate for dt then is, at the end, where the continuous law puts it. (A robot that held V instead would be off by a
    first-order error.)

    **Which velocity is damped.** With `feedback="measured"`, the default and the literal reading of (40), the damper acts
    on the measured velocity J v: V grows by what the law makes of the measured motion in one period. At rest in contact
    this is integral action: V is whatever the robot's velocity loop needs to hold the load, and F_e = F_d. With
    `feedback="commanded"` the damper acts on V itself: exact for every dt, and free of the lag of the velocity loop, but
    a loop that lets the robot rest at a command V != 0, as one without integral action does under load, leaves a force
    error of B_d V. Where the robot has exactly the velocity V the two are the same, so "commanded" is for robots that do
    as they are told: kinematic simulation, and stiff velocity or position loops. Where the robot is held back, V grows to
    B_d^-1 (F_d - F_e) with "commanded" and without bound with "measured", unless `recovery` keeps it. A spring always acts
    on the measured position, so nothing drifts.

    **Anti-windup.** `deliver(robot, v)` says what the solver gave. The shortfall J v - rate is added to V with the time
    constant `recovery` (back-calculation, Åström and Rundqwist 1989): while a level cannot be served, V stays near what
    it gets, and when it is free again it starts from there. A solver that always delivers a little less, as a damped one
    does, leaves a force error of M_d (rate - J v) / recovery with "measured"; a longer `recovery` makes it smaller.

    **Start.** `start(robot, v)` sets V to the present motion J v, so that the first rate continues it: it differs by no
    more than the law accelerates in half a period. Without `start`, the robot is taken to be at rest.

    **Torques.** In an `AccelerationStack` or a `TorqueStack` the law's acceleration is asked for instead of its integral:
    `accelerate(robot, wrench, v)` in the place of `advance`, and nothing to deliver. There is no state then, no velocity loop
    below and no anti-windup; `TorqueStack.problem` is told the wrench too (`applied`), or the robot's own inertia takes the
    place of M_d.

    **Axes.** Axes turn with the frame whose they are, and V, a set of components along them, turns with them. Velocities
    are those of the frame's origin; rotational axes carry angular velocity.
    """

    __slots__ = ("_V", "_axes", "_expressed_in", "_feedback", "_frame", "_gap", "_index", "_law", "_recovery", "_twist")

    def __init__(
        self,
        frame: str,
        kind: str,
        *,
        axes: str | Sequence[str],
        expressed_in: str,
        feedback: Feedback,
        recovery: float | None,
        weight: ArrayLike,
        name: str,
    ) -> None:
        label = name or f"{frame} {kind}"
        self._twist = TwistTask(frame, axes=axes, expressed_in=expressed_in, weight=weight, name=label)
        self._frame = frame
        self._expressed_in = expressed_in
        self._axes, self._index = axis_rows(axes, TWIST_AXES, f"axes of {label!r}")
        if feedback not in ("commanded", "measured"):
            raise SettingError(f"the feedback of {label!r} is {feedback!r}; it must be 'commanded' or 'measured'.")
        self._feedback = feedback
        if recovery is None:
            self._recovery = math.inf
        elif recovery == 0.0:
            self._recovery = 0.0
        else:
            self._recovery = positive_number(recovery, f"the recovery of {label!r}")
        self._law: AdmittanceLaw
        self._V = np.zeros(self.size)
        self._gap: FloatArray | None = None

    @property
    def name(self) -> str:
        """What levels, reports and errors call the reference."""
        return self._twist.name

    @property
    def frame(self) -> str:
        """The frame that the reference moves."""
        return self._frame

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the reference uses."""
        return self._twist.frames

    @property
    def axes(self) -> tuple[str, ...]:
        """The chosen axes, one for each row."""
        return self._axes

    @property
    def size(self) -> int:
        """m, the number of axes."""
        return len(self._axes)

    @property
    def law(self) -> AdmittanceLaw:
        """The law that is integrated."""
        return self._law

    @property
    def velocity(self) -> FloatArray:
        """(m,) V, the state: m/s and rad/s along the axes, at the end of the last period."""
        return self._V.copy()

    @property
    def rate(self) -> FloatArray:
        """(m,) what the task asks for now: the mean velocity of the present period, m/s and rad/s."""
        return self._twist.velocity

    def contact_force(self, robot: Robot, wrench: Wrench) -> FloatArray:
        """(m,) F_e along the axes, in N and N m about the frame's origin: what the robot does to its environment."""
        point = np.zeros(3) if self._frame == WORLD else robot.pose(self._frame)[1]
        return self._along(robot, wrench.about(point))

    def start(self, robot: Robot, v: ArrayLike | None = None) -> None:
        """Begin from the present motion: V = rate = J v; v (nv,) in rad/s or m/s, None for a robot at rest."""
        self._V = np.zeros(self.size) if v is None else self._motion(robot, v)
        self._twist.velocity = self._V
        self._gap = None

    def advance(self, robot: Robot, wrench: Wrench, dt: float, v: ArrayLike | None = None) -> FloatArray:
        """Integrate the law over one period and return the new rate (m,), m/s and rad/s.

        Args:
            robot: at its current configuration.
            wrench: what the robot exerts on its environment now.
            dt: > 0, s, the control period.
            v: (nv,) measured velocity, rad/s or m/s; not needed with `feedback="commanded"`.

        Raises:
            SettingError: a dt, v or wrench that does not fit; v missing although it is needed.
            RobotError: a frame that the robot does not have.
        """
        if not isinstance(wrench, Wrench):
            raise SettingError(f"{self.name!r}: wrench is a {type(wrench).__name__}; give a Wrench.")
        dt = positive_number(dt, "dt")
        V = self._V
        if self._gap is not None and self._recovery < math.inf:
            share = 1.0 if self._recovery == 0.0 else -math.expm1(-dt / self._recovery)
            V = V + share * self._gap
        force, deviation, velocity, acceleration = self._terms(robot, self.contact_force(robot, wrench))
        if self._feedback == "commanded":
            moving, rest = V, np.zeros(self.size)
        elif v is None:
            raise SettingError(
                f"{self.name!r} damps the measured velocity, so it needs v, (nv,). For a robot that has exactly the velocity "
                "it is sent, choose feedback='commanded'."
            )
        else:
            moving = self._motion(robot, v)
            rest = V - moving
        mean, end = self._law.advance(deviation, moving - velocity, force, dt)
        self._twist.velocity = mean + velocity + (0.5 * dt) * acceleration + rest
        self._V = end + velocity + dt * acceleration + rest
        self._gap = None
        return self._twist.velocity

    def accelerate(self, robot: Robot, wrench: Wrench, v: ArrayLike) -> FloatArray:
        """Ask for the law's acceleration, (40), (43), (48) before integration; returns it, (m,), m/s^2 and rad/s^2.

        The rows become `J v-dot = X'' - Jdot v`. Arguments and errors as of `advance`.
        """
        if not isinstance(wrench, Wrench):
            raise SettingError(f"{self.name!r}: wrench is a {type(wrench).__name__}; give a Wrench.")
        force, deviation, velocity, acceleration = self._terms(robot, self.contact_force(robot, wrench))
        moving = self._motion(robot, v)
        self._V = moving
        self._twist.kd = 0.0
        self._twist.velocity = moving
        self._twist.acceleration = self._law.acceleration(deviation, moving - velocity, force) + acceleration
        return self._twist.acceleration

    def deliver(self, robot: Robot, v: ArrayLike) -> None:
        """Say which velocity v (nv,) the robot is sent, before the robot moves on; see anti-windup."""
        self._gap = self._motion(robot, v) - self._twist.velocity

    def jacobian(self, robot: Robot) -> FloatArray:
        """(m, nv) geometric Jacobian along the chosen axes, before the weight."""
        return self._twist.jacobian(robot)

    @property
    def native(self) -> NativeRows | None:
        """The task that carries the rate; None where a subclass has an `evaluate` of its own."""
        return self._twist.native if type(self).evaluate is Reference.evaluate else None

    def evaluate(self, robot: Robot) -> tuple[FloatArray, FloatArray]:
        """Jacobian (m, nv) and rate (m,), both scaled by the weight."""
        return self._twist.evaluate(robot)

    @abc.abstractmethod
    def _terms(self, robot: Robot, contact: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """The law's force, deviation, and desired velocity and acceleration, each (m,), from F_e (m,)."""

    def _along(self, robot: Robot, vector: FloatArray) -> FloatArray:
        """(m,) the components of a pair of world vectors (6,) along the chosen axes."""
        if self._expressed_in != WORLD:
            vector = (vector.reshape(2, 3) @ robot.pose(self._expressed_in)[0]).ravel()
        chosen: FloatArray = vector[self._index]
        return chosen

    def _motion(self, robot: Robot, v: ArrayLike) -> FloatArray:
        """(m,) J v, finite."""
        velocity = finite_vector(v, robot.nv, f"the velocity given to {self.name!r}", "rad/s or m/s")
        motion: FloatArray = self._twist.jacobian(robot).dot(velocity)
        return motion

    def _vector(self, value: ArrayLike, what: str) -> FloatArray:
        """(m,) numbers along the axes; one number stands for all."""
        array = real_array(value, f"{what} of {self.name!r}")
        if array.ndim == 0:
            array = np.full(self.size, float(array))
        return finite_vector(array, self.size, f"{what} of {self.name!r}", "N and N m")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r})"
