"""One problem looked at closely: how it was solved, what each level pays, which rows hold the answer, whether it is proven."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from hqp_rp.control.stack_file import StackFile
from hqp_rp.core.certificate import Certificate, certify
from hqp_rp.core.diagnostics import LevelReport
from hqp_rp.core.problem import Problem
from hqp_rp.core.solution import Solution
from hqp_rp.core.solver import Solver
from hqp_rp.robot.robot_source import RobotSource

_SHOWN = 20  # active rows


@dataclasses.dataclass(frozen=True, eq=False)
class Checked:
    """What was found. certificate: None where there is no x to judge; sentences: what to print, a line each."""

    solution: Solution
    certificate: Certificate | None
    sentences: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether the problem was solved and the answer is certified as its lexicographic optimum."""
        return self.solution.status.ok and self.certificate is not None and self.certificate.ok


def check_problem(problem: Problem, solver: Solver) -> Checked:
    """Solve `problem` and judge the answer: status, conflict of the hard rows, levels, what holds each back, active
    rows, certificate."""
    solution = solver.solve(problem)
    lines = [f"{solver!r}", f"{solution.status.name}: {solution.status.value} {solution.message}".rstrip()]
    if solution.conflict is not None:
        lines.append(conflict_sentence(solution))
    if solution.x is None:
        return Checked(solution, None, tuple(lines))
    lines.append(f"x = {np.array2string(np.asarray(solution.x), precision=6, suppress_small=True)}")
    lines += [_level(report) for report in solution.levels]
    lines += [f"{found}." for found in solution.held_back]
    lines.append(_active(solution.active_rows))
    certificate = certify(problem, solution.x)
    lines.append(f"certificate: {certificate.sentence}")
    return Checked(solution, certificate, tuple(lines))


def problem_of(
    file: StackFile, source: RobotSource, q: tuple[float, ...] | None, dt: float | None
) -> tuple[Problem, str]:
    """The problem of a stack file on its robot at rest, and in words what it is.

    Args:
        file: the stack. source: the robot.
        q: nq numbers, rad or m; None is the robot's neutral configuration. dt: s; None is what the file says.

    Raises:
        RobotError: q of another length, or not finite; a robot that does not load. SettingError: a dt that is not > 0 s, or a
            stack with limits without one.
    """
    robot = source.robot()
    step = file.dt if dt is None else dt
    stack = dataclasses.replace(file, dt=step).stack(robot)
    robot.update(robot.neutral if q is None else np.array(q))
    rest = np.zeros(robot.nv)
    where = "its neutral configuration" if q is None else f"q = {np.array2string(np.array(q), separator=', ')}"
    told = f"{file.origin} on {source.model}, at rest at {where}" + ("" if step is None else f", dt = {step:g} s")
    return stack.problem(robot, step, rest, rest), told


def described(metadata: dict[str, Any]) -> str:
    """What a saved problem says of itself, in one line; "" where it says nothing."""
    keys = ("model", "sample", "kind", "sigma", "what", "figure", "contestant")
    values = [(key, metadata[key]) for key in keys if metadata.get(key) is not None]
    return ", ".join(f"{key} {f'{value:.4g}' if isinstance(value, float) else value}" for key, value in values)


def conflict_sentence(solution: Solution) -> str:
    """Which hard rows contradict each other and what would help, as a line."""
    return f"conflict: {solution.conflict}"


def _level(report: LevelReport) -> str:
    rows = len(report.violation)
    rank = f"rank {report.rank} of {rows} row{'' if rows == 1 else 's'}"
    if report.own_rank != report.rank:
        rank += f" ({report.own_rank} by itself)"
    return (
        f"{report.name}: residual {report.residual:.3g}, {rank}. {report.singularity.name}: {report.singularity.value}"
    )


def _active(rows: tuple[str, ...] | None) -> str:
    if rows is None:
        return "active rows: the solver does not say."
    if not rows:
        return "active rows: none; no bound holds the answer back."
    more = f"; and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
    return f"active rows: {'; '.join(rows[:_SHOWN])}{more}"
