"""embodik: `computeMultiObjectiveVelocitySolutionEigen` on problems, `KinematicsSolver` for whole steps."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from typing import Any

import embodik
import numpy as np
from serve import Answer, Given, Worker, serve

FAR = 1e13
"""embodik takes finite bounds only, and at least one constraint row: what stands for "no bound", beyond every answer."""

CALL = "computeMultiObjectiveVelocitySolutionEigen(goals, jacobians, C, lower, upper{})"
SETTINGS: dict[str, dict[str, Any]] = {
    "defaults": {},
    "tight": {
        "solver_tolerance": 1e-9,
        "sr_tolerance": 1e-9,
        "max_iters": 200,
        "refine_partial_scale": True,
    },
}
VARIANTS = {
    name: CALL.format("".join(f", {key}={value}" for key, value in settings.items()))
    for name, settings in SETTINGS.items()
}


def cannot(given: Given, variant: str) -> str:
    return "" if given.equalities else "inequality rows only as hard rows"


def prepare(given: Given, variant: str) -> Callable[[], Any]:
    n = given.n
    goals = [level.lower for level in given.levels]
    jacobians = [np.asfortranarray(level.A) for level in given.levels]
    if given.hard is None:
        C, lower, upper = np.asfortranarray(np.eye(n)), np.full(n, -FAR), np.full(n, FAR)
    else:
        C = np.asfortranarray(given.hard.A)
        lower, upper = np.clip(given.hard.lower, -FAR, FAR), np.clip(given.hard.upper, -FAR, FAR)
    settings, solve = SETTINGS[variant], embodik.computeMultiObjectiveVelocitySolutionEigen
    return lambda: solve(goals, jacobians, C, lower, upper, **settings)


def read(found: Any, given: Given, variant: str) -> Answer:
    said = str(found.status).rpartition(".")[2]
    scales = [float(s) for s in found.task_scales]
    x = np.array(found.solution)
    return Answer(x if len(x) else None, found.status == embodik.SolverStatus.SUCCESS, said, {"scales": scales})


def step(asked: Mapping[str, Any]) -> Callable[[Any], Any]:
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "robot.urdf")
        with open(path, "w", encoding="utf-8") as file:
            file.write(asked["urdf"])
        robot = embodik.RobotModel(path)
    solver = embodik.KinematicsSolver(robot)
    solver.dt = asked["dt"]
    solver.set_tolerance(1e-6)  # 0.1, its default, damps the posture
    solver.enable_position_limits(False)
    solver.enable_velocity_limits(False)
    kinds = embodik.TaskType
    position = solver.add_frame_task("position", "tool", kinds.FRAME_POSITION)
    orientation = solver.add_frame_task("orientation", "tool", kinds.FRAME_ORIENTATION)
    posture = solver.add_posture_task("posture")
    position.set_target_position(np.array(asked["position"]))
    orientation.set_target_orientation(np.asfortranarray(asked["rotation"]))
    posture.set_target_configuration(np.array(asked["neutral"]))
    for priority, task in enumerate((position, orientation, posture)):
        task.priority, task.weight = priority, asked["gain"]

    def call(q: Any) -> Any:
        return solver.solve_velocity_dq(q, False)

    return call


if __name__ == "__main__":
    words = "KinematicsSolver, set_tolerance(1e-6), no limits, solve_velocity_dq(q, False): two FrameTasks and a PostureTask"
    serve(Worker("embodik", VARIANTS, cannot, prepare, read, step, words))
