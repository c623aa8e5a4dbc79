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
    index = _moved_alone(robot, robot.neutral)
    limited = np.isfinite(robot.lower) | np.isfinite(robot.upper)
    missing = np.flatnonzero(limited & (index < 0))
    if missing.size:
        raise RobotError(
            f"{owner}: velocity index {int(missing[0])} has a position limit but no coordinate of its own (a ball joint?); "
            "only the positions of hinges and slides can be limited."
        )
    return index


def plain_coordinates(robot: Robot) -> IntArray:
    """(nv,) index into q of the coordinate whose plain difference is the robot's own, at any distance; -1 where there is none.

    So it is for hinges and slides, and for the position of a free joint whose velocity is along world axes.
    """
    if robot.nq == robot.nv:
        return np.arange(robot.nv)
    start = robot.integrate(robot.neutral, 0.3 * np.sin(1.0 + np.arange(robot.nv)), 1.0)
    index = _moved_alone(robot, start)
    own = np.flatnonzero(index >= 0)
    # More than a turn: a robot that takes angles the short way round does not subtract them plainly.
    away = 7.0 + 0.1 * np.arange(len(own))
    end = start.copy()
    end[index[own]] += away
    index[own[np.abs(robot.difference(start, end)[own] - away) > 1e-9]] = -1
    return index


def _moved_alone(robot: Robot, q: FloatArray) -> IntArray:
    """(nv,) index into q of the coordinate that alone moves, by s, when velocity i moves by s from q; -1: none does."""
    index = np.full(robot.nv, -1, dtype=np.int64)
    step = 0.1
    for i in range(robot.nv):
        moved = robot.integrate(q, step * np.eye(robot.nv)[i], 1.0) - q
        changed = np.flatnonzero(np.abs(moved) > 1e-12)
        if changed.size == 1 and abs(moved[changed[0]] - step) < 1e-9:
            index[i] = changed[0]
    return index


def joint_positions(q: FloatArray, index: IntArray | None) -> FloatArray:
    """(nv,) joint positions in rad or m from q (nq,); 0 where a velocity has no coordinate of its own."""
    return q if index is None else np.where(index >= 0, q[index], 0.0)
