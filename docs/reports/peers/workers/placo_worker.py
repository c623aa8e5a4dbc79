"""placo: its `Problem` of hard and soft constraints on problems; its `KinematicsSolver` for whole steps."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import placo
from rows import VARIANTS, promise
from serve import Answer, Given, Rows, Worker, costs, serve


def cannot(given: Given, variant: str) -> str:
    return "one level only: nothing to weigh" if variant != "weights" and len(given.levels) == 1 else ""


def prepare(given: Given, variant: str) -> Callable[[], Any]:
    strict = int(variant != "weights")
    weights = costs(len(given.levels) - strict)

    problem = placo.Problem()
    x = problem.add_variable(given.n)
    if given.hard is not None:
        _add(problem, x, given.hard, "hard", 1.0)
    for k, level in enumerate(given.levels):
        # placo's weights multiply squares, a cost multiplies rows.
        kind, weight = ("hard", 1.0) if k < strict else ("soft", weights[k - strict] ** 2)
        _add(problem, x, level, kind, weight)

    def call() -> Any:
        problem.solve()
        return x.value

    return call


def _add(problem: Any, x: Any, rows: Rows, kind: str, weight: float) -> None:
    same = rows.lower == rows.upper
    up, low = np.isfinite(rows.upper) & ~same, np.isfinite(rows.lower) & ~same
    for chosen, add in (
        (same, lambda: x.expr().left_multiply(rows.A[same]) == rows.lower[same]),
        (up, lambda: x.expr().left_multiply(rows.A[up]) <= rows.upper[up]),
        (low, lambda: x.expr().left_multiply(rows.A[low]) >= rows.lower[low]),
    ):
        if chosen.any():
            problem.add_constraint(add()).configure(kind, weight)


def read(found: Any, given: Given, variant: str) -> Answer:
    return Answer(np.array(found), True, "returned", promise(given, variant))


def step(asked: Mapping[str, Any]) -> Callable[[Any], Any]:
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "robot.urdf")
        with open(path, "w", encoding="utf-8") as file:
            file.write(asked["urdf"])
        robot = placo.RobotWrapper(path, placo.Flags.ignore_collisions)
    names = [str(name) for name in robot.joint_names()]
    solver = placo.KinematicsSolver(robot)
    solver.mask_fbase(True)
    solver.enable_joint_limits(False)
    solver.enable_velocity_limits(False)
    solver.dt = asked["dt"]
    weights = [cost**2 for cost in costs(3)]
    solver.add_position_task("tool", np.array(asked["position"])).configure("position", "soft", weights[0])
    solver.add_orientation_task("tool", np.array(asked["rotation"])).configure("orientation", "soft", weights[1])
    posture = solver.add_joints_task()
    posture.set_joints(dict(zip(names, asked["neutral"], strict=True)))
    posture.configure("posture", "soft", weights[2])
    base, gain = len(robot.state.q) - len(names), asked["gain"]

    def call(q: Any) -> Any:
        robot.state.q[base:] = q
        robot.update_kinematics()
        # placo goes all the way in one step; the velocity that the gain asks for is that step times the gain.
        return gain * solver.solve(False)[-len(q) :]

    return call


if __name__ == "__main__":
    words = "KinematicsSolver.solve(False): position, orientation and joints task, soft, weights 1e4, 1, 1e-4"
    variants = {k: f"Problem of soft (weight = cost^2) and hard constraints; {v}" for k, v in VARIANTS.items()}
    serve(Worker("placo", variants, cannot, prepare, read, step, words))
