"""One solver that moves one robot: the problem of each step, its answer, what the answer did, and the move."""

from __future__ import annotations

import copy
import dataclasses
import time
from typing import Any

import numpy as np

from hqp_rp.control._coordinates import coordinate_index
from hqp_rp.control._sampling import within_limits
from hqp_rp.control.command import Mode, fault_of
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.stack import Stack
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.damping import Damping, ErrorDamping, LevelDamping, NoDamping, checked_level_damping
from hqp_rp.core.diagnostics import ACTIVE_TOLERANCE, norm, row_norms, spectra
from hqp_rp.core.errors import HqpError, SettingError
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.row_names import row_names
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver
from hqp_rp.robot.robot import Robot

FASTEST = 3.0
"""rad/s or m/s, how fast a joint is moved at most where its robot states no limit."""

_BRAKES = 20.0  # rad/s^2 or m/s^2, while no answer comes


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ArmState:
    """What one solver did at one step.

    Attributes:
        q: (nq,) the configuration that the problem was stated at.
        speed: |x| of the answer, rad/s and m/s as they come; nan where there was none.
        share: in [0, 1]: the robot was moved by this share of the answer, so that no joint goes faster than it can.
        mode: of the control loop (`hqp_rp.control.command.Mode`).
        status: name of the solver's status; empty where it was not asked. reason: why the loop does not run, or empty.
        error: (p,) norm of the errors of each level's tasks, m and rad as they come; nan for a level without one.
        residual: (p,) what the answer misses of each level, in the unit of its rows; nan where there was no answer.
        rank: (p,) rank that each level has in the null space of those before. rows: (p,) how many rows it has.
        sigma_min: (p,) the smallest singular value there.
        limits: what is at a bound or beyond, in words: rows of the problem, and joints that stand at their stops.
        bounded: how many rows of the problem are inequalities.
        solve_time: s, of the solver's call.
    """

    q: FloatArray
    speed: float
    share: float
    mode: Mode
    status: str
    reason: str
    error: FloatArray
    residual: FloatArray
    rank: FloatArray
    rows: FloatArray
    sigma_min: FloatArray
    limits: tuple[str, ...]
    bounded: int
    solve_time: float


class Arm:
    """A robot of its own, a stack on it, and the solver that moves it.

    Args:
        robot: is moved. stack: for it. solver: any. dt: > 0, s.

    Raises `SettingError` for a damping that the solver does not take, `HqpError` as the stack.
    """

    def __init__(self, robot: Robot, stack: Stack, solver: Solver, dt: float) -> None:
        self.robot, self.dt = robot, dt
        self._given, self._index = stack, coordinate_index(robot, "moving a robot")
        self._own, self._with_limits = solver, False
        self._damping: LevelDamping | None = None
        self._fastest = np.where(np.isfinite(robot.velocity_limit), robot.velocity_limit, FASTEST)
        self._build()

    @property
    def stack(self) -> Stack:
        """The stack as it is solved, with the damping and the limits that were chosen."""
        return self._stack

    @property
    def solver(self) -> Solver:
        """The solver as it is used, with the damping that was chosen."""
        return self._solver

    @property
    def fastest(self) -> FloatArray:
        """(nv,) rad/s or m/s, how fast each joint is moved at most."""
        return self._fastest

    @property
    def label(self) -> str:
        """The solver's name, its settings that are not the default, and what damps the levels of its stack."""
        damping = [policy for policy in self._stack.damping if policy is not None]
        return called(self._solver) + (f", levels damped by {damping[0]!r}" if damping else "")

    def choose(
        self, solver: Solver | None = None, damping: LevelDamping | None = None, *, joint_limits: bool | None = None
    ) -> None:
        """Go on with this solver and this damping; None leaves the solver, and of damping, takes what was given.

        joint_limits: whether the robot's joint limits are hard rows of the stack.

        Raises `SettingError` where the solver takes no such damping; all stays as it was.
        """
        before = self._own, self._damping, self._with_limits
        self._own = solver or self._own
        self._damping = damping
        self._with_limits = self._with_limits if joint_limits is None else joint_limits
        try:
            self._build()
        except HqpError:
            self._own, self._damping, self._with_limits = before
            self._build()
            raise

    def _build(self) -> None:
        solver, policy = damped(self._own, self._damping)
        given = self._given
        has_limit = any(isinstance(limit, JointLimit) for limit in given.limits)
        limits = [*given.limits, *([JointLimit()] if self._with_limits and not has_limit else [])]
        damping = given.damping if policy is None else policy
        self._stack = Stack(given.levels, limits, names=given.names, damping=damping, metric=given.metric)
        self._solver = copy.copy(solver)  # what one arm's solver keeps between calls is not the other's
        self.rest()

    def rest(self) -> None:
        """Begin again from rest."""
        self._velocity = np.zeros(self.robot.nv)
        self._rate = np.zeros(self.robot.nv)
        self._solver.reset()

    def step(self, *, moving: bool = True) -> ArmState:
        """Solve at the robot's current configuration, say what the answer did, and move the robot by dt.

        moving: False leaves the robot where it is.
        """
        robot, q = self.robot, self.robot.q
        problem: Problem | None = None
        solution: Solution | None = None
        seconds = 0.0
        try:
            problem = self._stack.problem(robot, self.dt, self._velocity, self._rate)
            begin = time.perf_counter()
            solution = self._solver.solve(problem)
            seconds = time.perf_counter() - begin
            reason = fault_of(solution, (Status.SOLVED, Status.INACCURATE), robot.nv)
        except HqpError as error:
            reason = str(error)
        answer = None if reason or solution is None else solution.x
        judged = _judged(problem, solution if answer is not None else None, len(self._stack.names))
        errors = self._errors()
        v = self._braked() if answer is None else answer
        share = float(np.min(self._fastest / np.maximum(np.abs(v), self._fastest), initial=1.0))
        stops = self._move(share * v) if moving else ()
        return ArmState(
            q=q,
            speed=float("nan") if answer is None else norm(answer),
            share=share,
            mode=Mode.RUNNING if answer is not None else Mode.HOLDING if v.any() else Mode.STOPPED,
            status="" if solution is None else solution.status.name,
            reason=reason,
            error=errors,
            **judged,
            limits=(*(() if problem is None or answer is None else rows_at_bounds(problem, answer)), *stops),
            bounded=0 if problem is None else _bounded(problem),
            solve_time=seconds,
        )

    def _braked(self) -> FloatArray:
        """(nv,) the velocity before, shortened as far as no joint's brakes forbid."""
        size = float(np.abs(self._velocity).max(initial=0.0))
        return self._velocity * max(0.0, 1.0 - _BRAKES * self.dt / size) if size else self._velocity

    def _move(self, v: FloatArray) -> tuple[str, ...]:
        """Move by v dt as far as the joints go; which of them stand at their stops."""
        q, free = self.robot.q, self.robot.integrate(self.robot.q, v, self.dt)
        inside = within_limits(self.robot, free, self._index)
        stopped = np.flatnonzero(np.abs(self.robot.difference(free, inside)) > 1e-12)
        moved = self.robot.difference(q, inside) / self.dt
        self._velocity, self._rate = moved, (moved - self._velocity) / self.dt
        self.robot.update(inside)
        return tuple(f"{name} at its stop" for name in _joints(self.robot, stopped))

    def _errors(self) -> FloatArray:
        found = np.full(len(self._stack.names), np.nan)
        for k, items in enumerate(self._stack.levels):
            errors = [item.error(self.robot) for item in items if isinstance(item, FeedbackTask)]
            if errors:
                found[k] = norm(np.concatenate(errors))
        return found

    def __repr__(self) -> str:
        return f"Arm({self._solver!r} on {self._stack!r})"


