"""What the scenarios with limits share: a robot that moves as it is told, and what its limits and its levels had to bear."""

from __future__ import annotations

import abc
import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar, Self

import numpy as np

from hqp_rp.control.stack import Stack
from hqp_rp.core.diagnostics import norm
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.solution import Status
from hqp_rp.core.solver import Solver
from hqp_rp.robot.robot import Robot
from hqp_rp.scenarios.scenario import Scenario, Step, timed_solve

IDEAL_ROBOT = (
    "The robot moves exactly as its servos are told: no lag, flexibility, noise or contact forces, and no dynamics beyond "
    "the bounds on velocity and acceleration.",
    "Each solver is judged on the configurations that its own motion leads to, so that two solvers soon face different "
    "problems.",
)
"""What no scenario of this kind can tell."""


@dataclasses.dataclass(frozen=True, slots=True)
class Scene:
    """A robot, what it is asked, and where it starts; made anew for every run.

    Attributes:
        robot: moved by the run.
        start: (nq,) where every case begins, at rest.
        stacks: case -> the stack that is solved in it, in the order in which they are run.
        refer: `refer(time)` writes the references of that time (s) into the tasks.
        errors: label with unit -> how far the level misses its reference at the robot's configuration.
        speed, acceleration: (nv,) the limits, rad/s and rad/s^2, infinite for none.
        distance: m, the smallest distance that is watched, at the robot's configuration; None where there is none.
        margin: m, the distance to keep.
    """

    robot: Robot
    start: FloatArray
    stacks: Mapping[str, Stack]
    refer: Callable[[float], None]
    errors: Mapping[str, Callable[[], float]]
    speed: FloatArray
    acceleration: FloatArray
    distance: Callable[[], float] | None = None
    margin: float = 0.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class Limited(Scenario):
    """A robot is moved by the answers, one every period, and the limits are watched from outside.

    At the start of every period the stack is solved; x goes to velocity servos that follow it exactly but clip each joint to
    its velocity limit V, and the joints move on for one period. Without an x every joint brakes at its acceleration limit A.
    A refusal is yielded, with nothing measured, and ends its case.

    Args:
        duration: s. period: s between two solves.

    `Step.parameter` is the time at which the problem is posed. `Step.measured`, of the period that it acts for, with u' the
    joint velocities before, q the configuration at its end, l and u the position limits:

        "position limit violation [rad]": largest max(l - q, q - u, 0) of a joint;
        "position limit violation left [rad]": largest part of it that has been there since the start without interruption;
        "position limit violation added [rad]": largest part of it that has not: a start outside is not the solver's fault;
        "velocity limit violation [rad/s]": largest max(|x| - V, 0), as asked for, before the servos clip it;
        "acceleration limit violation [rad/s^2]": largest max(|w - u'| / dt - A, 0), w the clipped command;
        "commanded speed [rad/s]": ||x||, 0 without an x;
        "velocity change [rad/s]": largest |w - u'| of a joint from one period to the next;
        "smallest distance [m]" and "distance violation [m]", max(margin - distance, 0), where distances are watched;
        and the errors of the levels at the end of the period.

    Violations are as measured: rounding of about 1e-12 is not taken off.

    Raises:
        SettingError: a setting out of its range.
    """

    abscissa: ClassVar[str] = "time (s)"
    by_default: ClassVar[bool] = False  # another question than that of the main comparison
    without_limits: ClassVar[str] = "no limits"
    """The case whose problem holds no limit: what breaks there, nobody was told of."""

    duration: float = 4.0
    period: float = 0.02

    def __post_init__(self) -> None:
        for name in ("duration", "period"):
            self.require(name, lambda value: value > 0.0, "> 0")
        if self.duration < 2.0 * self.period:
            raise SettingError(
                f"duration is {self.duration:g} s, period is {self.period:g} s; a run needs at least two periods."
            )

    @abc.abstractmethod
    def scene(self, seed: int) -> Scene:
        """The robot, its start and its stacks for that seed."""

    @abc.abstractmethod
    def cases(self) -> tuple[str, ...]:
        """The cases, in the order in which they are run: the keys of `Scene.stacks`."""

    def periods(self) -> int:
        """Number of control periods of one case."""
        return max(2, round(self.duration / self.period))

    def length(self) -> int:
        return len(self.cases()) * self.periods()

    def quick(self) -> Self:
        """The same motion with control periods four times as long."""
        return dataclasses.replace(self, period=min(4.0 * self.period, 0.5 * self.duration))

    def steps(self, solver: Solver, seed: int) -> Iterator[Step]:
        scene = self.scene(seed)
        for case, stack in scene.stacks.items():
            yield from self._run(case, stack, scene, solver)

    def _run(self, case: str, stack: Stack, scene: Scene, solver: Solver) -> Iterator[Step]:
        robot, dt = scene.robot, self.period
        q, velocity = scene.start.copy(), np.zeros(robot.nv)
        solver.reset()
        robot.update(q)
        left = _beyond_range(robot)
        for k in range(self.periods()):
            scene.refer(k * dt)
            problem = stack.problem(robot, dt, velocity)
            solution, seconds = timed_solve(solver, problem)
            if solution.status is Status.REFUSED:
                yield Step(case, k * dt, problem, solution, seconds)
                return
            x = solution.x
            if x is None or not np.isfinite(x).all():
                x = np.zeros(robot.nv)
                brake = np.where(np.isfinite(scene.acceleration), scene.acceleration * dt, np.abs(velocity))
                command = np.copysign(np.maximum(np.abs(velocity) - brake, 0.0), velocity)
            else:
                command = np.clip(x, -scene.speed, scene.speed)
            q = robot.integrate(q, command, dt)
            robot.update(q)
            scene.refer((k + 1) * dt)
            beyond = _beyond_range(robot)
            measured = {
                "position limit violation [rad]": _most(beyond),
                "position limit violation left [rad]": _most(np.minimum(beyond, left)),
                "position limit violation added [rad]": _most(beyond - left),
            }
            left = np.minimum(beyond, left)
            measured |= _violations(scene, x, command, velocity, dt)
            measured |= {label: error() for label, error in scene.errors.items()}
            velocity = command
            yield Step(case, k * dt, problem, solution, seconds, measured)

    def require_gains(self, *names: str) -> None:
        """Raise `SettingError` unless each of these settings is a gain in 1/s that one period does not overshoot with."""
        top = 1.0 / self.period
        for name in names:
            self.require(name, lambda value: 0.0 <= value <= top, f"in [0, 1 / period] = [0, {top:g}]")

    def require(self, name: str, allowed: Callable[[Any], bool], sign: str) -> None:
        """Raise `SettingError` unless the setting is a finite number that is allowed."""
        value = getattr(self, name)
        number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if not number or not allowed(value):
            raise SettingError(f"{name} of {self.name} is {value!r}; it must be a finite number {sign}.")


