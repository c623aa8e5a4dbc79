"""mink-warp on the processor, one world: whole steps. Its tasks are kernels: rows from outside cannot be stated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import mink_warp
import mujoco
import numpy as np
import warp
from serve import Worker, serve


def step(asked: Mapping[str, Any]) -> Callable[[Any], Any]:
    warp.config.quiet = True
    model = mujoco.MjModel.from_xml_string(asked["mjcf"])
    configuration = mink_warp.Configuration(model, nworld=1, device="cpu")
    configuration.update(np.array(asked["neutral"])[None])
    gain = asked["gain"] * asked["dt"]
    weights = [30.0, 10.0, 0.3]  # in float32 wider ones lose the posture; of several tried, these came nearest
    tasks = [
        mink_warp.FrameTask("tool", "site", position_cost=weights[0], orientation_cost=0.0, gain=gain),
        mink_warp.FrameTask("tool", "site", position_cost=0.0, orientation_cost=weights[1], gain=gain),
        mink_warp.PostureTask(model, cost=weights[2], gain=gain),
    ]
    for task in tasks:
        task.set_target_from_configuration(configuration)
    solver = mink_warp.IKSolver(configuration)

    def call(q: Any) -> Any:
        configuration.update(q[None])
        return solver.solve(tasks, asked["dt"]).numpy()[0]

    return call


if __name__ == "__main__":
    words = "nworld=1, device='cpu', IKSolver.solve(tasks, dt): FrameTask, FrameTask, PostureTask, costs 30, 10, 0.3"
    serve(Worker("mink-warp", {}, step=step, step_settings=words))
