"""What the tests of both crossings share: solvers that misbehave on purpose, and facts of the nominal path."""

from __future__ import annotations

import dataclasses
import itertools
from typing import ClassVar

import numpy as np

from hqp_rp.control.stack import Stack
from hqp_rp.core.diagnostics import Spectrum, spectra
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver
from hqp_rp.robot.mujoco_robot import MujocoRobot
from hqp_rp.scenarios._crossing import Crossing
from hqp_rp.scenarios.scenario import Step


@dataclasses.dataclass(frozen=True, kw_only=True)
class Constant(Solver):
    """Answers every problem with `value` at every joint, or without an x, with the given status."""

    value: float | None = 0.0
    status: Status = Status.SOLVED

    name: ClassVar[str] = "constant"
    summary: ClassVar[str] = "one answer to everything"
    source: ClassVar[str] = "a test"

    def refuses(self, problem: Problem) -> str | None:
        return "No." if self.status is Status.REFUSED else super().refuses(problem)

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        x = None if self.value is None else np.full(problem.n, self.value)
        return Solution(problem, x, self.status)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SometimesNothing(Solver):
    """Least squares on the first level, but no x at all at every `period`-th call."""

    period: int = 7
    calls: list[int] = dataclasses.field(default_factory=lambda: [0], compare=False)

    name: ClassVar[str] = "sometimes_nothing"
    summary: ClassVar[str] = "fails now and then"
    source: ClassVar[str] = "a test"

    def reset(self) -> None:
        self.calls[0] = 0

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        self.calls[0] += 1
        if self.calls[0] % self.period == 0:
            return Solution(problem, None, Status.NOT_FINITE, message="as planned")
        first = problem.levels[0]
        x = np.asarray(np.linalg.lstsq(first.A, first.lower, rcond=None)[0], dtype=np.float64)
        return Solution(problem, x)


def nominal(scenario: Crossing, seed: int = 0) -> list[tuple[Spectrum, ...]]:
    """Spectra of the two first levels at every configuration of the joint path."""
    robot = MujocoRobot.from_arm(scenario.arm())
    stack = Stack(scenario.tasks())
    found = []
    for q in scenario.path(seed).q:
        robot.update(q)
        found.append(spectra(stack.problem(robot)))
    return found


def run(scenario: Crossing, solver: Solver, seed: int = 0) -> list[Step]:
    return list(scenario.steps(solver, seed))


def same(first: list[Step], second: list[Step]) -> bool:
    """Whether two runs agree in every bit of problem, answer and measurement."""
    return len(first) == len(second) and all(
        a.case == b.case
        and a.parameter == b.parameter
        and np.array_equal(a.problem.matrix, b.problem.matrix)
        and np.array_equal(a.problem.lower, b.problem.lower)
        and _same_answer(a.solution.x, b.solution.x)
        and dict(a.measured) == dict(b.measured)
        for a, b in zip(first, second, strict=True)
    )


def _same_answer(first: FloatArray | None, second: FloatArray | None) -> bool:
    if first is None or second is None:
        return first is second
    return np.array_equal(first, second)


def by_case(steps: list[Step]) -> dict[str, list[Step]]:
    return {case: list(group) for case, group in itertools.groupby(steps, key=lambda step: step.case)}


def measured(steps: list[Step], name: str) -> FloatArray:
    return np.array([step.measured[name] for step in steps])
