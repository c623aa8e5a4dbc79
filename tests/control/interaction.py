"""Controllers for the tests: two levels that press and hold, readings that live, a solver that fails when it is told to."""

import dataclasses
from typing import ClassVar

import numpy as np

import hqp_rp
from hqp_rp import Solution, Solver, Status
from hqp_rp.control import ForceReference, ImpedanceReference, InteractionController, Stack, WrenchSensor
from tests.control.chain import random_chain

DT = 1e-3
AXES = ("y", "z", "rx", "ry", "rz")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Failing(Solver):
    """The null-space answer, until call number `at`; from then on what `how` says."""

    name: ClassVar[str] = "failing"
    summary: ClassVar[str] = "for tests"
    source: ClassVar[str] = "none"
    takes_inequalities: ClassVar[bool] = True
    takes_hard: ClassVar[bool] = True

    at: int = 10
    how: str = "no x"
    calls: list = dataclasses.field(default_factory=list, compare=False)

    def solve(self, problem, secondary=None):
        self.calls.append(1)
        soft = hqp_rp.Problem.from_stacked(problem.matrix, problem.lower, problem.upper, problem.offsets)
        x = hqp_rp.solve(soft, "null_space").x
        if len(self.calls) <= self.at:
            return Solution(problem, x)
        return {
            "no x": Solution(problem, None, Status.NOT_FINITE, message="It overflowed."),
            "nan": Solution(problem, np.full(problem.n, np.nan)),
            "iterations": Solution(problem, x, Status.ITERATION_LIMIT),
            "infeasible": Solution(problem, x, Status.INFEASIBLE),
            "inaccurate": Solution(problem, x, Status.INACCURATE),
            "too fast": Solution(problem, 100.0 * x),
        }[self.how]


def press(robot, feedback="commanded"):
    force = ForceReference("tool", 15.0, 150.0, 30.0, axes="x", feedback=feedback)
    return force, ImpedanceReference("tool", robot.pose("tool"), 15.0, 150.0, 100.0, axes=AXES, feedback=feedback)


def living(k, force=0.0):
    """A reading that changes a little every time, as one with noise does."""
    return np.array([force + 1e-6 * np.sin(k + 1.0), 0, 0, 0, 0, 0])


def make(robot, solver="reverse_priority", levels=None, limits=(), **settings):
    sensor = WrenchSensor("tool", measures="on_environment", expressed_in="world")
    stack = Stack(list(press(robot) if levels is None else levels), limits=list(limits))
    return InteractionController(stack, sensor, solver, **settings)


def run(controller, robot, steps, reading=living, **motion):
    commands = []
    for k in range(steps):
        commands.append(controller.step(robot, reading(k), DT, **motion))
        robot.update(robot.integrate(robot.q, commands[-1].v, DT))
    return commands


def robot_with_speed_limit(limit=5.0, seed=0):
    robot = random_chain(np.random.default_rng(seed))
    robot.velocity_limit = np.full(7, limit)
    return robot
