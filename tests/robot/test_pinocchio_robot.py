"""What is Pinocchio's own: its conventions, its shapes, its reader as a witness, misuse."""

import pickle

import numpy as np
import pinocchio as pin
import pytest

from hqp_rp import RobotError
from hqp_rp.robot import MujocoRobot, PinocchioRobot, planar_arm, sawyer
from tests.robot.models import MIXED_MJCF, URDF

PLAIN_MJCF = """
<mujoco model="plain">
  <compiler angle="radian"/>
  <worldbody>
    <body name="a" pos="0 0 .3">
      <freejoint name="free"/>
      <inertial pos=".1 0 .2" mass="2" diaginertia=".1 .2 .15"/>
      <body name="b" pos="0 .1 .4" quat=".8 .6 0 0">
        <joint name="j" axis="0 .6 .8" range="-1 2" armature=".3"/>
        <inertial pos=".1 0 .2" mass="1" diaginertia=".1 .2 .15"/>
        <body name="c" pos=".2 0 .1">
          <joint name="k" type="slide" axis="1 0 0" range="-.5 .5"/>
          <inertial pos="0 .3 .2" mass=".5" diaginertia=".1 .2 .15"/>
          <site name="s" pos="0 0 .2"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def mixed(tmp_path) -> PinocchioRobot:
    path = tmp_path / "mixed.xml"
    path.write_text(MIXED_MJCF)
    return PinocchioRobot.from_file(path)


@pytest.fixture
def two(tmp_path) -> PinocchioRobot:
    path = tmp_path / "two.urdf"
    path.write_text(URDF)
    return PinocchioRobot.from_file(path)


def test_an_mjcf_means_what_pinocchios_own_reader_takes_it_for(tmp_path):
    path = tmp_path / "plain.xml"
    path.write_text(PLAIN_MJCF)
    robot, witness = PinocchioRobot.from_file(path), PinocchioRobot(pin.buildModelFromMJCF(str(path)))
    assert robot.joint_names == witness.joint_names
    np.testing.assert_allclose(robot.lower[6:], witness.lower[6:])
    np.testing.assert_allclose(robot.upper[6:], witness.upper[6:])
    q = robot.integrate(robot.neutral, np.linspace(-0.6, 0.7, 8), 1.0)
    robot.update(q)
    witness.update(q)
    for frame in ("a", "b", "c", "s"):
        np.testing.assert_allclose(robot.pose(frame)[0], witness.pose(frame)[0], atol=1e-12)
        np.testing.assert_allclose(robot.pose(frame)[1], witness.pose(frame)[1], atol=1e-12)
        np.testing.assert_allclose(robot.jacobian(frame), witness.jacobian(frame), atol=1e-12)
    np.testing.assert_allclose(robot.mass_matrix(), witness.mass_matrix(), atol=1e-12)
    np.testing.assert_allclose(robot.gravity(), witness.gravity(), atol=1e-12)
    np.testing.assert_allclose(robot.center_of_mass_jacobian(), witness.center_of_mass_jacobian(), atol=1e-12)


def test_gravity_of_an_mjcf_is_read_and_can_be_switched_off(tmp_path, mixed):
    np.testing.assert_array_equal(mixed.model.gravity.linear, [1.0, 0.0, -5.0])
    path = tmp_path / "floating.xml"
    path.write_text(MIXED_MJCF.replace('gravity="1 0 -5"/>', 'gravity="1 0 -5"><flag gravity="disable"/></option>'))
    np.testing.assert_array_equal(PinocchioRobot.from_file(path).gravity(), np.zeros(12))
    np.testing.assert_array_equal(MujocoRobot.from_file(path).gravity(), np.zeros(12))


def test_one_joint_still_gives_matrices():
    robot = PinocchioRobot.from_arm(planar_arm(1))
    assert robot.jacobian("tool").shape == (6, 1)
    assert robot.center_of_mass_jacobian().shape == (3, 1)
    assert robot.mass_matrix().shape == (1, 1)
    assert robot.gravity().shape == (1,)


def test_a_continuous_joint_is_a_cosine_and_a_sine(two):
    assert (two.nq, two.nv) == (3, 2)
    np.testing.assert_array_equal(two.lower, [-1.0, -np.inf])
    angle = 0.7
    two.update(np.array([0.2, np.cos(angle), np.sin(angle)]))
    expected = two.pose("tool")
    two.update(np.array([0.2, 3.0 * np.cos(angle), 3.0 * np.sin(angle)]))
    np.testing.assert_allclose(two.pose("tool")[0], expected[0], atol=1e-15)
    with pytest.raises(
        RobotError, match=r"q holds a zero quaternion or a zero \(cos, sin\); it must have a direction."
    ):
        two.update(np.array([0.2, 0.0, 0.0]))


def test_a_joint_that_shares_a_links_name_is_asked_for_as_a_joint(two):
    assert {"tool", "joint:tool", "shoulder"} <= set(two.frame_names)
    np.testing.assert_allclose(two.pose("joint:tool")[1], two.pose("tool")[1], atol=1e-15)


def test_dynamics_leave_the_frame_jacobians_alone():
    robot = PinocchioRobot.from_arm(sawyer())
    robot.update(np.linspace(-1.0, 1.0, 7))
    before = robot.jacobian("tool")
    robot.mass_matrix(), robot.gravity(), robot.center_of_mass(), robot.center_of_mass_jacobian()
    np.testing.assert_array_equal(robot.jacobian("tool"), before)


def test_returned_arrays_are_fresh_and_the_stored_ones_read_only():
    robot = PinocchioRobot.from_arm(sawyer())
    q = np.linspace(-1.0, 1.0, 7)
    robot.update(q)
    mass = robot.mass_matrix()
    q[:] = 0.0
    np.testing.assert_array_equal(robot.mass_matrix(), mass)
    for call in (lambda: robot.pose("tool")[0], lambda: robot.jacobian("tool"), robot.mass_matrix, robot.gravity):
        robot.update(np.linspace(-1.0, 1.0, 7))
        value = call()
        kept = value.copy()
        robot.update(np.zeros(7))
        call()
        np.testing.assert_array_equal(value, kept)
        assert value.flags.c_contiguous
        value[:] = 0.0
    for value in (robot.q, robot.lower, robot.upper, robot.velocity_limit, robot.neutral):
        with pytest.raises(ValueError, match="read-only"):
            value[0] = 1.0


def test_a_robot_can_be_sent_to_another_process():
    robot = PinocchioRobot.from_arm(sawyer())
    robot.update(np.linspace(-1.0, 1.0, 7))
    other = pickle.loads(pickle.dumps(robot))
    np.testing.assert_array_equal(other.q, robot.q)
    np.testing.assert_array_equal(other.jacobian("tool"), robot.jacobian("tool"))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda r: r.pose("both"),
            "'both' of the Pinocchio model 'mixed' is ambiguous: write 'body:both' or 'site:both'.",
        ),
        (lambda r: r.jacobian("bse"), "named 'bse'. Did you mean 'base'. Valid: arm, base, body:both, fixed, mark,"),
        (lambda r: r.update(np.zeros(12)), r"q has shape \(12,\); it must be \(14,\)."),
        (lambda r: r.update(np.full(14, np.nan)), r"q\[0\] is nan; every entry must be finite."),
        (lambda r: r.update(np.zeros(14)), "q holds a zero quaternion"),
        (lambda r: r.integrate(r.neutral, np.zeros(14), 1.0), r"v has shape \(14,\); it must be \(12,\)."),
        (
            lambda r: PinocchioRobot("robot.urdf"),
            "model is a str; give a pinocchio.Model, or use PinocchioRobot.from_file.",
        ),
        (lambda r: PinocchioRobot(pin.Model()), "nothing can move: it has no joint"),
        (lambda r: PinocchioRobot(r.model, velocity_limit=[1.0]), r"velocity_limit has shape \(1,\)"),
    ],
)
def test_misuse_gets_one_clear_error(mixed, call, message):
    with pytest.raises(RobotError, match=message):
        call(mixed)
