"""A scenario and solvers small enough to know every figure by hand."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from hqp_rp import Level, Problem, Solution, Solver, Status
from hqp_rp.core.problem import FloatArray
from hqp_rp.scenarios.scenario import Scenario, Step, timed_solve

CORRIDOR = """
dt = 0.01

[robot]
model = "planar4"

[[limit]]
type = "joint"
velocity = {speed}

[[limit]]
type = "half_space"
name = "corridor"
frame = "tool"
normal = [0.0, 1.0, 0.0]
offset = -1.0
gain = 20.0
return_speed = {back}

[[level]]
[[level.task]]
type = "position"
frame = "tool"
axes = "xy"
target = [0.0, 1.0, 0.0]
gain = 1.0
"""
"""A stack file of a planar arm outside a corridor: joints too slow for `back`, m/s, contradict it."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Closing(Scenario):
    """x_1 = 1 before x_1 + eps x_2 = 0 for eps = 1, 0.1, ...: x* = (1, -1/eps)."""

    name: ClassVar[str] = "closing"
    question: ClassVar[str] = "Does the test's own question appear?"
    cannot_tell: ClassVar[tuple[str, ...]] = ("Two unknowns only.",)
    abscissa: ClassVar[str] = "eps"
    log_abscissa: ClassVar[bool] = True

    count: int = 4

    def steps(self, solver: Solver, seed: int) -> Iterator[Step]:
        for k in range(self.count):
            eps = 10.0**-k
            problem = closing_problem(eps, seed)
            solution, seconds = timed_solve(solver, problem)
            yield Step("", eps, problem, solution, seconds, {"steps so far": float(k)})
            if solution.status is Status.REFUSED:
                return

    def length(self) -> int:
        return self.count

    def quick(self) -> Closing:
        return dataclasses.replace(self, count=2)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Moving(Closing):
    """The same over time."""

    name: ClassVar[str] = "moving"
    abscissa: ClassVar[str] = "time (s)"
    log_abscissa: ClassVar[bool] = False


def closing_problem(eps: float, seed: int = 0) -> Problem:
    """x* = (1 + seed, -(1 + seed) / eps)."""
    return Problem(
        [Level.equality([[1.0, 0.0]], [1.0 + seed], name="first"), Level.equality([[1.0, eps]], [0.0], name="second")]
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Fixed(Solver):
    """Answers x whatever the problem; refuses or fails when told so."""

    x: tuple[float, ...] | None = (1.0, 0.0)
    status: Status = Status.SOLVED
    message: str = ""
    claims: bool = False

    name: ClassVar[str] = "fixed"
    summary: ClassVar[str] = "a constant"
    source: ClassVar[str] = "the tests"

    def is_lexicographic(self, problem: Problem) -> bool:
        return self.claims

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        x = None if self.x is None else np.array(self.x[: problem.n] + (0.0,) * (problem.n - len(self.x)))
        return Solution(problem, x, self.status, message=self.message)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Bounded(Scenario):
    """x_1 = 2 before x_2 = 1, every half second, with |x_1| <= 1 as a hard row; the second case leaves the row out.

    Seed 1 starts 0.2 outside a position limit and is inside again from the third step on; a solver whose x_1 is beyond 1
    adds to what is left of it.
    """

    name: ClassVar[str] = "bounded"
    question: ClassVar[str] = "Who keeps |x_1| <= 1?"
    cannot_tell: ClassVar[tuple[str, ...]] = ("Nothing moves.",)
    abscissa: ClassVar[str] = "time (s)"
    without_limits: ClassVar[str] = "no limits"

    def steps(self, solver: Solver, seed: int) -> Iterator[Step]:
        for case in ("hard", "no limits"):
            hard = Level([[1.0, 0.0]], -1.0, 1.0, name="speed") if case == "hard" else None
            levels = [
                Level.equality([[1.0, 0.0]], [2.0], name="tool"),
                Level.equality([[0.0, 1.0]], [1.0], name="posture"),
            ]
            problem = Problem(levels, hard)
            for k in range(4):
                solution, seconds = timed_solve(solver, problem)
                if solution.status is Status.REFUSED:
                    yield Step(case, 0.5 * k, problem, solution, seconds)
                    break
                x = np.zeros(2) if solution.x is None else solution.x
                left = 0.2 * seed * max(1.0 - 0.5 * k, 0.0)
                added = max(abs(x[0]) - 1.5, 0.0)
                measured = {
                    "position limit violation [rad]": left + added,
                    "position limit violation left [rad]": left,
                    "position limit violation added [rad]": added,
                    "velocity limit violation [rad/s]": max(abs(x[0]) - 1.0, 0.0) * (k % 2),
                    "tool error [m]": abs(2.0 - x[0]) * (k + 1),
                    "posture error [rad]": abs(1.0 - x[1]),
                }
                yield Step(case, 0.5 * k, problem, solution, seconds, measured)

    def length(self) -> int:
        return 8

    def quick(self) -> Bounded:
        return self
