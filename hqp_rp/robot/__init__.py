"""Robots behind one protocol: MuJoCo and Pinocchio adapters, and arms made from their DH rows."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from hqp_rp.core.extras import absent, missing_of

if TYPE_CHECKING:
    from hqp_rp.robot.arms import panda_like, planar_arm, sawyer
    from hqp_rp.robot.batch import FrameBatch, frame_batch
    from hqp_rp.robot.coupling import Coupling
    from hqp_rp.robot.dh import DHArm, Link
    from hqp_rp.robot.model_file import load_robot
    from hqp_rp.robot.mujoco_arm import arm_spec
    from hqp_rp.robot.mujoco_robot import MujocoRobot
    from hqp_rp.robot.pinocchio_robot import PinocchioRobot
    from hqp_rp.robot.robot import DynamicRobot, Robot
    from hqp_rp.robot.robot_source import RobotSource

__all__ = [
    "Coupling",
    "DHArm",
    "DynamicRobot",
    "FrameBatch",
    "Link",
    "MujocoRobot",
    "PinocchioRobot",
    "Robot",
    "RobotSource",
    "arm_spec",
    "frame_batch",
    "load_robot",
    "panda_like",
    "planar_arm",
    "sawyer",
]

# A robot library is imported when its adapter is first used, and never by `import hqp_rp.robot`.
_LAZY = {
    "Coupling": "coupling",
    "DHArm": "dh",
    "DynamicRobot": "robot",
    "FrameBatch": "batch",
    "frame_batch": "batch",
    "Link": "dh",
    "MujocoRobot": "mujoco_robot",
    "PinocchioRobot": "pinocchio_robot",
    "Robot": "robot",
    "RobotSource": "robot_source",
    "arm_spec": "mujoco_arm",
    "load_robot": "model_file",
    "panda_like": "arms",
    "planar_arm": "arms",
    "sawyer": "arms",
}

# Without it there is a stand-in, which says so when it is used.
_NEEDS = {"MujocoRobot": "mujoco", "arm_spec": "mujoco", "PinocchioRobot": "pinocchio"}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'hqp_rp.robot' has no attribute {name!r}")
    if name in _NEEDS and missing_of((_NEEDS[name],)):
        return absent(f"hqp_rp.robot.{name}", _NEEDS[name])
    return getattr(importlib.import_module(f"hqp_rp.robot.{_LAZY[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
