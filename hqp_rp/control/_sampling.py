"""Configurations of any robot within its joint limits."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from hqp_rp.control._coordinates import coordinate_index, joint_positions
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.robot import Robot

_OWNER = "drawing configurations"


class Sampler:
    """Draws configurations of one robot.

    A joint without a limit is drawn within pi (rad or m) of neutral; a ball or free joint is turned from neutral by a
    rotation vector with each component within pi. Raises `RobotError` for a limited ball joint.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._index = coordinate_index(robot, _OWNER)
        self._neutral = neutral = joint_positions(robot.neutral, self._index)
        self._lower = np.where(np.isfinite(robot.lower), robot.lower, np.minimum(neutral, robot.upper) - math.pi)
        self._upper = np.where(np.isfinite(robot.upper), robot.upper, np.maximum(neutral, robot.lower) + math.pi)
        self._bounds = np.stack([np.isfinite(robot.lower), np.isfinite(robot.upper)])

    @property
    def limited(self) -> bool:
        """Whether any joint has a limit."""
        return bool(self._bounds.any())

    def uniform(self, rng: np.random.Generator) -> FloatArray:
        """(nq,) uniform within the limits."""
        return self._at(rng.uniform(self._lower, self._upper))

    def near_limits(self, rng: np.random.Generator, decades: tuple[float, float] = (1.0, 8.0)) -> FloatArray:
        """(nq,) uniform within the limits, but each limited joint with probability 1/2, one at least, near a limit of its.

        Near: at 10^-d of its range from it, d uniform in `decades`.
        """
        positions = rng.uniform(self._lower, self._upper)
        near = self._bounds.any(axis=0) & (rng.random(len(positions)) < 0.5)
        limited = np.flatnonzero(self._bounds.any(axis=0))
        near[limited[int(rng.integers(len(limited)))]] = True
        upper = np.where(self._bounds.all(axis=0), rng.random(len(positions)) < 0.5, self._bounds[1])
        distance = (self._upper - self._lower) * 10.0 ** -rng.uniform(*decades, len(positions))
        return self._at(np.where(near, np.where(upper, self._upper - distance, self._lower + distance), positions))

    def _at(self, positions: FloatArray) -> FloatArray:
        q = self._robot.integrate(self._robot.neutral, positions - self._neutral, 1.0)
        return within_limits(self._robot, q, self._index)


def random_configurations(robot: Robot, count: int, seed: int) -> Iterator[FloatArray]:
    """`count` configurations (nq,), uniform within the limits (see `Sampler`); the s-th depends on (seed, s) only."""
    sampler = Sampler(robot)
    for s in range(count):
        yield sampler.uniform(np.random.default_rng((seed, s)))


def within_limits(robot: Robot, q: FloatArray, index: IntArray | None) -> FloatArray:
    """q (nq,) with every hinge and slide clipped into its limits; `index` is `coordinate_index(robot, ...)`."""
    if index is None:
        return np.clip(q, robot.lower, robot.upper)
    q, own = q.copy(), index >= 0
    q[index[own]] = np.clip(q[index[own]], robot.lower[own], robot.upper[own])
    return q