def damped(solver: Solver, damping: LevelDamping | None) -> tuple[Solver, LevelDamping | None]:
    """The solver with this damping where it has one of its own, and otherwise what its stack's levels are to be damped by.

    None leaves both as they are. Raises `SettingError` for a solver that takes neither, or not this one.
    """
    if damping is None:
        return solver, None
    checked_level_damping(damping)
    if isinstance(getattr(solver, "damping", None), Damping) and not isinstance(damping, ErrorDamping):
        changed: Any = {"damping": damping}
        return dataclasses.replace(solver, **changed), None
    if solver.takes_damping:
        return solver, damping
    if isinstance(damping, NoDamping):
        return solver, None
    raise SettingError(
        f"{solver.name} takes no {type(damping).__name__}: it has no such damping of its own and none by level. Take damping "
        "as given, or another solver, such as hierarchical_active_set."
    )


def called(solver: Solver) -> str:
    """The solver's name, with the settings that are not the default."""
    changed = [
        f"{field.name} {getattr(solver, field.name)!r}"
        for field in dataclasses.fields(solver)
        if field.init and repr(getattr(solver, field.name)) != repr(field.default)
    ]
    return f"{solver.name} ({', '.join(changed)})" if changed else str(solver.name)


def rows_at_bounds(problem: Problem, x: FloatArray) -> tuple[str, ...]:
    """The inequality rows of `problem` that are at a bound or beyond at x (n,), in words; judged from the two alone."""
    words = []
    hard = problem.hard
    if hard is not None and hard.m:
        names = row_names(problem)
        words += [f"{names[i]} {side}" for i, side in _at_bounds(hard, x)]
    for level in problem.levels:
        words += [f"{level.name}[{i}] {side}" for i, side in _at_bounds(level, x)]
    return tuple(words)


def _at_bounds(level: Level, x: FloatArray) -> list[tuple[int, str]]:
    value = level.A @ x
    with np.errstate(invalid="ignore"):
        reach = ACTIVE_TOLERANCE * (row_norms(level.A) * norm(x))
        upper = value >= level.upper - reach - ACTIVE_TOLERANCE * np.abs(level.upper)
        lower = value <= level.lower + reach + ACTIVE_TOLERANCE * np.abs(level.lower)
    bounded = level.lower < level.upper
    sides = [
        (upper & bounded & np.isfinite(level.upper), "upper"),
        (lower & bounded & np.isfinite(level.lower), "lower"),
    ]
    return [(int(i), side) for rows, side in sides for i in np.flatnonzero(rows)]


def _bounded(problem: Problem) -> int:
    levels = [level for level in (problem.hard, *problem.levels) if level is not None]
    return sum(int((level.lower < level.upper).sum()) for level in levels)


def _judged(problem: Problem | None, solution: Solution | None, p: int) -> dict[str, FloatArray]:
    """residual, rank, rows and sigma_min of each level: from the answer, or from the problem alone where there is none."""
    nothing = np.full(p, np.nan)
    if problem is None:
        return dict.fromkeys(("residual", "rank", "rows", "sigma_min"), nothing)
    found = spectra(problem) if solution is None else solution.levels
    return {
        "residual": nothing if solution is None else np.array([level.residual for level in solution.levels]),
        "rank": np.array([float(level.rank) for level in found]),
        "rows": np.array([float(level.m) for level in problem.levels]),
        "sigma_min": np.array([level.sigma_min for level in found]),
    }


def _joints(robot: Robot, indices: Any) -> list[str]:
    """What the velocities of these indices are called."""
    if len(robot.joint_names) == robot.nv:
        return [robot.joint_names[i] for i in indices]
    return [f"velocity {i}" for i in indices]
