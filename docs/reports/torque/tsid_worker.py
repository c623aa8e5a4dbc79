"""One turn of tsid at a time: reads a JSON line from standard input, writes one. Run by tsid's own interpreter."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import tsid


def formulation(asked: dict[str, Any]) -> tuple[Any, Any, Any]:
    """The robot, the two-level problem and its solver, with the tasks of the other side as far as tsid has them."""
    alive: list[Any] = []  # tsid's formulation holds no reference to what is put into it
    robot = tsid.RobotWrapper(asked["urdf"], [str(Path(asked["urdf"]).parent)], pin.JointModelFreeFlyer(), False)
    q, v = np.array(asked["q"]), np.zeros(robot.nv)
    problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
    problem.computeProblemData(0.0, q, v)
    data = problem.data()
    for ankle in ("r_ankle", "l_ankle"):
        points = np.asfortranarray(np.array(asked["points"]).T)
        contact = tsid.Contact6d(ankle, robot, ankle, points, np.array([0.0, 0.0, 1.0]), asked["friction"], 0.0, 2000.0)
        contact.setKp(np.zeros(6))
        contact.setKd(20.0 * np.ones(6))
        contact.setReference(robot.framePosition(data, robot.model().getFrameId(ankle)))
        problem.addRigidContact(contact, 1e-5)
        alive.append(contact)
    balance = tsid.TaskComEquality("balance", robot)
    balance.setKp(36.0 * np.ones(3))
    balance.setKd(12.0 * np.ones(3))
    problem.addMotionTask(balance, 1.0, 1, 0.0)
    trajectory = tsid.TrajectoryEuclidianConstant("balance", robot.com(data))
    balance.setReference(trajectory.computeNext())
    for name, frame, mask, gain, weight in (
        ("hand", "r_wrist", [1, 1, 1, 0, 0, 0], 8.0, 1e-1),
        ("torso", "base_link", [0, 0, 0, 1, 1, 1], 6.0, 1e-2),
    ):
        task = tsid.TaskSE3Equality(name, robot, frame)
        task.setKp(gain**2 * np.ones(6))
        task.setKd(2.0 * gain * np.ones(6))
        task.setMask(np.array(mask, dtype=float))
        place = robot.framePosition(data, robot.model().getFrameId(frame))
        task.setReference(tsid.TrajectorySE3Constant(name, place).computeNext())
        problem.addMotionTask(task, weight, 1, 0.0)
        alive.append(task)
    posture = tsid.TaskJointPosture("posture", robot)
    posture.setKp(16.0 * np.ones(robot.na))
    posture.setKd(8.0 * np.ones(robot.na))
    posture.setReference(tsid.TrajectoryEuclidianConstant("posture", q[7:]).computeNext())
    problem.addMotionTask(posture, 1e-3, 1, 0.0)
    effort = np.array(asked["effort"])
    torques = tsid.TaskActuationBounds("torques", robot)
    torques.setBounds(-effort, effort)
    problem.addActuationTask(torques, 1.0, 0, 0.0)
    bounds = tsid.TaskJointBounds("bounds", robot, asked["dt"])
    speed = robot.model().velocityLimit[6:]
    bounds.setVelocityBounds(-speed, speed)
    problem.addMotionTask(bounds, 1.0, 0, 0.0)
    solver = tsid.SolverHQuadProgFast("fast")
    solver.resize(problem.nVar, problem.nEq, problem.nIn)
    alive += [balance, trajectory, posture, torques, bounds]
    return robot, problem, (solver, alive, alive[2])


def main() -> None:
    asked = json.loads(sys.stdin.readline())
    try:
        robot, problem, (solver, _alive, hand) = formulation(asked)
        said = {"pinocchio": pin.__version__, "variables": problem.nVar, "rows": problem.nEq + problem.nIn}
        print(json.dumps(said), flush=True)
    except Exception as error:  # the other side tells it
        print(json.dumps({"error": f"{type(error).__name__}: {error}"}), flush=True)
        return
    place = robot.framePosition(problem.data(), robot.model().getFrameId("r_wrist"))
    for line in sys.stdin:
        turn = json.loads(line)
        times, failed = [], 0
        for q, v, target in zip(turn["q"], turn["v"], turn["hand"], strict=True):
            q, v = np.array(q), np.array(v)
            place.translation = np.array(target)
            hand.setReference(tsid.TrajectorySE3Constant("hand", place).computeNext())
            begin = time.perf_counter()
            solution = solver.solve(problem.computeProblemData(0.0, q, v))
            torque = problem.getActuatorForces(solution)
            times.append(time.perf_counter() - begin)
            failed += solution.status != 0 or not np.isfinite(torque).all()
        print(json.dumps({"times": times, "failed": int(failed)}), flush=True)


if __name__ == "__main__":
    main()
