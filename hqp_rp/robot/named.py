"""A robot from one word: the name of one of the library's robots, or a model file."""

from __future__ import annotations

import os
import pathlib
import re

from hqp_rp.core.errors import RobotError, unknown_name
from hqp_rp.core.extras import require
from hqp_rp.core.paths import user_path
from hqp_rp.robot.robot import Robot

ASSETS = pathlib.Path(__file__).with_name("assets")

ROBOTS = {
    "sawyer": "the 7-joint Sawyer of the paper's Table 1",
    "panda_like": "7 joints with the kinematics and limits of Franka Emika's Panda, each link counted as 2 kg; no gripper",
    "planarN": "a planar arm of N joints of 0.4 m, such as planar4",
    "dual_sawyer": "two Sawyers side by side, 0.6 m apart; frames left_tool, right_tool and so on",
    "humanoid": "the library's own humanoid of primitive shapes on a floating base, 29 joints, 35 velocities (not JVRC-1)",
}
"""Name -> what it is, of the robots that need no file."""

_PLANAR = re.compile(r"planar([1-9][0-9]?)")


def is_named(model: str | os.PathLike[str]) -> bool:
    """Whether `model` is the name of one of the library's robots."""
    text = os.fspath(model)
    return text in ROBOTS or _PLANAR.fullmatch(text) is not None


def named_robot(model: str | os.PathLike[str]) -> Robot:
    """The robot that `model` stands for, computed by MuJoCo.

    Args:
        model: a name of `ROBOTS`, or the path of an MJCF or URDF file (see `load_robot`).

    Raises:
        MissingExtraError: mujoco is not installed.
        RobotError: a file that does not load.
        UnknownNameError: neither a name nor a file; the message lists the names.
    """
    text = os.fspath(model)
    if is_named(text):
        require(f"The robot {text!r}", "mujoco")
        return _named(text)
    path = user_path(text)
    if not path.exists():
        if path.suffix or path.parent != pathlib.Path("."):
            raise RobotError(
                f"The robot file {text!r} does not exist; give an MJCF or URDF file, or one of {_names()}."
            )
        raise unknown_name("robot or model file", text, ROBOTS)
    from hqp_rp.robot.model_file import load_robot

    return load_robot(path)


def _names() -> str:
    return ", ".join(ROBOTS)


def _named(name: str) -> Robot:
    from hqp_rp.robot.arms import panda_like, planar_arm, sawyer
    from hqp_rp.robot.dual_arm import dual_arm
    from hqp_rp.robot.mujoco_robot import MujocoRobot

    if name == "dual_sawyer":
        return dual_arm(sawyer())
    if name == "humanoid":
        robot = MujocoRobot.from_file(ASSETS / "humanoid.xml")
        return MujocoRobot(robot.model, neutral=robot.model.key("neutral").qpos)
    planar = _PLANAR.fullmatch(name)
    arm = planar_arm(int(planar[1])) if planar else {"sawyer": sawyer, "panda_like": panda_like}[name]()
    return MujocoRobot.from_arm(arm)
