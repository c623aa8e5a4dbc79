"""The control loop around a stack without force: a velocity at every step, and a straight stop when no answer comes."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import finite_vector, positive_number, real_array
from hqp_rp.control._refusal import require_not_refused, require_taken
from hqp_rp.control.acceleration_stack import AccelerationStack
from hqp_rp.control.command import Command, Mode, conflict_reason, fault_of
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.stack import Stack
from hqp_rp.core._native import stop_change
from hqp_rp.core.errors import HqpError, SettingError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver, get_solver
from hqp_rp.robot.robot import Robot


class MotionRunner:
    """Runs a stack with any solver, and always has a finite command.

    ::

        runner = MotionRunner(stack, solver, acceleration=10.0)
        command = runner.step(robot, dt)        # at every control period, after robot.update(q)
        send(command.v)

    While the solver answers, the command is its x. **When it does not** (no x, one that is not finite or has another length, a
    status other than SOLVED or, with `accept_inaccurate`, INACCURATE; a solver that raises; rows or a measured v that are not
    finite) the runner holds: the last command goes to zero on a straight line, `v <- (1 - s) v` with the largest s <= 1 that
    no joint's `acceleration` forbids, `s = min_j a_j dt / |v_j|`, until the solver answers again, or until it stands: then it
    is stopped until `reset`. A joint that a hard `JointLimit` of the stack bids to brake sooner does so, each at a_j at most.
    So, while it brakes:

    - no |v_j| grows, and none changes by more than a_j dt: velocity and acceleration stay within what they were;
    - no joint passes a position limit of a hard `JointLimit` whose acceleration is at most a_j, where the answers kept it;
    - collisions, half-spaces and torques are not looked at.

    Where a hard `JointLimit` bounds jerks, the line is given up: each joint stops by itself, by the stop that this limit looks
    ahead to, with the least J of these limits and with a_j. So, while it brakes:

    - no acceleration changes by more than J dt, and no velocity by more than a_j dt; only where an answer asked for more than
      a_j, the first step goes back to a_j, whatever J says;
    - |v_j| may still grow while the joint's acceleration comes to zero, within the V of the limit;
    - no joint passes a position limit of such a limit, on the same condition as above.

    `Stack.problem` is told the last command as the velocity before, or the measured one, and the change between the last two
    commands as the acceleration, so that limits on accelerations and jerks hold across steps. What fails before the first good
    answer, but for a solver's status other than REFUSED, is raised.

    Args:
        stack: any stack. solver: a `Solver`, or its name.
        acceleration: rad/s^2 or m/s^2, > 0: one number, or one for each velocity.
        accept_inaccurate: whether an answer of status INACCURATE is used.

    Raises:
        SettingError: a value out of its range; a solver that refuses the stack's problems (hard limits, damped levels, a
            metric, ...), in its own words. UnknownNameError: no solver of that name.
    """

    __slots__ = (
        "_acceleration",
        "_accepted",
        "_began",
        "_conflict",
        "_failures",
        "_limits",
        "_mode",
        "_problem",
        "_rate",
        "_reason",
        "_sent",
        "_solution",
        "_solver",
        "_stack",
    )

    def __init__(
        self, stack: Stack, solver: str | Solver, *, acceleration: ArrayLike, accept_inaccurate: bool = True
    ) -> None:
        if not isinstance(stack, Stack) or isinstance(stack, AccelerationStack):
            raise SettingError(f"stack is a {type(stack).__name__}; give a Stack: what is sent are velocities.")
        a = self._acceleration = real_array(acceleration, "acceleration")
        if a.ndim > 1 or not a.size or not ((a > 0.0) & np.isfinite(a)).all():
            raise SettingError(
                f"acceleration is {acceleration!r}; it must be > 0 and finite, one number or one a velocity."
            )
        self._stack, self._solver = stack, get_solver(solver)
        require_taken(self._solver, stack)
        self._limits = [limit for limit in stack.limits if isinstance(limit, JointLimit)]
        self._accepted = (Status.SOLVED, Status.INACCURATE) if accept_inaccurate else (Status.SOLVED,)
        self._sent: FloatArray | None = None
        self._rate: FloatArray | None = None
        self._solution: Solution | None = None
        self._problem: Problem | None = None
        self._conflict: Callable[[], str] | None = None  # of the step at which hard rows first could not be met
        self.reset()

    @property
    def mode(self) -> Mode:
        """What the runner is doing."""
        return self._mode

    @property
    def reason(self) -> str:
        """Why it does not run, in words; empty while it runs. Where hard rows contradict each other it is the `Conflict` of the
        first step at which they did, kept until an answer comes."""
        return self._reason if isinstance(self._reason, str) else self._reason()

    @property
    def solution(self) -> Solution | None:
        """What the solver answered when it was last asked, usable or not; None before."""
        return self._solution

    @property
    def problem(self) -> Problem | None:
        """The last problem that was made, in every mode, also where `Command.problem` is None; None before."""
        return self._problem

    @property
    def failures(self) -> int:
        """At how many steps in a row no answer could be used; 0 while it runs. A stopped runner asks no more."""
        return self._failures

    def reset(self, v: ArrayLike | None = None, a: ArrayLike | None = None) -> None:
        """Begin, or begin again after a stop, from the velocity v and the acceleration a (nv,); None for zeros.

        v is in rad/s or m/s, a in rad/s^2 or m/s^2; only limits on jerks look at a.
        """
        self._reason: str | Callable[[], str]
        self._mode, self._reason, self._began = Mode.RUNNING, "", False
        self._failures, self._solution, self._problem, self._conflict = 0, None, None, None
        self._sent = None if v is None else finite_vector(v, np.size(v), "v", "rad/s or m/s")
        self._rate = None if a is None else finite_vector(a, np.size(a), "a", "rad/s^2 or m/s^2")
        self._solver.reset()

    def step(self, robot: Robot, dt: float, v: ArrayLike | None = None) -> Command:
        """The velocity for the next dt seconds.

        Args:
            robot: at its current configuration; `robot.update(q)` sets it.
            dt: > 0, s, the control period.
            v: (nv,) measured velocity, rad/s or m/s, from which limits on accelerations start; None: the last command.

        Raises:
            HqpError: misuse, before the first good answer; a dt that is not > 0 always.
        """
        dt = positive_number(dt, "dt")
        before, rate = self._motion_before(robot)
        if self._mode is Mode.STOPPED:
            return self._brake(robot, before, rate, dt, self._reason, None, None, 0.0)
        problem: Problem | None = None
        solution: Solution | None = None
        seconds = 0.0
        try:
            problem = self._stack.problem(robot, dt, before if v is None else v, rate)
            begin = time.perf_counter()
            solution = self._solver.solve(problem)
            seconds = time.perf_counter() - begin
            if not self._began:
                require_not_refused(solution, self._stack)
            reason = fault_of(solution, self._accepted, robot.nv)
        except HqpError as error:
            if not self._began:
                raise
            reason = str(error)
        except Exception as error:  # a fault in a solver or a task must not leave a moving robot without a command
            if not self._began:
                raise
            reason = f"{type(error).__name__}: {error}"
        told: Callable[[], str] | None = None
        if problem is not None:
            self._problem = problem
        if solution is not None:
            self._solution = solution
            if solution.status is Status.INFEASIBLE and reason:
                if not self._conflict:
                    self._conflict = functools.partial(conflict_reason, solution, reason)
                told = self._conflict
        if reason or solution is None or solution.x is None:
            self._failures += 1
            return self._brake(robot, before, rate, dt, told or reason, problem, solution, seconds)
        answer = solution.x.copy()
        answer.flags.writeable = False
        self._conflict = None
        self._rate = (answer - before) / dt
        self._sent, self._mode, self._reason, self._began, self._failures = answer, Mode.RUNNING, "", True, 0
        return Command(answer, Mode.RUNNING, "", problem, solution, 1.0, seconds)

    def hold(self, robot: Robot, dt: float, reason: str = "hold() was called.") -> Command:
        """Brake during the next dt seconds without asking the solver, as `step` does where no answer comes.

        For whoever knows that no answer may be sent now: a sensor that failed, a person in the way, an emergency stop. Call it
        at every period for as long as that lasts. `step` goes on from the velocity that is left; once the robot stands, the
        runner is stopped until `reset`.

        Args:
            robot: at its current configuration, which position limits are looked at from. dt: > 0, s.
            reason: a sentence, that the command and the runner then say, unless the runner is stopped: the old one stays.

        Raises:
            SettingError: a dt that is not > 0, a reason that is no words.
        """
        dt = positive_number(dt, "dt")
        if not isinstance(reason, str) or not reason:
            raise SettingError(f"reason is {reason!r}; give a sentence that says why the robot shall hold.")
        before, rate = self._motion_before(robot)
        told = self._reason if self._mode is Mode.STOPPED else reason
        return self._brake(robot, before, rate, dt, told, None, None, 0.0)

    def _motion_before(self, robot: Robot) -> tuple[FloatArray, FloatArray]:
        """(nv,) velocity and (nv,) acceleration before this step, seen to fit the robot."""
        if self._acceleration.ndim and len(self._acceleration) != robot.nv:
            raise SettingError(f"acceleration has {len(self._acceleration)} numbers; the robot has nv = {robot.nv}.")
        before = np.zeros(robot.nv) if self._sent is None else self._sent
        if len(before) != robot.nv:
            raise SettingError(f"the velocity before has {len(before)} numbers; the robot has nv = {robot.nv}.")
        rate = np.zeros(robot.nv) if self._rate is None else self._rate
        if len(rate) != robot.nv:
            raise SettingError(f"the acceleration before has {len(rate)} numbers; the robot has nv = {robot.nv}.")
        return before, rate

    def _brake(
        self,
        robot: Robot,
        before: FloatArray,
        rate: FloatArray,
        dt: float,
        reason: str | Callable[[], str],
        problem: Problem | None,
        solution: Solution | None,
        seconds: float,
    ) -> Command:
        most, speed = np.broadcast_to(self._acceleration * dt, before.shape), np.abs(before)
        share = 1.0 - float((most / np.maximum(speed, most)).min(initial=1.0))
        jerk = self._jerk(robot)
        if jerk is None:
            size = np.maximum(np.minimum(share * speed, self._room(robot, before, dt)), speed - most)
            v = np.copysign(np.maximum(size, 0.0), before)
            moving = v.any()
        else:
            steps = zip(before, rate * dt, most, jerk * dt**2, strict=True)
            v = before + np.array([stop_change(*step) for step in steps])
            share = min(1.0, float(np.linalg.norm(v) / max(np.linalg.norm(before), np.finfo(float).tiny)))
            moving = v.any() or (np.abs(v - before) > jerk * dt**2).any()
        v.flags.writeable = False
        self._sent, self._rate, self._reason = v, (v - before) / dt, reason
        self._mode = Mode.HOLDING if moving else Mode.STOPPED
        return Command(v, self._mode, reason, problem, solution, share, seconds)

    def _jerk(self, robot: Robot) -> FloatArray | None:
        """(nv,) the least J of the hard joint limits; None where none bounds jerks."""
        found = [jerk for limit in self._limits if (jerk := limit.jerk_on(robot)) is not None]
        return np.min(found, axis=0) if found else None

    def _room(self, robot: Robot, before: FloatArray, dt: float) -> FloatArray:
        """(nv,) how fast each joint may go on in its direction for the hard joint limits; infinite where none says."""
        room = np.full(robot.nv, np.inf)
        for limit in self._limits:
            try:
                _, lower, upper = limit.rows(robot, dt, before)
            except Exception:  # rows that cannot be made any more: the straight line is what is left
                continue
            room = np.fmin(room, np.maximum(np.where(before > 0.0, upper, -lower), 0.0))
        return room

    def __repr__(self) -> str:
        return f"MotionRunner({self._stack!r}, {self._solver.name}, {self._mode.name})"
