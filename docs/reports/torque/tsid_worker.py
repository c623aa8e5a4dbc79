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


class Controller:
    """The robot, the two-level problem and its solver, with the tasks of the other side as far as tsid has them."""

    def __init__(self, asked: dict[str, Any]) -> None:
        self.alive: list[Any] = []  # tsid's formulation holds no reference to what is put into it
        self.asked = asked
        robot = tsid.RobotWrapper(asked["urdf"], [str(Path(asked["urdf"]).parent)], pin.JointModelFreeFlyer(), False)
        # Each library has joints in an order of its own.
        self.order = np.array([asked["joints"].index(name) for name in list(robot.model().names)[2:]])
        self.robot = robot
        self.problem, self.hand, self.balance = formulation(asked, robot, self.order, self.alive)
        self.solver = tsid.SolverHQuadProgFast("fast")
        self.solver.resize(self.problem.nVar, self.problem.nEq, self.problem.nIn)
        frame = self.robot.model().getFrameId("r_wrist")
        self.place = self.robot.framePosition(self.problem.data(), frame)
        self.foot: Any = None
        self.closed = True

    def refer(self, hand: list[float], balance: list[float] | None = None) -> None:
        self.place.translation = np.array(hand)
        self.hand.setReference(tsid.TrajectorySE3Constant("hand", self.place).computeNext())
        if balance is not None:
            middle = tsid.TrajectoryEuclidianConstant("balance", np.array([*balance[:2], self.com[2]]))
            self.balance.setReference(middle.computeNext())

    def state(self, q: list[float], v: list[float]) -> tuple[Any, Any]:
        q, v = np.array(q), np.array(v)
        return np.concatenate((q[:7], q[7:][self.order])), np.concatenate((v[:6], v[6:][self.order]))

    def step(self, t: float, q: Any, v: Any) -> tuple[Any, int]:
        solution = self.solver.solve(self.problem.computeProblemData(t, q, v))
        return self.problem.getActuatorForces(solution), int(solution.status)

    def begin(self, q: Any, v: Any) -> None:
        """A foot task beside the contacts, for a motion that lifts the foot."""
        self.problem.computeProblemData(0.0, q, v)
        self.com = self.robot.com(self.problem.data())
        frame = self.robot.model().getFrameId("r_ankle")
        self.foot = tsid.TaskSE3Equality("foot", self.robot, "r_ankle")
        self.foot.setKp(144.0 * np.ones(6))
        self.foot.setKd(24.0 * np.ones(6))
        self.sole = self.robot.framePosition(self.problem.data(), frame)
        self.stood = self.sole.translation.copy()
        self.lift(0.0)
        self.problem.addMotionTask(self.foot, 1.0, 1, 0.0)

    def lift(self, height: float) -> None:
        self.sole.translation = self.stood + np.array([0.0, 0.0, height])
        self.foot.setReference(tsid.TrajectorySE3Constant("foot", self.sole).computeNext())

    def close(self, closed: bool) -> None:
        """Take the right sole's contact away, fading for 0.2 s, or put it back."""
        if closed == self.closed:
            return
        self.closed = closed
        if not closed:
            self.problem.removeRigidContact("r_ankle", 0.2)
        else:
            place = self.robot.framePosition(self.problem.data(), self.robot.model().getFrameId("r_ankle"))
            self.problem.addRigidContact(contact_of(self.robot, "r_ankle", self.asked, place, self.alive), 1e-5)

    def resize(self) -> None:
        self.solver.resize(self.problem.nVar, self.problem.nEq, self.problem.nIn)


def contact_of(robot: Any, ankle: str, asked: dict[str, Any], place: Any, alive: list[Any]) -> Any:
    points = np.asfortranarray(np.array(asked["points"]).T)
    contact = tsid.Contact6d(ankle, robot, ankle, points, np.array([0.0, 0.0, 1.0]), asked["friction"], 0.0, 2000.0)
    contact.setKp(np.zeros(6))
    contact.setKd(20.0 * np.ones(6))
    contact.setReference(place)
    alive.append(contact)
    return contact


