"""Poses and Jacobians of one frame at many configurations in one call."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core.errors import RobotError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.dh import DHArm
from hqp_rp.robot.frames import frames_of
from hqp_rp.robot.robot import Robot


class FrameBatch(NamedTuple):
    """A frame at N configurations: rotations (N, 3, 3) to the world, origins (N, 3) m, jacobians (N, 6, nv).

    Jacobians hold the linear velocity of the frame's origin over the angular velocity, both in world axes.
    """

    rotations: FloatArray
    origins: FloatArray
    jacobians: FloatArray


def frame_batch(robot: Robot | DHArm, frame: str, q: ArrayLike, *, threads: int | None = None) -> FrameBatch:
    """Poses and Jacobians of `frame` at the configurations q (N, nq).

    A `DHArm`, and a `MujocoRobot` made from one, take one native call: eight configurations side by side in vector
    registers, all cores, no Python per configuration. Any other robot is moved from one to the next, and put back.

    Args:
        robot: a `DHArm` or any `Robot`. frame: one of its frames.
        q: (N, nq), rad or m, finite.
        threads: how many share the configurations of an arm; None means one for each core.

    Raises:
        RobotError: q of another shape or not finite; a frame that the robot does not have.
        SettingError: threads that are no number of threads.
    """
    values = np.array(q, dtype=np.float64)
    nq = robot.n if isinstance(robot, DHArm) else robot.nq
    if values.ndim != 2 or values.shape[1] != nq:
        raise RobotError(f"q has shape {values.shape}; it must be (N, {nq}), one row for each configuration.")
    if isinstance(robot, DHArm):
        return FrameBatch(*robot.kinematics(values, frame, threads=threads))
    found = frames_of(robot, (frame,)).many(values, threads)
    return FrameBatch(found[0][:, 0], found[1][:, 0], found[2][:, 0])
