"""The control loop around references: reading, integration, solve, and a safe end when one of them fails."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import check_frames, finite_vector, positive_number
from hqp_rp.control._refusal import require_not_refused, require_taken
from hqp_rp.control._stack_rows import LIMIT, StackRows
from hqp_rp.control.acceleration_stack import AccelerationStack
from hqp_rp.control.command import Command, Mode, fault_of
from hqp_rp.control.limit import Limit
from hqp_rp.control.reference import Reference
from hqp_rp.control.stack import Stack
from hqp_rp.control.wrench import WrenchSensor
from hqp_rp.core.errors import HqpError, SettingError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver, checked_secondary, get_solver
from hqp_rp.robot.robot import Robot

BOUND_TOLERANCE = 1e-6
"""rad/s or m/s: by how much an answer may pass a bound at zero before the whole command is set to zero."""


class InteractionController:
    """Runs a stack with force, impedance or hybrid references: any levels, any solver, and always a finite command.

    ::

        controller = InteractionController(stack, sensor, solver)
        controller.start(robot, v)
        command = controller.step(robot, reading, dt, v)        # at every control period, after robot.update(q)

    A step reads the sensor, advances every `Reference` of the stack, builds the problem, solves it, shortens the answer
    where a limit asks for it, and tells the references what they got (`Reference.deliver`).

    **When something fails** (the sensor has a fault; the measured v is not finite; the stack's rows are not finite; the
    solver returns no x, one that is not finite, or a status other than SOLVED or, with `accept_inaccurate`, INACCURATE):
    the controller holds. From this step on the command is the last good one times 1 - s / stop_time, where s is the time
    since then, so it reaches exactly zero within `stop_time` (rounded up to a whole period), moves straight, and needs no
    solver and no sensor. Then the controller is stopped, and the command stays zero. Both are latched: good readings
    change nothing until `reset`. Errors of misuse before the first good command are raised instead.

    **Limits.** Hard limits of the stack are the solver's duty; a command, in hold too, is shortened as a whole (all joints
    by one factor, so its direction stays) when it passes one. `scale_into` names limits that the solver is not told of
    and the command is shortened to: a velocity limit for closed forms, which take no hard rows. Only two-sided rows that
    allow v = 0 can be met by shortening; a command that is shortened or held does not look at jerks.

    Args:
        stack: holds at least one `Reference`.
        sensor: gives the contact wrench that all of them use.
        solver: a `Solver`, or its name.
        stop_time: s, > 0.
        accept_inaccurate: whether an answer of status INACCURATE is used.
        scale_into: see above.

    Raises:
        SettingError: no reference in the stack, a value out of its range, or a solver that refuses the stack's problems, in its
            own words.
        UnknownNameError: no solver of that name.
    """

    __slots__ = (
        "_accepted",
        "_elapsed",
        "_last",
        "_mode",
        "_rate",
        "_reason",
        "_references",
        "_robot",
        "_running_since_start",
        "_scale_into",
        "_scale_rows",
        "_sensor",
        "_sent",
        "_solver",
        "_stack",
        "_stop_time",
    )

    def __init__(
        self,
        stack: Stack,
        sensor: WrenchSensor,
        solver: str | Solver,
        *,
        stop_time: float = 0.1,
        accept_inaccurate: bool = True,
        scale_into: Sequence[Limit] = (),
    ) -> None:
        if not isinstance(stack, Stack) or isinstance(stack, AccelerationStack):
            raise SettingError(f"stack is a {type(stack).__name__}; give a Stack: what is sent are velocities.")
        if not isinstance(sensor, WrenchSensor):
            raise SettingError(f"sensor is a {type(sensor).__name__}; give a WrenchSensor.")
        items = {id(item): item for level in stack.levels for item in level if isinstance(item, Reference)}
        if not items:
            raise SettingError(f"{stack!r} holds no force, impedance or hybrid reference; solve its problem directly.")
        for limit in scale_into:
            if not isinstance(limit, Limit):
                raise SettingError(
                    f"scale_into holds {limit!r}, which is no Limit; give limits such as VelocityLimit()."
                )
        self._stack = stack
        self._sensor = sensor
        self._solver = get_solver(solver)
        require_taken(self._solver, stack)
        self._references = tuple(items.values())
        self._stop_time = positive_number(stop_time, "stop_time")
        self._accepted = (Status.SOLVED, Status.INACCURATE) if accept_inaccurate else (Status.SOLVED,)
        self._scale_into = [(LIMIT, limit) for limit in scale_into]
        self._scale_rows: StackRows | None = None
        self._robot: Robot | None = None
        self._running_since_start = False
        self._restart()

    @property
    def references(self) -> tuple[Reference, ...]:
        """The references of the stack, most important first."""
        return self._references

    @property
    def solver(self) -> Solver:
        """The solver in use."""
        return self._solver

    @property
    def mode(self) -> Mode:
        """What the controller is doing."""
        return self._mode

    @property
    def reason(self) -> str:
        """Why the controller does not run, as a sentence; empty while it runs."""
        return self._reason

    def start(self, robot: Robot, v: ArrayLike | None = None) -> None:
        """Begin, or begin again after a stop, from the present motion v (nv,), rad/s or m/s; None for a robot at rest.

        Raises:
            SettingError: a v that is not nv finite numbers.
            RobotError: a frame that the robot does not have.
        """
        for reference in self._references:
            check_frames(robot, reference.frames, repr(reference.name))
        check_frames(robot, self._sensor.frames, "the sensor")
        motion = np.zeros(robot.nv) if v is None else finite_vector(v, robot.nv, "v", "rad/s or m/s")
        for reference in self._references:
            reference.start(robot, motion)
        self._restart()
        self._robot, self._last, self._sent, self._rate = robot, motion, motion, np.zeros(robot.nv)

    reset = start

    def step(
        self,
        robot: Robot,
        reading: ArrayLike | None,
        dt: float,
        v: ArrayLike | None = None,
        secondary: ArrayLike | None = None,
    ) -> Command:
        """The velocity for the next dt seconds.

        Args:
            robot: at its current configuration, the one given to `start`; without a start, one at rest.
            reading: (6,) of the sensor, N and N m; None when none has come.
            dt: > 0, s, the control period.
            v: (nv,) measured velocity, rad/s or m/s; may be None where all references have `feedback="commanded"`. Limits
                on accelerations start from it, or from the last command where it is None.
            secondary: (nv,) free vector for what all levels leave; see `hqp_rp.solve`.

        Raises:
            HqpError: misuse: values of a wrong shape or type; before the first good command, anything that fails but
                sensor, motion and solver, and a solver that refuses the problem.
        """
        dt = positive_number(dt, "dt")
        if self._robot is None:
            self.start(robot)
        elif robot is not self._robot:
            raise SettingError("the controller was started with another robot; call start(robot, v) for this one.")
        if self._mode is not Mode.RUNNING:
            return self._hold(robot, dt, None, None, 0.0)
        wrench = self._sensor.read(robot, reading, dt)
        if wrench is None:
            return self._fail(robot, dt, self._sensor.fault)
        motion = self._last if v is None else np.array(v, dtype=np.float64)
        if v is not None and not np.isfinite(motion).all():
            return self._fail(robot, dt, "The measured velocity is not finite.")
        try:
            free = checked_secondary(secondary, robot.nv)
            for reference in self._references:
                reference.advance(robot, wrench, dt, None if v is None else motion)
            problem = self._stack.problem(robot, dt, motion, self._rate)
        except HqpError as error:
            if not self._running_since_start:
                raise
            return self._fail(robot, dt, str(error))
        begin = time.perf_counter()
        solution = self._solver.solve(problem, free)
        seconds = time.perf_counter() - begin
        if not self._running_since_start:
            require_not_refused(solution, self._stack)
        reason = fault_of(solution, self._accepted, robot.nv)
        x = solution.x
        if reason or x is None:
            return self._fail(robot, dt, reason, problem, solution, seconds)
        scale = self._scale(robot, dt, motion, problem, x)
        answer = scale * x
        answer.flags.writeable = False
        for reference in self._references:
            reference.deliver(robot, answer)
        self._rate = (answer - self._sent) / dt
        self._last, self._sent, self._running_since_start = answer, answer, True
        return Command(answer, Mode.RUNNING, "", problem, solution, scale, seconds)

    def _restart(self) -> None:
        self._mode, self._reason, self._elapsed = Mode.RUNNING, "", 0.0
        self._running_since_start = False
        self._last = self._sent = self._rate = np.zeros(0)
        self._sensor.reset()
        self._solver.reset()

    def _fail(
        self,
        robot: Robot,
        dt: float,
        reason: str,
        problem: Problem | None = None,
        solution: Solution | None = None,
        seconds: float = 0.0,
    ) -> Command:
        self._mode, self._reason, self._elapsed = Mode.HOLDING, reason, 0.0
        return self._hold(robot, dt, problem, solution, seconds)

    def _hold(
        self, robot: Robot, dt: float, problem: Problem | None, solution: Solution | None, seconds: float
    ) -> Command:
        self._elapsed += dt
        share = max(0.0, 1.0 - self._elapsed / self._stop_time)
        # The last period of the ramp ends it even where the periods do not add up exactly.
        if share * self._stop_time < 1e-6 * dt:
            share = 0.0
        v = share * self._last
        scale = 1.0
        if v.any():
            try:
                rows = problem if problem is not None else self._stack.problem(robot, dt, self._sent, self._rate)
                scale = self._scale(robot, dt, self._sent, rows, v)
            except HqpError:
                scale = 0.0  # limits that cannot be told are met by standing still
            v = scale * v
        if not v.any():
            v = np.zeros(robot.nv)
            self._mode = Mode.STOPPED
        v.flags.writeable = False
        self._rate = (v - self._sent) / dt
        self._sent = v
        return Command(v, self._mode, self._reason, problem, solution, scale, seconds)

    def _scale(self, robot: Robot, dt: float, motion: FloatArray, problem: Problem, x: FloatArray) -> float:
        """The largest factor in [0, 1] with which x meets the hard rows and `scale_into`."""
        scale = 1.0
        if problem.hard is not None:
            scale = _shortened(x, problem.hard.A, problem.hard.lower, problem.hard.upper)
        if self._scale_into:
            if self._scale_rows is None or self._scale_rows.robot is not robot:
                self._scale_rows = StackRows(self._scale_into, robot, True, repr)
            scale = min(scale, _shortened(x, *self._scale_rows.rows(dt, motion, self._rate)))
        return scale

    def __repr__(self) -> str:
        return f"InteractionController({self._stack!r}, {self._solver.name}, {self._mode.name})"


def _shortened(x: FloatArray, A: FloatArray, lower: FloatArray, upper: FloatArray) -> float:
    """The largest s in [0, 1] with lower <= s A x <= upper, over the two-sided rows that 0 meets."""
    value = A.dot(x)
    bound = np.where(value > 0.0, upper, -lower)
    size = np.abs(value)
    over = (size > bound) & (lower <= 0.0) & (upper >= 0.0) & (lower < upper)
    if not over.any():
        return 1.0
    # At a bound of 0 a rounding error of the solver is no reason to stand still.
    over &= (bound > BOUND_TOLERANCE) | (size > bound + BOUND_TOLERANCE)
    if not over.any():
        return 1.0
    factor = float((bound[over] / size[over]).min())
    return max(0.0, math.nextafter(factor, 0.0))