def formulation(asked: dict[str, Any], robot: Any, order: Any, alive: list[Any]) -> tuple[Any, Any, Any]:
    """The robot's problem, and the tasks of the hand and of the balance."""
    q, v = np.array(asked["q"]), np.zeros(robot.nv)
    q[7:] = q[7:][order]
    problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
    problem.computeProblemData(0.0, q, v)
    data = problem.data()
    for ankle in ("r_ankle", "l_ankle"):
        place = robot.framePosition(data, robot.model().getFrameId(ankle))
        problem.addRigidContact(contact_of(robot, ankle, asked, place, alive), 1e-5)
    balance = tsid.TaskComEquality("balance", robot)
    balance.setKp(36.0 * np.ones(3))
    balance.setKd(12.0 * np.ones(3))
    problem.addMotionTask(balance, 1.0, 1, 0.0)
    trajectory = tsid.TrajectoryEuclidianConstant("balance", robot.com(data))
    balance.setReference(trajectory.computeNext())
    tasks = {}
    for name, frame, mask, gain, weight in (
        ("hand", "r_wrist", [1, 1, 1, 0, 0, 0], 8.0, asked.get("hand_weight", 1e-1)),
        ("torso", "base_link", [0, 0, 0, 1, 1, 1], 6.0, 1e-2),
    ):
        task = tsid.TaskSE3Equality(name, robot, frame)
        task.setKp(gain**2 * np.ones(6))
        task.setKd(2.0 * gain * np.ones(6))
        task.setMask(np.array(mask, dtype=float))
        place = robot.framePosition(data, robot.model().getFrameId(frame))
        task.setReference(tsid.TrajectorySE3Constant(name, place).computeNext())
        problem.addMotionTask(task, weight, 1, 0.0)
        tasks[name] = task
    posture = tsid.TaskJointPosture("posture", robot)
    posture.setKp(16.0 * np.ones(robot.na))
    posture.setKd(8.0 * np.ones(robot.na))
    posture.setReference(tsid.TrajectoryEuclidianConstant("posture", q[7:]).computeNext())
    problem.addMotionTask(posture, 1e-3, 1, 0.0)
    effort = np.array(asked["effort"])[order]
    torques = tsid.TaskActuationBounds("torques", robot)
    torques.setBounds(-effort, effort)
    problem.addActuationTask(torques, 1.0, 0, 0.0)
    bounds = tsid.TaskJointBounds("bounds", robot, asked["dt"])
    speed = robot.model().velocityLimit[6:]
    bounds.setVelocityBounds(-speed, speed)
    problem.addMotionTask(bounds, 1.0, 0, 0.0)
    alive += [*tasks.values(), balance, trajectory, posture, torques, bounds]
    return problem, tasks["hand"], balance


def main() -> None:
    asked = json.loads(sys.stdin.readline())
    try:
        controller = Controller(asked)
        problem = controller.problem
        said = {"pinocchio": pin.__version__, "variables": problem.nVar, "rows": problem.nEq + problem.nIn}
        print(json.dumps(said), flush=True)
    except Exception as error:  # the other side tells it
        print(json.dumps({"error": f"{type(error).__name__}: {error}"}), flush=True)
        return
    for line in sys.stdin:
        turn = json.loads(line)
        if "loop" in turn:
            print(json.dumps(one_step(controller, turn)), flush=True)
            continue
        times, failed = [], 0
        for q, v, target in zip(turn["q"], turn["v"], turn["hand"], strict=True):
            q, v = controller.state(q, v)
            controller.refer(target)
            begin = time.perf_counter()
            torque, status = controller.step(0.0, q, v)
            times.append(time.perf_counter() - begin)
            failed += status != 0 or not np.isfinite(torque).all()
        print(json.dumps({"times": times, "failed": int(failed)}), flush=True)


def one_step(controller: Controller, turn: dict[str, Any]) -> dict[str, Any]:
    """A step of the closed loop."""
    q, v = controller.state(turn["q"], turn["v"])
    if controller.foot is None:
        controller.begin(q, v)
    controller.refer(turn["hand"], turn["balance"])
    controller.lift(turn["height"])
    controller.close(turn["closed"])
    controller.problem.computeProblemData(turn["loop"], q, v)  # contacts that fade are gone when their time is over
    controller.resize()
    begin = time.perf_counter()
    torque, status = controller.step(turn["loop"], q, v)
    seconds = time.perf_counter() - begin
    sound = status == 0 and bool(np.isfinite(torque).all())
    found = np.empty(len(torque))
    found[controller.order] = torque
    return {"torque": found.tolist() if sound else None, "time": seconds}


if __name__ == "__main__":
    main()
