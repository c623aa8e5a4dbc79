"""Robots, configurations and tasks that the tests of pink's adapter share."""

import numpy as np
import pink
import pinocchio as pin
from pink.tasks import FrameTask

from hqp_rp.robot import PinocchioRobot, sawyer
from tests.robot.models import URDF

DT = 0.02
FRAMES = {"arm": ("tool", "link3"), "floating": ("fore", "base")}


def scene(kind, tmp_path, seed=0):
    """A robot at a configuration within its limits, and pink's configuration there."""
    rng = np.random.default_rng(seed)
    if kind == "arm":
        robot = PinocchioRobot.from_arm(sawyer())
    else:
        path = tmp_path / "robot.urdf"
        path.write_text(URDF, encoding="utf-8")
        robot = PinocchioRobot.from_file(path, floating_base=True)
    robot.update(robot.integrate(robot.neutral, rng.uniform(-0.7, 0.7, robot.nv), 1.0))
    return rng, robot, theirs_at(robot)


def theirs_at(robot):
    return pink.Configuration(robot.model, robot.model.createData(), robot.q)


def moved(pose, rng):
    return pose * pin.exp6(rng.uniform(-0.4, 0.4, 6))


def frame_task(kind, rng, configuration, **costs):
    task = FrameTask(FRAMES[kind][0], **costs)
    task.set_target(moved(configuration.get_transform_frame_to_world(task.frame), rng))
    return task


def away(robot, rng):
    return robot.integrate(robot.q, rng.uniform(-0.5, 0.5, robot.nv), 1.0)
