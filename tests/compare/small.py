"""A scenario and solvers small enough to know every figure by hand."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from hqp_rp import Level, Problem, Solution, Solver, Status
from hqp_rp.core.problem import FloatArray
from hqp_rp.scenarios.scenario import Scenario, Step, timed_solve


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
