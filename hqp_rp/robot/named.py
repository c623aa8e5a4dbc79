"""A robot from one word: the name of one of the library's robots, or a model file."""

from __future__ import annotations

import os
import pathlib
import re

from hqp_rp.core.errors import RobotError, unknown_name
from hqp_rp.core.paths import user_path
from hqp_rp.robot.robot import Robot

ASSETS = pathlib.Path(__file__).with_name("assets")

ROBOTS = {
    "sawyer": "the 7-joint Sawyer of the paper's Table 1",
    "planarN": "a planar arm of N joints of 0.4 m, such as planar4",
    "dual_sawyer": "two Sawyers side by side, 0.6 m apart; frames left_tool, right_tool and so on",
    "humanoid": "a humanoid of primitive shapes on a floating base, 29 joints, 35 velocities",
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
        RobotError: a file that does not load.
        UnknownNameError: neither a name nor a file; the message lists the names.
    """
    from hqp_rp.robot.arms import planar_arm, sawyer
    from hqp_rp.robot.mujoco_robot import MujocoRobot

    text = os.fspath(model)
    planar = _PLANAR.fullmatch(text)
    if text == "sawyer":
        return MujocoRobot.from_arm(sawyer())
    if planar:
        return MujocoRobot.from_arm(planar_arm(int(planar[1])))
    if text == "dual_sawyer":
        from hqp_rp.robot.dual_arm import dual_arm

        return dual_arm(sawyer())
    if text == "humanoid":
        return _humanoid()
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


def _humanoid() -> Robot:
    from hqp_rp.robot.mujoco_robot import MujocoRobot

    robot = MujocoRobot.from_file(ASSETS / "humanoid.xml")
    return MujocoRobot(robot.model, neutral=robot.model.key("neutral").qpos)
