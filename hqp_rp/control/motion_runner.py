"""The control loop around a stack without force: a velocity at every step, and a straight stop when no answer comes."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import finite_vector, positive_number, real_array
from hqp_rp.control.interaction_controller import Command, Mode
from hqp_rp.control.stack import Stack
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

    While the solver answers, the command is its x. **When it does not** (no x, one that is not finite, a status other than
    SOLVED or, with `accept_inaccurate`, INACCURATE; rows that are not finite) the runner holds: the last command goes to
    zero on a straight line, `v <- (1 - s) v` with the largest s <= 1 that no joint's `acceleration` forbids,
    `s = min_j a_j dt / |v_j|`, until the solver answers again, or until it stands: then it is stopped until `reset`.
    Velocities only get smaller, so velocity limits stay kept; position limits are met where the stack's `JointLimit` has the
    same acceleration. `Stack.problem` is told the last command as the velocity before, so that limits on accelerations hold
    across steps. Errors of misuse before the first good answer are raised.

    Args:
        stack: any stack. solver: a `Solver`, or its name.
        acceleration: rad/s^2 or m/s^2, > 0: one number, or one for each velocity.
        accept_inaccurate: whether an answer of status INACCURATE is used.

    Raises:
        SettingError: a value out of its range. UnknownNameError: no solver of that name.
    """

    __slots__ = ("_acceleration", "_accepted", "_began", "_mode", "_reason", "_sent", "_solver", "_stack")

    def __init__(
        self, stack: Stack, solver: str | Solver, *, acceleration: ArrayLike, accept_inaccurate: bool = True
    ) -> None:
        if not isinstance(stack, Stack):
            raise SettingError(f"stack is a {type(stack).__name__}; give a Stack.")
        self._acceleration = real_array(acceleration, "acceleration")
        if self._acceleration.ndim > 1 or not ((self._acceleration > 0.0) & np.isfinite(self._acceleration)).all():
            raise SettingError(
                f"acceleration is {acceleration!r}; it must be > 0 and finite, one number or one a velocity."
            )
        self._stack, self._solver = stack, get_solver(solver)
        self._accepted = (Status.SOLVED, Status.INACCURATE) if accept_inaccurate else (Status.SOLVED,)
        self._sent: FloatArray | None = None
        self.reset()

    @property
    def mode(self) -> Mode:
        """What the runner is doing."""
        return self._mode

    @property
    def reason(self) -> str:
        """Why it does not run, as a sentence; empty while it runs."""
        return self._reason

    def reset(self, v: ArrayLike | None = None) -> None:
        """Begin, or begin again after a stop, from the velocity v (nv,), rad/s or m/s; None for a robot at rest."""
        self._mode, self._reason, self._began = Mode.RUNNING, "", False
        self._sent = None if v is None else finite_vector(v, np.size(v), "v", "rad/s or m/s")
        self._solver.reset()

    def step(self, robot: Robot, dt: float) -> Command:
        """The velocity for the next dt seconds. Raises `HqpError` for misuse before the first good answer."""
        dt = positive_number(dt, "dt")
        before = np.zeros(robot.nv) if self._sent is None else self._sent
        if self._acceleration.ndim and len(self._acceleration) != robot.nv:
            raise SettingError(f"acceleration has {len(self._acceleration)} numbers; the robot has nv = {robot.nv}.")
        if self._mode is Mode.STOPPED:
            return self._brake(before, dt, self._reason, None, None, 0.0)
        try:
            problem = self._stack.problem(robot, dt, before)
        except HqpError as error:
            if not self._began:
                raise
            return self._brake(before, dt, str(error), None, None, 0.0)
        begin = time.perf_counter()
        solution = self._solver.solve(problem)
        seconds = time.perf_counter() - begin
        x = solution.x
        if x is None or solution.status not in self._accepted or not np.isfinite(x).all():
            reason = f"The solver failed: {solution.status.value} {solution.message}".rstrip()
            return self._brake(before, dt, reason, problem, solution, seconds)
        answer = x.copy()
        answer.flags.writeable = False
        self._sent, self._mode, self._reason, self._began = answer, Mode.RUNNING, "", True
        return Command(answer, Mode.RUNNING, "", problem, solution, 1.0, seconds)

    def _brake(
        self,
        before: FloatArray,
        dt: float,
        reason: str,
        problem: Problem | None,
        solution: Solution | None,
        seconds: float,
    ) -> Command:
        moving = before != 0.0
        most = np.broadcast_to(self._acceleration * dt, before.shape)
        share = 1.0 - min(1.0, float((most[moving] / np.abs(before[moving])).min(initial=1.0)))
        v = share * before
        v.flags.writeable = False
        self._sent, self._reason = v, reason
        self._mode = Mode.HOLDING if v.any() else Mode.STOPPED
        return Command(v, self._mode, reason, problem, solution, share, seconds)

    def __repr__(self) -> str:
        return f"MotionRunner({self._stack!r}, {self._solver.name}, {self._mode.name})"
