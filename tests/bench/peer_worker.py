"""One peer in an environment of its own: run by its interpreter as a script, asked for turns over its standard input.

It imports nothing of hqp_rp. Lines of JSON: first what to set up; then {"first": i, "count": k} is answered with k times in
ns, and {"answer": i} with the joint velocity at configuration i.
"""

from __future__ import annotations

import importlib.metadata
import json
import pathlib
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

import numpy as np


def pink_step(asked: dict[str, Any]) -> Callable[[Any], Any]:
    """`pink.solve_ik` on position, orientation and posture tasks, with weights for priorities and without limits."""
    import pink  # type: ignore[import-not-found, unused-ignore]
    import pinocchio

    model = pinocchio.buildModelFromXML(asked["urdf"])
    home = np.array(asked["neutral"])
    configuration = pink.Configuration(model, model.createData(), home)
    costs, gain = asked["costs"], asked["gain"] * asked["dt"]
    tasks = [
        pink.FrameTask("tool", position_cost=costs[0], orientation_cost=0.0, gain=gain),
        pink.FrameTask("tool", position_cost=0.0, orientation_cost=costs[1], gain=gain),
        pink.PostureTask(cost=costs[2], gain=gain),
    ]
    for task in tasks:
        task.set_target_from_configuration(configuration)

    def step(q: Any) -> Any:
        configuration.update(q)
        return pink.solve_ik(configuration, tasks, asked["dt"], solver=asked["solver"], limits=[])

    return step


def placo_step(asked: dict[str, Any]) -> Callable[[Any], Any]:
    """placo's `KinematicsSolver` on position, orientation and joints tasks, soft with weights, without limits."""
    import placo  # type: ignore[import-not-found, unused-ignore]

    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "robot.urdf"
        path.write_text(asked["urdf"])
        robot = placo.RobotWrapper(str(path), placo.Flags.ignore_collisions)
    names = [str(name) for name in robot.joint_names()]
    solver = placo.KinematicsSolver(robot)
    solver.mask_fbase(True)
    solver.enable_joint_limits(False)
    solver.enable_velocity_limits(False)
    solver.dt = asked["dt"]
    # placo's weights multiply squares, mink's and pink's costs multiply rows.
    weights = [cost**2 for cost in asked["costs"]]
    solver.add_position_task("tool", np.array(asked["position"])).configure("position", "soft", weights[0])
    solver.add_orientation_task("tool", np.array(asked["rotation"])).configure("orientation", "soft", weights[1])
    posture = solver.add_joints_task()
    posture.set_joints(dict(zip(names, asked["neutral"], strict=True)))
    posture.configure("posture", "soft", weights[2])
    base, gain = len(robot.state.q) - len(names), asked["gain"]

    def step(q: Any) -> Any:
        robot.state.q[base:] = q
        robot.update_kinematics()
        # placo goes all the way in one step; the velocity that the gain asks for is that step times the gain.
        return gain * solver.solve(False)[-len(q) :]

    return step


def roboplan_step(asked: dict[str, Any]) -> Callable[[Any], Any]:
    """RoboPlan's Oink: the tool's pose before the posture, by priorities, without limits.

    One pose task instead of position over orientation: its null-space projector is built from all six rows of a pose task,
    whatever their costs. While the pose can be reached, both have the same answer.
    """
    from roboplan import core, optimal_ik  # type: ignore[import-not-found, unused-ignore]

    scene = core.Scene("arm", core.loadUrdfSceneDescriptionFromXml(asked["urdf"]))
    settings = optimal_ik.OinkSettings()
    settings.eps_abs = 1e-9
    oink = optimal_ik.Oink(scene, settings)
    target = np.eye(4)
    target[:3, :3], target[:3, 3] = asked["rotation"], asked["position"]
    home, gain = np.array(asked["neutral"]), asked["gain"] * asked["dt"]
    pose = optimal_ik.FrameTask(
        oink,
        scene,
        core.CartesianConfiguration("", "tool", np.asfortranarray(target)),
        optimal_ik.FrameTaskOptions(task_gain=gain, priority=1),
    )
    posture = optimal_ik.ConfigurationTask(
        oink, home, np.ones(len(home)), optimal_ik.ConfigurationTaskOptions(task_gain=gain, priority=2)
    )
    tasks, change, dt = [pose, posture], np.zeros(oink.num_variables), asked["dt"]

    def step(q: Any) -> Any:
        oink.solveIk(q, tasks, [], change)
        return change / dt

    return step


STEPS = {"pink": pink_step, "placo": placo_step, "roboplan": roboplan_step}

PACKAGES = {"pink": "pin-pink", "placo": "placo", "roboplan": "roboplan"}


def main() -> None:
    """Serve turns until standard input ends."""
    asked = json.loads(sys.stdin.readline())
    try:
        step = STEPS[asked["peer"]](asked)
        configurations = [np.array(q) for q in asked["configurations"]]
        step(configurations[0])
        version = importlib.metadata.version(PACKAGES[asked["peer"]])
    except Exception as error:  # whatever it is, the benchmark goes on without this peer and says why
        print(json.dumps({"error": f"{type(error).__name__}: {error}"}), flush=True)
        return
    print(json.dumps({"version": version}), flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        if "answer" in request:
            reply: dict[str, Any] = {"v": np.asarray(step(configurations[request["answer"]])).tolist()}
        else:
            times = []
            for i in range(request["first"], request["first"] + request["count"]):
                q = configurations[i % len(configurations)]
                start = time.perf_counter_ns()
                step(q)
                times.append(time.perf_counter_ns() - start)
            reply = {"times": times}
        print(json.dumps(reply), flush=True)


if __name__ == "__main__":
    main()
