"""Distances between geoms: what is known in closed form, and what they leave untouched."""

import mujoco
import numpy as np
import pytest

from hqp_rp.robot import MujocoRobot, sawyer
from hqp_rp.robot.mujoco_distance import MujocoDistances

MODEL = """
<mujoco><worldbody>
  <geom name="floor" type="plane" size="1 1 1"/>
  <body name="ball" pos="0 0 1"><freejoint/><geom name="ball" size=".1"/></body>
  <body name="rod" pos="1 0 1"><joint name="turn" axis="0 1 0"/><geom name="rod" type="capsule" size=".05 .3"/></body>
</worldbody></mujoco>
"""


@pytest.fixture
def robot() -> MujocoRobot:
    return MujocoRobot(mujoco.MjModel.from_xml_string(MODEL))


def test_distances_and_derivatives_in_closed_form(robot: MujocoRobot) -> None:
    measure = MujocoDistances(robot, [("ball", "floor"), ("ball", "rod")], detection=5.0)
    assert measure.names == (("ball", "floor"), ("ball", "rod"))
    assert len(measure) == 2
    for x, z in ((0.0, 1.0), (0.2, 0.6), (0.5, 1.25)):
        q = np.array([x, 0.0, z, 1.0, 0.0, 0.0, 0.0, 0.0])
        distances, jacobian = measure.evaluate(q)
        to_rod = np.array([1.0 - x, np.clip(z, 0.7, 1.3) - z])  # from the ball's centre, in x and z
        length = np.linalg.norm(to_rod)
        np.testing.assert_allclose(distances, [z - 0.1, length - 0.15], atol=1e-9)
        np.testing.assert_allclose(measure.distances(q), distances, atol=0.0)
        np.testing.assert_allclose(jacobian[0], [0, 0, 1, 0, 0, 0, 0], atol=1e-9)
        np.testing.assert_allclose(jacobian[1, [0, 2]], -to_rod / length, atol=1e-6)
        # The rod turns about y through its centre: the lever is the height of the nearest point.
        height = np.clip(z, 0.7, 1.3) - 1.0 - 0.05 * to_rod[1] / length
        lever = -0.05 * to_rod[0] / length
        turning = np.array([height, -lever]) @ to_rod / length
        np.testing.assert_allclose(jacobian[1, 6], turning, atol=1e-6)


@pytest.mark.parametrize("gap", [0.0, 1e-9, -1e-9, 3e-8])
def test_touching_geoms_still_have_a_normal(robot: MujocoRobot, gap: float) -> None:
    measure = MujocoDistances(robot, [("ball", "floor"), ("ball", "rod")])
    _, jacobian = measure.evaluate(np.array([0.85 - gap, 0.0, 1.0, 1.0, 0, 0, 0, 0]))
    np.testing.assert_allclose(jacobian[1, :3], [-1.0, 0.0, 0.0], atol=1e-5)
    _, jacobian = measure.evaluate(np.array([0.3, 0.0, 0.1 + gap, 1.0, 0, 0, 0, 0]))
    np.testing.assert_allclose(jacobian[0, :3], [0.0, 0.0, 1.0], atol=1e-5)


def test_centres_that_coincide_get_some_direction() -> None:
    spheres = "".join(f'<body name="b{i}"><freejoint/><geom name="s{i}" size=".1"/></body>' for i in range(2))
    robot = MujocoRobot(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{spheres}</worldbody></mujoco>"))
    distances, jacobian = MujocoDistances(robot, [("s0", "s1")]).evaluate(robot.neutral)
    assert distances[0] == pytest.approx(-0.2)
    assert np.linalg.norm(jacobian[0, 6:9]) == pytest.approx(1.0)
    np.testing.assert_allclose(jacobian[0, :3], -jacobian[0, 6:9])


def test_the_robot_is_left_as_it_was(robot: MujocoRobot) -> None:
    before, simulated = robot.pose("ball")[1], robot.data.qpos.copy()
    measure = MujocoDistances(robot, [("ball", "floor")])
    measure.evaluate(robot.neutral + np.array([0, 0, 1.0, 0, 0, 0, 0, 0]))
    np.testing.assert_array_equal(robot.pose("ball")[1], before)
    np.testing.assert_array_equal(robot.q, robot.neutral)
    np.testing.assert_array_equal(robot.data.qpos, simulated)


def test_bodies_and_geoms_of_the_same_name_are_one_on_the_arms() -> None:
    robot = MujocoRobot.from_arm(sawyer())
    assert MujocoDistances(robot, [("link1", "link7")]).names == (("link1", "link7"),)
