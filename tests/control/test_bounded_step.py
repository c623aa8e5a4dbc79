"""Steps within the joint limits: where the motion has room, the least-squares step, else the best that the limits leave."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from hqp_rp.control._bounded_step import levenberg_marquardt_step, room
from hqp_rp.control._coordinates import coordinate_index, joint_positions
from hqp_rp.robot.arms import planar_arm
from hqp_rp.robot.mujoco_robot import MujocoRobot
from hqp_rp.robot.named import named_robot


def cost(step: np.ndarray, change: np.ndarray, residual: np.ndarray, damping: float) -> float:
    return float(np.square(change @ step + residual).sum() + damping**2 * np.square(step).sum())


@pytest.mark.parametrize("seed", range(8))
def test_the_step_against_every_choice_of_bounds(seed: int) -> None:
    """The optimum within a box has some entries at their bounds and the others free: the best feasible one of all choices."""
    rng = np.random.default_rng(seed)
    change, residual = rng.standard_normal((2, 4)), 0.5 * rng.standard_normal(2)
    lower, upper = -rng.uniform(0.01, 0.3, 4), rng.uniform(0.01, 0.3, 4)
    lower[0] = upper[0] = 0.0
    damping = 0.05
    step = levenberg_marquardt_step(change, residual, damping, lower, upper)
    assert (step >= lower).all()
    assert (step <= upper).all()
    least = np.inf
    for choice in itertools.product((lower, None, upper), repeat=4):
        held = np.array([bound is not None for bound in choice])
        tried = np.array([0.0 if bound is None else bound[i] for i, bound in enumerate(choice)])
        J = change[:, ~held]
        tried[~held] = -np.linalg.solve(
            J.T @ J + damping**2 * np.eye(J.shape[1]), J.T @ (residual + change[:, held] @ tried[held])
        )
        if (tried >= lower).all() and (tried <= upper).all():
            least = min(least, cost(tried, change, residual, damping))
    assert cost(step, change, residual, damping) == pytest.approx(least, rel=1e-9)


def test_a_motion_without_any_room_is_none() -> None:
    zero = np.zeros(3)
    np.testing.assert_array_equal(levenberg_marquardt_step(np.ones((1, 3)), np.ones(1), 0.0, zero, zero), zero)


@pytest.mark.parametrize("model", ["humanoid", "arm"])
def test_the_room_ends_at_the_limits(model: str) -> None:
    robot = named_robot("humanoid") if model == "humanoid" else MujocoRobot.from_arm(planar_arm(3))
    index = coordinate_index(robot, "this test")
    lower, upper = room(robot, robot.neutral, index, 0.3)
    assert (lower >= -0.3).all()
    assert (lower <= 0.0).all()
    assert (upper >= 0.0).all()
    assert (upper <= 0.3).all()
    for motion, limit in ((lower, robot.lower), (upper, robot.upper)):
        reached = joint_positions(robot.integrate(robot.neutral, motion, 1.0), index)
        short = np.abs(motion) < 0.3
        np.testing.assert_allclose(reached[short], limit[short], atol=1e-15)
    if model == "humanoid":
        np.testing.assert_array_equal(upper[:6], 0.3)  # the free base has no limits
