"""Poses and Jacobians read out of MuJoCo's memory, against MuJoCo's own functions, joint by joint and model by model."""

import gc

import mujoco
import numpy as np
import pytest

from hqp_rp import RobotError
from hqp_rp.robot import MujocoRobot, planar_arm, sawyer
from hqp_rp.robot.frames import Point, frames_of
from hqp_rp.robot.mujoco_frames import MujocoFrames
from hqp_rp.robot.named import named_robot
from tests.robot.models import MIXED_MJCF

# Two trees beside bodies that are fixed to the world, one of them below a fixed one; all four kinds of joints, several of them
# on one body, axes and anchors off the body's own, a body without joints within a chain, and a mocap body.
FOREST_MJCF = """
<mujoco model="forest">
  <worldbody>
    <site name="floor mark" pos=".3 .2 .1" euler="10 0 0"/>
    <body name="pillar" pos="0 0 1" euler="0 20 0">
      <geom size=".1" mass="4"/>
      <body name="bracket" pos=".2 0 .1"><geom size=".05" mass="1"/><site name="on bracket" pos="0 .1 0"/></body>
      <body name="wrist" pos=".1 .3 0" euler="30 0 10">
        <joint type="slide" name="reach" axis="1 2 3" pos="0 .1 .2"/>
        <joint type="ball" name="wrist" pos=".1 .05 0"/>
        <geom size=".1" mass="1.5" pos=".2 0 0"/>
        <body name="plate" pos=".1 .1 .1" euler="5 6 7">
          <geom size=".05" mass=".3"/>
          <body name="finger" pos="0 0 .2">
            <joint type="slide" name="grip" axis="0 1 1" pos=".1 0 0"/>
            <joint type="hinge" name="curl" axis="0 0 1" ref="10"/>
            <geom size=".04" mass=".2" pos="0 .1 0"/><site name="nail" pos=".02 .1 0" euler="20 30 40"/>
          </body>
        </body>
      </body>
    </body>
    <body name="target" mocap="true" pos="1 1 1"><site name="aim"/></body>
    <body name="cart" pos="2 0 0">
      <joint type="slide" name="x" axis="1 0 0"/><joint type="slide" name="y" axis="0 1 0"/>
      <joint type="hinge" name="heading" axis="0 0 1"/>
      <geom type="box" size=".3 .2 .1" mass="7"/>
      <body name="mast" pos="0 0 .4"><joint name="tilt" axis="0 1 0" pos="0 0 -.2"/><geom size=".1" mass="1"/></body>
    </body>
    <body name="drone" pos="0 3 1" euler="40 50 60"><freejoint/><geom size=".1" mass=".7" pos=".05 0 .02"/>
      <site name="camera" pos=".1 0 .1"/></body>
  </worldbody>
</mujoco>
"""


def forest() -> MujocoRobot:
    return MujocoRobot(mujoco.MjModel.from_xml_string(FOREST_MJCF))


ROBOTS = {
    "sawyer": lambda: MujocoRobot.from_arm(sawyer()),
    "planar1": lambda: MujocoRobot.from_arm(planar_arm(1)),
    "mixed": lambda: MujocoRobot(mujoco.MjModel.from_xml_string(MIXED_MJCF)),
    "forest": forest,
    "humanoid": lambda: named_robot("humanoid"),
    "dual": lambda: named_robot("dual_sawyer"),
}


def by_mujoco(robot, q, names):
    """Rotations, origins and Jacobians by mj_forward, mj_jacBody, mj_jacSite and mj_jac of every body's centre of mass."""
    model = robot.model
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    found = []
    for name in names:
        J = np.zeros((6, model.nv))
        if isinstance(name, Point):
            moving = [b for b in range(model.nbody) if model.body_treeid[b] >= 0]
            mass, c, column = 0.0, np.zeros(3), np.zeros((3, model.nv))
            for b in moving:
                mujoco.mj_jac(model, data, column, None, data.xipos[b], b)
                mass, c, J[:3] = (
                    mass + model.body_mass[b],
                    c + model.body_mass[b] * data.xipos[b],
                    J[:3] + model.body_mass[b] * column,
                )
            found.append((np.eye(3), c / mass, J / mass))
            continue
        kind, _, bare = name.rpartition(":")
        site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, bare)
        if site >= 0 and kind != "body":
            mujoco.mj_jacSite(model, data, J[:3], J[3:], site)
            found.append((data.site_xmat[site].reshape(3, 3).copy(), data.site_xpos[site].copy(), J))
        else:
            body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, bare)
            mujoco.mj_jacBody(model, data, J[:3], J[3:], body)
            found.append((data.xmat[body].reshape(3, 3).copy(), data.xpos[body].copy(), J))
    return tuple(np.stack([one[k] for one in found]) for k in range(3))


