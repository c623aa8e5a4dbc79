"""Random configurations: within the limits, over all of them, the same whatever their number."""

from __future__ import annotations

import mujoco
import numpy as np

from hqp_rp.control._coordinates import coordinate_index
from hqp_rp.control._sampling import random_configurations, within_limits
from hqp_rp.robot.arms import planar_arm
from hqp_rp.robot.mujoco_robot import MujocoRobot


def free_robot() -> MujocoRobot:
    """A free body with a limited slide, a hinge without limit, and a hinge limited on one side of zero."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    body = spec.worldbody.add_body(name="base")
    body.add_freejoint()
    body.add_geom(size=[0.1, 0.1, 0.1])
    for name, kind, limits in (
        ("slide", mujoco.mjtJoint.mjJNT_SLIDE, (-0.2, 0.5)),
        ("free hinge", mujoco.mjtJoint.mjJNT_HINGE, None),
        ("hinge", mujoco.mjtJoint.mjJNT_HINGE, (0.5, 1.0)),
    ):
        body = body.add_body(name=f"after {name}")
        body.add_geom(size=[0.1, 0.1, 0.1])
        joint = body.add_joint(name=name, type=kind, axis=[0.0, 0.0, 1.0])
        if limits is not None:
            joint.limited, joint.range = mujoco.mjtLimited.mjLIMITED_TRUE, limits
    neutral = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.1, 2.0, 0.75])
    return MujocoRobot.from_spec(spec, neutral=neutral)


def test_an_arm_is_drawn_over_its_whole_range() -> None:
    robot = MujocoRobot.from_arm(planar_arm(3, joint_limit=1.5))
    drawn = np.array(list(random_configurations(robot, 400, 0)))
    assert np.abs(drawn).max() <= 1.5
    assert (drawn.min(axis=0) < -1.4).all()
    assert (drawn.max(axis=0) > 1.4).all()
    np.testing.assert_allclose(drawn.mean(axis=0), 0.0, atol=0.15)


def test_a_draw_depends_on_the_seed_and_its_number_only() -> None:
    robot = MujocoRobot.from_arm(planar_arm(3))
    few, many = (list(random_configurations(robot, count, 5)) for count in (3, 7))
    np.testing.assert_array_equal(few, many[:3])
    assert not np.array_equal(few[0], next(random_configurations(robot, 1, 6)))


def test_a_free_base_and_joints_without_limits() -> None:
    robot = free_robot()
    drawn = np.array(list(random_configurations(robot, 300, 0)))
    np.testing.assert_allclose(np.linalg.norm(drawn[:, 3:7], axis=1), 1.0, atol=1e-12)
    slide, free, hinge = drawn[:, 7:].T
    assert -0.2 <= slide.min() < -0.15 < 0.45 < slide.max() <= 0.5
    assert 2.0 - np.pi <= free.min() < -1.0 < 5.0 < free.max() <= 2.0 + np.pi
    assert 0.5 <= hinge.min() < 0.55 < 0.95 < hinge.max() <= 1.0


def test_clipping_touches_hinges_and_slides_only() -> None:
    robot = free_robot()
    q = np.array([9.0, 9.0, 9.0, 0.6, 0.8, 0.0, 0.0, 9.0, 9.0, -9.0])
    clipped = within_limits(robot, q, coordinate_index(robot, "a test"))
    np.testing.assert_array_equal(clipped, [9.0, 9.0, 9.0, 0.6, 0.8, 0.0, 0.0, 0.5, 9.0, 0.5])
    assert q[7] == 9.0
