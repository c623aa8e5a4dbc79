"""The control loop around a torque stack: a torque within its limits at every step, against gravity where no answer comes."""

from __future__ import annotations

import dataclasses
import math
import time

from numpy.typing import ArrayLike

from hqp_rp.control._checks import positive_number, real_array
from hqp_rp.control._refusal import require_not_refused, require_taken
from hqp_rp.control.activation import blend
from hqp_rp.control.command import Mode, fault_of
from hqp_rp.control.inverse_dynamics import InverseDynamics
from hqp_rp.control.torque_stack import TorqueStack
from hqp_rp.core._native import torque_within
from hqp_rp.core.errors import HqpError, SettingError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver, get_solver
from hqp_rp.robot.robot import Robot


@dataclasses.dataclass(slots=True, eq=False)
class TorqueCommand:
    """One control step.

    Attributes:
        torque: (d,) of the driven velocities, N m or N; always finite and within the limits, read-only.
        mode: RUNNING, or HOLDING while no answer can be used.
        reason: why it holds, as a sentence; empty while it runs.
        dynamics: how the answer became torques; None while it holds.
        problem, solution: what was asked and answered, or None.
        solve_time: s, wall clock of the solver's calls alone.
    """

    torque: FloatArray
    mode: Mode
    reason: str = ""
    dynamics: InverseDynamics | None = None
    problem: Problem | None = None
    solution: Solution | None = None
    solve_time: float = 0.0

    @property
    def acceleration(self) -> FloatArray | None:
        """(nv,) that the answer expects, rad/s^2 or m/s^2; None while it holds."""
        x = self._x
        return None if x is None or self.dynamics is None else self.dynamics.acceleration(x)

    @property
    def forces(self) -> FloatArray | None:
        """(F,) N, that the answer expects at the contacts' points; None while it holds."""
        x = self._x
        return None if x is None or self.dynamics is None else self.dynamics.forces(x)

    @property
    def _x(self) -> FloatArray | None:
        return None if self.solution is None else self.solution.x


class TorqueController:
    """Runs a `TorqueStack` with any solver, and always has a finite torque within the limits.

    ::

        controller = TorqueController(stack, "hierarchical_active_set")
        command = controller.step(robot, dt, v)     # at every control period, after robot.update(q)
        send(command.torque)

    While a contact's activation is between 0 and 1, the answers with and without its motion rows are blended
    (`hqp_rp.control.blend`), so that contacts come and go without a jump. **When the solver does not answer** (no x,
    one that is
    not finite, a status other than SOLVED or, with `accept_inaccurate`, INACCURATE; a solver that raises; rows or a measured v
    that are not finite) the torque compensates gravity and brakes::

        tau = S (g - J_c^T f - braking diag(M) v)      f: least squares of what carries the velocities that are not
        driven, f_z >= 0

    cut to the limits, until the solver answers again. What fails before the first good answer, but for a solver's status other
    than REFUSED, is raised.

    Args:
        stack: the stack. solver: a `Solver`, or its name; it must take hard rows.
        braking: 1/s, >= 0.
        accept_inaccurate: whether an answer of status INACCURATE is used.

    Raises:
        SettingError: a value out of its range; a solver that refuses the stack's problems (limits, contacts, damped levels, a
            metric, ...), in its own words. UnknownNameError: no solver of that name.
    """

    __slots__ = ("_accepted", "_began", "_braking", "_failures", "_solver", "_stack")

    def __init__(
        self, stack: TorqueStack, solver: str | Solver, *, braking: float = 5.0, accept_inaccurate: bool = True
    ) -> None:
        if not isinstance(stack, TorqueStack):
            raise SettingError(f"stack is a {type(stack).__name__}; give a TorqueStack.")
        given = real_array(braking, "braking")
        if given.ndim or not 0.0 <= float(given) < math.inf:
            raise SettingError(f"braking is {braking!r}; it must be a finite number >= 0, in 1/s.")
        self._stack, self._solver, self._braking = stack, get_solver(solver), float(given)
        require_taken(self._solver, stack)
        self._accepted = (Status.SOLVED, Status.INACCURATE) if accept_inaccurate else (Status.SOLVED,)
        self.reset()

    @property
    def failures(self) -> int:
        """At how many steps in a row no answer could be used."""
        return self._failures

    def reset(self) -> None:
        """Begin again; the solver forgets its warm start."""
        self._began, self._failures = False, 0
        self._solver.reset()

    def step(
        self, robot: Robot, dt: float, v: ArrayLike, a: ArrayLike | None = None, *, applied: ArrayLike | None = None
    ) -> TorqueCommand:
        """The torques for the next dt seconds; arguments as of `TorqueStack.problem`.

        Raises `HqpError` for misuse before the first good answer; for a dt that is not > 0 always.
        """
        if type(dt) is not float or not 0.0 < dt < math.inf:
            dt = positive_number(dt, "dt")
        problem: Problem | None = None
        solution: Solution | None = None
        dynamics: InverseDynamics | None = None
        seconds = 0.0
        try:
            problem = self._stack.problem(robot, dt, v, a, applied=applied)
            dynamics = self._stack.dynamics(problem)
            begin = time.perf_counter()
            if dynamics.degrees is None:
                solution = self._solver.solve(problem)
            else:
                solution = blend(problem, self._solver, rows=dynamics.degrees)
            seconds = time.perf_counter() - begin
            if not self._began:
                require_not_refused(solution, self._stack)
            reason = fault_of(solution, self._accepted, problem.n)
        except HqpError as error:
            if not self._began:
                raise
            reason = str(error)
        except Exception as error:  # a fault in a solver or a task must not leave a robot without a torque
            if not self._began:
                raise
            reason = f"{type(error).__name__}: {error}"
        if not reason and solution is not None and solution.x is not None and dynamics is not None:
            x = solution.x
            # Cut to the limits: an answer may pass its hard rows by rounding.
            torque = torque_within(dynamics.map, x, dynamics.offset, dynamics.limit)
            if torque is not None:
                self._began, self._failures = True, 0
                return TorqueCommand(torque, Mode.RUNNING, "", dynamics, problem, solution, seconds)
            reason = "The solver failed: the torques of its x are not finite."
        self._failures += 1
        torque = self._stack.holding_torque(robot, v, self._braking)
        return TorqueCommand(torque, Mode.HOLDING, reason, None, problem, solution, seconds)

    def hold(self, robot: Robot, v: ArrayLike, reason: str = "hold() was called.") -> TorqueCommand:
        """Compensate gravity and brake without asking the solver, as `step` does where no answer comes.

        For whoever knows that no answer may be sent now. Call it at every period for as long as that lasts; `step` goes on.

        Args:
            robot: at its current configuration. v: (nv,) measured velocity, rad/s or m/s; what is not finite counts as 0.
            reason: a sentence, that the command then says.

        Raises `SettingError` for a reason that is no words, `RobotError` as `TorqueStack.problem`.
        """
        if not isinstance(reason, str) or not reason:
            raise SettingError(f"reason is {reason!r}; give a sentence that says why the robot shall hold.")
        return TorqueCommand(self._stack.holding_torque(robot, v, self._braking), Mode.HOLDING, reason)

    def __repr__(self) -> str:
        return f"TorqueController({self._stack!r}, {self._solver.name})"
