"""Configurations of any robot within its joint limits."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from hqp_rp.control._coordinates import coordinate_index, joint_positions
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.robot import Robot

_OWNER = "drawing configurations"


def random_configurations(robot: Robot, count: int, seed: int) -> Iterator[FloatArray]:
    """`count` configurations (nq,), uniform within the limits; the s-th depends on (seed, s) only.

    A joint without a limit is drawn within pi (rad or m) of neutral; a ball or free joint is turned from neutral by a
    rotation vector with each component within pi. Raises `RobotError` for a limited ball joint.
    """
    index = coordinate_index(robot, _OWNER)
    neutral = joint_positions(robot.neutral, index)
    lower = np.where(np.isfinite(robot.lower), robot.lower, np.minimum(neutral, robot.upper) - math.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.maximum(neutral, robot.lower) + math.pi)
    for s in range(count):
        positions = np.random.default_rng((seed, s)).uniform(lower, upper)
        yield within_limits(robot, robot.integrate(robot.neutral, positions - neutral, 1.0), index)


def within_limits(robot: Robot, q: FloatArray, index: IntArray | None) -> FloatArray:
    """q (nq,) with every hinge and slide clipped into its limits; `index` is `coordinate_index(robot, ...)`."""
    if index is None:
        return np.clip(q, robot.lower, robot.upper)
    q, own = q.copy(), index >= 0
    q[index[own]] = np.clip(q[index[own]], robot.lower[own], robot.upper[own])
    return q
