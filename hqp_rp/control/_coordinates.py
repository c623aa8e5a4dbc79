"""Joint positions by velocity index, also for robots whose configuration holds quaternions."""

from __future__ import annotations

import numpy as np

from hqp_rp.core.errors import RobotError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.robot import Robot


def coordinate_index(robot: Robot, owner: str) -> IntArray | None:
    """(nv,) index into q of the one coordinate that moves by s when velocity i moves by s, -1 where there is none.

    None when it is the identity. Found by moving each velocity on its own, so that it holds for every library's layout of
    q. Raises `RobotError` when a velocity without such a coordinate has a finite position limit.
    """
    if robot.nq == robot.nv:
        return None
    index = np.full(robot.nv, -1, dtype=np.int64)
    step = 0.1
    for i in range(robot.nv):
        moved = robot.integrate(robot.neutral, step * np.eye(robot.nv)[i], 1.0) - robot.neutral
        changed = np.flatnonzero(np.abs(moved) > 1e-12)
        if changed.size == 1 and abs(moved[changed[0]] - step) < 1e-9:
            index[i] = changed[0]
    limited = np.isfinite(robot.lower) | np.isfinite(robot.upper)
    missing = np.flatnonzero(limited & (index < 0))
    if missing.size:
        raise RobotError(
            f"{owner}: velocity index {int(missing[0])} has a position limit but no coordinate of its own (a ball joint?); "
            "only the positions of hinges and slides can be limited."
        )
    return index


def joint_positions(q: FloatArray, index: IntArray | None) -> FloatArray:
    """(nv,) joint positions in rad or m from q (nq,); 0 where a velocity has no coordinate of its own."""
    return q if index is None else np.where(index >= 0, q[index], 0.0)
