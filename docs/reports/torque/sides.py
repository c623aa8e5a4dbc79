"""Who is measured: tsid in an interpreter of its own, and our torque controller, each asked for turns of steps."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from hqp_rp import JointLimit, OrientationTask, PositionTask, PostureTask, TorqueController, TorqueStack, certify
from hqp_rp.robot import MujocoRobot, sawyer
from hqp_rp.scenarios.humanoid_reach import _FINGERS

HERE = Path(__file__).parent
OURS, TSID = "hqp_rp, six levels, all limits hard", "tsid 1.10, two levels"
DT = 0.001


class Remote:
    """tsid in its own interpreter, a turn at a time."""

    def __init__(self, python: str, asked: dict[str, Any]) -> None:
        worker = str(HERE / "tsid_worker.py")
        self._process = subprocess.Popen(
            [python, worker], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        self.said = self.ask(asked)
        if "error" in self.said:
            raise SystemExit(f"tsid: {self.said['error']}")

    def ask(self, message: dict[str, Any]) -> dict[str, Any]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(message) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())


class Ours:
    """A torque controller on a robot, a turn at a time; `refer` writes the references of a time into its tasks."""

    def __init__(self, robot: MujocoRobot, stack: TorqueStack, solver: str, refer: Callable[[float], None]) -> None:
        self.robot, self.refer = robot, refer
        self.controller = TorqueController(stack, solver)

    def ask(self, turn: dict[str, Any]) -> dict[str, Any]:
        robot, times, solves, failed, certified = self.robot, [], [], 0, 0
        for k, (t, q, v) in enumerate(zip(turn["t"], turn["own_q"], turn["own_v"], strict=True)):
            self.refer(t)
            begin = time.perf_counter()
            robot.update(q)
            command = self.controller.step(robot, DT, v)
            times.append(time.perf_counter() - begin)
            solves.append(command.solve_time)
            failed += command.mode.name != "RUNNING"
            if k % 20 == 0 and command.solution is not None and command.solution.x is not None:
                certified += certify(command.problem, command.solution.x).ok
        return {"times": times, "solves": solves, "failed": failed, "certified": certified, "tried": len(times[::20])}


def arm(limits: bool) -> Ours:
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    R, p = robot.pose("tool")
    hand = PositionTask("tool", p)
    levels = [hand, OrientationTask("tool", R), PostureTask(robot.neutral)]

    def refer(t: float) -> None:
        hand.target = p + np.array([0.05 * np.sin(t), 0.0, 0.0])

    if limits:
        stack = TorqueStack(levels, [JointLimit(acceleration=100.0)], torque=80.0)
        return Ours(robot, stack, "hierarchical_active_set", refer)
    return Ours(robot, TorqueStack(levels), "null_space", refer)


def pinocchio_state(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """MuJoCo's state with the quaternion's w last and the base's linear velocity in its own axes; joints in MuJoCo's order."""
    import pinocchio as pin

    turned = np.array([*q[:3], *q[4:7], q[3], *q[7:]])
    return turned, np.array([*(pin.Quaternion(turned[3:7]).matrix().T @ v[:3]), *v[3:]])


def without_fingers(path: Path) -> Path:
    """The URDF with its finger joints fixed, beside the original, so that meshes are found."""
    tree = ElementTree.parse(path)
    for joint in tree.getroot().iterfind("joint"):
        if joint.get("name", "").endswith(_FINGERS):
            joint.set("type", "fixed")
            for part in [*joint.findall("mimic"), *joint.findall("limit"), *joint.findall("axis")]:
                joint.remove(part)
    for link in tree.getroot().iterfind("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    made = HERE / "jvrc_without_fingers.urdf"
    tree.write(made)
    return made