def _violations(scene: Scene, x: FloatArray, command: FloatArray, before: FloatArray, dt: float) -> dict[str, float]:
    change = np.abs(command - before) / dt
    found = {
        "velocity limit violation [rad/s]": _most(np.abs(x) - scene.speed),
        "acceleration limit violation [rad/s^2]": _most(change - scene.acceleration),
        "commanded speed [rad/s]": norm(x),
        "velocity change [rad/s]": _most(np.abs(command - before)),
    }
    if scene.distance is not None:
        distance = scene.distance()
        found["smallest distance [m]"] = distance
        found["distance violation [m]"] = max(scene.margin - distance, 0.0)
    return found


def _beyond_range(robot: Robot) -> FloatArray:
    """(nv,) by how much each joint position is outside its limits, rad; hinges and slides come last in q, each one number."""
    q = robot.q[robot.nq - robot.nv :]
    return np.maximum(np.maximum(robot.lower - q, q - robot.upper), 0.0)


def _most(beyond: FloatArray) -> float:
    return max(0.0, float(beyond.max()))


def out_and_back(time: float, duration: float) -> tuple[float, float]:
    """A path parameter that goes from 0 to 1 and back, and its rate in 1/s.

    It rises over 30 % of the duration, rests 25 %, falls over 30 % and rests to the end. Each way is the quintic of least
    jerk, at rest at both ends (Flash and Hogan 1985).
    """
    way = 0.3 * duration
    leg, sign = (time, 1.0) if time < 0.5 * duration else (0.85 * duration - time, -1.0)
    s = min(max(leg / way, 0.0), 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s), sign * 30.0 * (s * (1.0 - s)) ** 2 / way
