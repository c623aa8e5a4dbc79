"""The arms of the statistics: kinematics as published, and stacks that fit."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import UnknownNameError
from hqp_rp.compare.statistics.arms import ARMS, arm_named, scene_of
from hqp_rp.robot import panda_like


def test_the_panda_like_arm_has_the_published_kinematics() -> None:
    arm = panda_like()
    rotation, position = arm.pose(np.zeros((1, 7)), "tool")
    np.testing.assert_allclose(position[0], [0.088, 0.0, 0.333 + 0.316 + 0.384 - 0.107], atol=1e-12)
    np.testing.assert_allclose(rotation[0], np.diag([1.0, -1.0, -1.0]), atol=1e-12)
    # The proximal (Craig) rows of the manufacturer, composed independently.
    a = [0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088]
    alpha = np.array([0.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0]) * np.pi / 2.0
    d = [0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0]
    q = np.array(arm.neutral)
    T = np.eye(4)
    for i in range(7):
        ca, sa, cq, sq = np.cos(alpha[i]), np.sin(alpha[i]), np.cos(q[i]), np.sin(q[i])
        T = T @ np.array(
            [
                [cq, -sq, 0.0, a[i]],
                [sq * ca, cq * ca, -sa, -d[i] * sa],
                [sq * sa, cq * sa, ca, d[i] * ca],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
    flange = T @ np.array([0.0, 0.0, 0.107, 1.0])
    np.testing.assert_allclose(arm.pose(q[None], "tool")[1][0], flange[:3], atol=1e-12)


@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: arm.name)
def test_stacks_have_three_levels_of_which_two_can_be_met_together(arm: object) -> None:
    robot, stack = scene_of(arm.name)
    robot.update(robot.neutral)
    problem = stack.problem(robot)
    assert len(problem.levels) == 3
    rows = np.vstack([level.A for level in problem.levels[:2]])
    assert np.linalg.matrix_rank(rows) == len(rows) < robot.nv


def test_an_unknown_arm_is_named_with_what_there_is() -> None:
    with pytest.raises(UnknownNameError, match="panda_like"):
        arm_named("panda")