def draw(robot, rng):
    return robot.integrate(robot.neutral, rng.normal(size=robot.nv), 1.0)


def check(robot, frames, q):
    robot.update(q)
    frames.read()
    for found, expected in zip(
        (frames.rotations, frames.origins, frames.jacobians), by_mujoco(robot, q, frames.names), strict=True
    ):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=3e-15)
    for name, jacobian in zip(frames.names, frames.jacobians, strict=True):
        own = robot.center_of_mass_jacobian() if isinstance(name, Point) else robot.jacobian(name)
        np.testing.assert_array_equal(jacobian[: len(own)], own)


@pytest.mark.parametrize("kind", ROBOTS)
def test_every_frame_of_every_kind_of_tree(kind):
    robot, rng = ROBOTS[kind](), np.random.default_rng(0)
    frames = frames_of(robot, (*robot.frame_names, Point.CENTER_OF_MASS))
    assert isinstance(frames, MujocoFrames)
    for _ in range(4):
        check(robot, frames, draw(robot, rng))


def test_a_model_whose_numbers_are_changed_in_place_is_followed():
    robot, rng = forest(), np.random.default_rng(1)
    frames = frames_of(robot, (*robot.frame_names, Point.CENTER_OF_MASS))
    before = by_mujoco(robot, robot.neutral, frames.names)
    model = robot.model
    bodies = np.flatnonzero(model.body_mocapid < 0)[1:]  # where a mocap body is, the state says
    model.body_pos[bodies] += 0.1 * rng.normal(size=(len(bodies), 3))
    model.jnt_pos[:] += 0.1 * rng.normal(size=(model.njnt, 3))
    model.site_pos[:] += 0.1
    for joint in ("reach", "curl", "grip"):
        model.joint(joint).axis[:] = [0.6, 0.0, 0.8]
    # The total stays: what a robot weighs is read when it is made.
    first, second = model.body("plate").id, model.body("mast").id
    model.body_mass[first] += 0.2
    model.body_mass[second] -= 0.2
    after = by_mujoco(robot, robot.neutral, frames.names)
    assert not any(np.allclose(a, b) for a, b in zip(before[1:], after[1:], strict=True))
    check(robot, frames, draw(robot, rng))


def test_the_memory_that_is_read_outlives_the_robot():
    robot = forest()
    q = draw(robot, np.random.default_rng(2))
    frames = frames_of(robot, ("nail", Point.CENTER_OF_MASS))
    robot.update(q)
    expected = by_mujoco(robot, q, frames.names)
    del robot, frames._robot
    gc.collect()
    _ = [forest() for _ in range(20)]  # whoever reuses the memory
    frames.read()
    np.testing.assert_allclose(frames.jacobians, expected[2], rtol=0.0, atol=3e-15)


def test_many_are_those_one_by_one_and_put_the_robot_back():
    robot, rng = forest(), np.random.default_rng(3)
    frames = frames_of(robot, ("nail", "camera"))
    q = np.array([draw(robot, rng) for _ in range(3)])
    before = robot.q
    found = frames.many(q)
    np.testing.assert_array_equal(robot.q, before)
    for i, configuration in enumerate(q):
        for own, expected in zip(found, by_mujoco(robot, configuration, frames.names), strict=True):
            np.testing.assert_allclose(own[i], expected, rtol=0.0, atol=3e-15)


def test_misuse():
    robot = forest()
    with pytest.raises(RobotError, match=r"named 'nal'\. Did you mean 'nail'"):
        frames_of(robot, ("nal",))
    massless = MujocoRobot(robot.model)
    massless._moving_mass = 0.0
    for ask in (lambda: frames_of(massless, (Point.CENTER_OF_MASS,)), massless.center_of_mass):
        with pytest.raises(RobotError, match="has no moving mass, hence no centre of mass"):
            ask()
