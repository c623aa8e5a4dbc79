"""hqp_rp itself, by the same way as its peers. Run by the interpreter of an environment that has it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from serve import Answer, Given, Worker, serve

import hqp_rp

VARIANTS = {
    "active set": 'get_solver("hierarchical_active_set", warm_start=False)',
    "null space": 'get_solver("null_space")',
}
SOLVERS = {"active set": hqp_rp.get_solver("hierarchical_active_set", warm_start=False)}
SOLVERS["null space"] = hqp_rp.get_solver("null_space")


def problem_of(given: Given) -> Any:
    hard = None if given.hard is None else hqp_rp.Level(*given.hard)
    return hqp_rp.Problem([hqp_rp.Level(*level) for level in given.levels], hard=hard)


def cannot(given: Given, variant: str) -> str:
    return "a closed form for equalities without hard rows" if SOLVERS[variant].refuses(problem_of(given)) else ""


def prepare(given: Given, variant: str) -> Callable[[], Any]:
    problem, solver = problem_of(given), SOLVERS[variant]
    return lambda: solver.solve(problem)


def read(found: Any, given: Given, variant: str) -> Answer:
    return Answer(found.x, found.status is hqp_rp.Status.SOLVED, found.status.name)


def step(asked: Mapping[str, Any]) -> Callable[[Any], Any]:
    from hqp_rp import OrientationTask, PositionTask, PostureTask, Stack
    from hqp_rp.robot import MujocoRobot, sawyer

    robot = MujocoRobot.from_arm(sawyer())
    position, rotation, home = (np.array(asked[name]) for name in ("position", "rotation", "neutral"))
    gain, dt = asked["gain"], asked["dt"]
    tasks = [PositionTask("tool", position, gain=gain), OrientationTask("tool", rotation, gain=gain)]
    stack = Stack([*tasks, PostureTask(home, gain=gain)])
    solver = SOLVERS["active set"]

    def call(q: Any) -> Any:
        robot.update(q)
        return solver.solve(stack.problem(robot, dt)).x

    return call


if __name__ == "__main__":
    words = "robot.update(q); get_solver('hierarchical_active_set', warm_start=False).solve(stack.problem(robot, dt))"
    serve(Worker("hqp-rp", VARIANTS, cannot, prepare, read, step, words))
