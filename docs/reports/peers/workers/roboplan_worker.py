"""RoboPlan's Oink: whole steps. Its tasks are frames and configurations of a model: rows from outside cannot be stated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from roboplan import core, optimal_ik
from serve import Worker, serve


def step(asked: Mapping[str, Any]) -> Callable[[Any], Any]:
    """The tool's pose before the posture: a FrameTask's null-space projector has all six rows, whatever its costs.

    While the pose can be reached this is the answer of position before orientation before posture.
    """
    scene = core.Scene("arm", core.loadUrdfSceneDescriptionFromXml(asked["urdf"]))
    settings = optimal_ik.OinkSettings()
    settings.eps_abs = 1e-9
    oink = optimal_ik.Oink(scene, settings)
    target = np.eye(4)
    target[:3, :3], target[:3, 3] = asked["rotation"], asked["position"]
    home, gain, dt = np.array(asked["neutral"]), asked["gain"] * asked["dt"], asked["dt"]
    place = core.CartesianConfiguration("", "tool", np.asfortranarray(target))
    pose = optimal_ik.FrameTask(oink, scene, place, optimal_ik.FrameTaskOptions(task_gain=gain, priority=1))
    options = optimal_ik.ConfigurationTaskOptions(task_gain=gain, priority=2)
    posture = optimal_ik.ConfigurationTask(oink, home, np.ones(len(home)), options)
    tasks, change = [pose, posture], np.zeros(oink.num_variables)

    def call(q: Any) -> Any:
        oink.solveIk(q, tasks, [], change)
        return change / dt

    return call


if __name__ == "__main__":
    words = "Oink.solveIk(q, [FrameTask pose priority 1, ConfigurationTask priority 2], [], change), eps_abs 1e-9"
    serve(Worker("roboplan", {}, step=step, step_settings=words))
