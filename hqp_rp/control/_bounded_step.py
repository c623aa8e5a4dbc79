"""Steps of a root search over joint motions that stay within the joint limits."""

from __future__ import annotations

import numpy as np

from hqp_rp.control._coordinates import joint_positions
from hqp_rp.core.extras import require
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.robot import Robot

_NO_ROOM = 1e-14  # rad or m


def room(robot: Robot, q: FloatArray, index: IntArray | None, longest: float) -> tuple[FloatArray, FloatArray]:
    """Least and largest motion (nv,), (nv,) of each joint from q (nq,) within the limits, of `longest` at most (rad, m).

    `index` is `coordinate_index(robot, ...)`; q lies within the limits.
    """
    positions = joint_positions(q, index)
    return np.clip(robot.lower - positions, -longest, 0.0), np.clip(robot.upper - positions, 0.0, longest)


def levenberg_marquardt_step(
    change: FloatArray, residual: FloatArray, damping: float, lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """The s (nv,) with lower <= s <= upper that minimizes ||change s + residual||^2 + damping^2 ||s||^2.

    Args:
        change: (c, nv). residual: (c,). damping: >= 0, in the unit of `change`.
        lower, upper: (nv,), lower <= 0 <= upper; joints without room between the two stay.

    Source: Kanzow, Yamashita and Fukushima 2004, Levenberg-Marquardt methods for equations with convex constraints.
    """
    require("A bounded least-squares step", "scipy")
    from scipy.optimize import lsq_linear

    step = np.zeros(change.shape[1])
    free = upper - lower > _NO_ROOM
    count = int(free.sum())
    if count:
        matrix = np.vstack([change[:, free], damping * np.eye(count)])
        rhs = np.concatenate([-residual, np.zeros(count)])
        step[free] = lsq_linear(matrix, rhs, (lower[free], upper[free]), method="bvls").x
    return np.clip(step, lower, upper)  # the solver may pass a bound by a rounding error
