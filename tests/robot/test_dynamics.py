"""Accelerations and torques of both robot libraries: against finite differences, and against each other."""

import pickle

import mujoco
import numpy as np
import pytest

from hqp_rp import PostureTask, TorqueStack
from hqp_rp.core.errors import RobotError
from hqp_rp.robot import DynamicRobot, MujocoRobot, PinocchioRobot, Robot, planar_arm, sawyer
from hqp_rp.robot.dual_arm import dual_arm
from hqp_rp.robot.dynamics import dynamics_reader
from hqp_rp.robot.pinocchio_model import configuration_from_mujoco
from hqp_rp.scenarios.humanoid_reach import HumanoidReach
from tests.control.chain import random_chain

EVERY_JOINT = """
<mujoco><compiler angle="radian"/><worldbody>
  <body name="base" pos="0.1 0.2 0.9" euler="0.3 -0.2 0.5"><freejoint/><geom type="box" size="0.2 0.1 0.1" mass="3"/>
    <body name="arm" pos="0.2 0.1 0" euler="0.1 0.4 0"><joint name="h1" axis="1 2 0.5" pos="0.05 0.02 0.01" armature="0.1"/>
      <joint name="s1" type="slide" axis="0 1 1"/><geom type="capsule" fromto="0 0 0 0.3 0.1 0" size="0.03" mass="1"/>
      <body name="wrist" pos="0.3 0.1 0"><joint name="b1" type="ball" pos="0.02 0 0.01"/>
        <geom type="box" size="0.05 0.08 0.02" mass="0.7"/>
        <body name="tip" pos="0.1 0 0.05" euler="0 0.3 0"><joint name="h2" axis="0 1 0"/>
          <geom type="sphere" size="0.04" mass="0.2"/>
          <site name="tool" pos="0.05 0.02 0.1" euler="0.2 0 0"/></body></body></body></body>
</worldbody></mujoco>
"""


def every_joint():
    return MujocoRobot(mujoco.MjModel.from_xml_string(EVERY_JOINT))


MUJOCO = {
    "sawyer": lambda: MujocoRobot.from_arm(sawyer()),
    "planar": lambda: MujocoRobot.from_arm(planar_arm(4)),
    "every kind of joint": every_joint,
}
ROBOTS = {
    **MUJOCO,
    "sawyer, Pinocchio": lambda: PinocchioRobot.from_arm(sawyer()),
    "every kind of joint, Pinocchio": lambda: PinocchioRobot.from_mujoco(every_joint().model),
}


def moving(robot, seed):
    rng = np.random.default_rng(seed)
    q = robot.integrate(robot.neutral, 0.4 * rng.normal(size=robot.nv), 1.0)
    robot.update(q)
    return q, rng.normal(size=robot.nv)


def rate(robot, q, v, function, h=1e-4):
    """d(function)/dt along the motion with constant v, by a four-point central difference."""

    def at(s):
        robot.update(robot.integrate(q, v, s))
        return np.asarray(function())

    value = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
    robot.update(q)
    return value


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("seed", range(3))
def test_bias_accelerations_are_the_rate_of_the_jacobian(name, seed):
    robot = ROBOTS[name]()
    q, v = moving(robot, seed)
    for frame in (robot.frame_names[-1], robot.frame_names[len(robot.frame_names) // 2]):
        expected = rate(robot, q, v, lambda frame=frame: robot.jacobian(frame) @ v)
        np.testing.assert_allclose(robot.bias_acceleration(frame, v), expected, atol=1e-8)
    expected = rate(robot, q, v, lambda: robot.center_of_mass_jacobian() @ v)
    np.testing.assert_allclose(robot.center_of_mass_bias_acceleration(v), expected, atol=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_both_libraries_agree_on_an_arm_to_1e_9(seed):
    one, other = MujocoRobot.from_arm(sawyer()), PinocchioRobot.from_arm(sawyer())
    q, v = moving(one, seed)
    other.update(q)
    a = np.random.default_rng(seed).normal(size=7)
    for frame in ("tool", "link4"):
        np.testing.assert_allclose(one.bias_acceleration(frame, v), other.bias_acceleration(frame, v), atol=1e-9)
    bias = one.center_of_mass_bias_acceleration(v)
    np.testing.assert_allclose(bias, other.center_of_mass_bias_acceleration(v), atol=1e-9)
    np.testing.assert_allclose(one.inverse_dynamics(v, a), other.inverse_dynamics(v, a), atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_both_libraries_agree_on_every_kind_of_joint(seed):
    """Free joint: MuJoCo's linear velocity is in world axes and is not turned with the body, Pinocchio's is in body axes."""
    one = every_joint()
    other = PinocchioRobot.from_mujoco(one.model)
    q, v = moving(one, seed)
    other.update(configuration_from_mujoco(one.model, q))
    R = one.pose("base")[0]
    body, a = v.copy(), np.random.default_rng(seed).normal(size=one.nv)
    body[:3] = R.T @ v[:3]
    for frame in ("tool", "wrist"):
        np.testing.assert_allclose(one.jacobian(frame) @ v, other.jacobian(frame) @ body, atol=1e-9)
        # v-dot = 0 means another motion of the base in each: MuJoCo's frame goes straight, Pinocchio's turns with the body.
        turned = np.zeros(one.nv)
        turned[:3] = R.T @ np.cross(R @ v[3:6], v[:3])
        expected = other.bias_acceleration(frame, body) - other.jacobian(frame) @ turned
        np.testing.assert_allclose(one.bias_acceleration(frame, v), expected, atol=1e-9)
    body_a = a.copy()
    body_a[:3] = R.T @ (a[:3] - np.cross(R @ v[3:6], v[:3]))
    torque = other.inverse_dynamics(body, body_a)
    torque[:3] = R @ torque[:3]
    np.testing.assert_allclose(one.inverse_dynamics(v, a), torque, atol=1e-9)


@pytest.mark.parametrize("name", MUJOCO)
def test_inverse_dynamics_is_mj_inverse(name):
    robot = MUJOCO[name]()
    q, v = moving(robot, 0)
    a = np.random.default_rng(1).normal(size=robot.nv)
    model = robot.model
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    model.body_gravcomp[:] = 0.0
    model.dof_damping[:] = model.dof_frictionloss[:] = 0.0
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
    mujoco.mj_inverse(model, data)
    np.testing.assert_allclose(robot.inverse_dynamics(v, a), data.qfrc_inverse, atol=1e-9)


@pytest.mark.parametrize("name", ["every kind of joint", "every kind of joint, Pinocchio"])
@pytest.mark.parametrize("seed", range(3))
def test_angular_momentum_and_its_rate(name, seed):
    robot = ROBOTS[name]()
    q, v = moving(robot, seed)
    expected = rate(robot, q, v, lambda: robot.angular_momentum_jacobian() @ v)
    np.testing.assert_allclose(robot.angular_momentum_bias(v), expected, atol=1e-7)


def test_angular_momentum_agrees_between_the_libraries_and_with_its_sum():
    one = every_joint()
    other = PinocchioRobot.from_mujoco(one.model)
    q, v = moving(one, 0)
    other.update(configuration_from_mujoco(one.model, q))
    body = v.copy()
    body[:3] = one.pose("base")[0].T @ v[:3]
    momentum = one.angular_momentum_jacobian() @ v
    np.testing.assert_allclose(momentum, other.angular_momentum_jacobian() @ body, atol=1e-9)
    data = mujoco.MjData(one.model)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(one.model, data)
    mujoco.mj_subtreeVel(one.model, data)
    np.testing.assert_allclose(momentum, data.subtree_angmom[1], atol=1e-9)
    with pytest.raises(RobotError, match="one tree on a free joint"):
        MujocoRobot.from_arm(sawyer()).angular_momentum_jacobian()


def test_a_velocity_that_does_not_fit_is_refused():
    for robot in (MujocoRobot.from_arm(sawyer()), PinocchioRobot.from_arm(sawyer())):
        for bad in (np.zeros(6), np.full(7, np.nan)):
            with pytest.raises(RobotError):
                robot.bias_acceleration("tool", bad)
            with pytest.raises(RobotError):
                robot.inverse_dynamics(np.zeros(7), bad)
        with pytest.raises(RobotError, match="tol"):
            robot.bias_acceleration("tol", np.zeros(7))


MOTORS = """
<mujoco><worldbody><body><joint name="a" axis="0 0 1" actuatorfrcrange="-40 50"/><geom size="0.1" mass="1"/>
  <body pos="0.2 0 0"><joint name="b" axis="0 1 0"/><geom size="0.1" mass="1"/>
    <body pos="0.2 0 0"><joint name="c" axis="1 0 0"/><geom size="0.1" mass="1"/></body></body></body></worldbody>
  <actuator><motor joint="a" gear="30" ctrlrange="-1 1"/><motor joint="b" gear="2" forcerange="-7 7"/></actuator></mujoco>
"""
URDF = """
<robot name="two"><link name="base"/><link name="one"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"
 ixy="0" ixz="0" iyz="0"/></inertial></link><link name="two"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"
 ixy="0" ixz="0" iyz="0"/></inertial></link>
 <joint name="a" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" velocity="2" effort="12.5"/></joint>
 <joint name="b" type="revolute"><parent link="one"/><child link="two"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" velocity="2" effort="0"/></joint></robot>
"""


def test_effort_limits_are_what_the_model_states(tmp_path):
    robot = MujocoRobot(mujoco.MjModel.from_xml_string(MOTORS))
    np.testing.assert_array_equal(robot.effort_limit, [30.0, 14.0, np.inf])
    path = tmp_path / "two.urdf"
    path.write_text(URDF)
    for adapter in (MujocoRobot, PinocchioRobot):
        found = adapter.from_file(path)
        np.testing.assert_array_equal(found.effort_limit, [12.5, np.inf])
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(found)).effort_limit, found.effort_limit)


def humanoid():
    return HumanoidReach().robot()


@pytest.mark.parametrize("make", [lambda: dual_arm(sawyer()), humanoid], ids=["dual arm", "humanoid"])
def test_both_libraries_agree_on_large_robots_to_1e_9(make):
    one = make()
    other = PinocchioRobot.from_mujoco(one.model)
    q, v = moving(one, 0)
    a = np.random.default_rng(0).normal(size=one.nv)
    other.update(configuration_from_mujoco(one.model, q))
    their_v, their_a = v.copy(), a.copy()
    free = one.model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    assert free == (one.nv > 30)
    if free:
        R = one.pose(one.model.body(int(one.model.jnt_bodyid[0])).name)[0]
        their_v[:3], their_a[:3] = R.T @ v[:3], R.T @ (a[:3] - np.cross(R @ v[3:6], v[:3]))
    for frame in sorted(set(one.frame_names) & set(other.frame_names))[::7]:
        # Their v-dot has the part of the turning base in it: accelerations, not biases alone, are the same.
        accelerations = [
            robot.jacobian(frame) @ rate + robot.bias_acceleration(frame, velocity)
            for robot, velocity, rate in ((one, v, a), (other, their_v, their_a))
        ]
        np.testing.assert_allclose(*accelerations, atol=1e-9, err_msg=frame)
    centers = [
        robot.center_of_mass_jacobian() @ rate + robot.center_of_mass_bias_acceleration(velocity)
        for robot, velocity, rate in ((one, v, a), (other, their_v, their_a))
    ]
    np.testing.assert_allclose(*centers, atol=1e-9)
    torque = other.inverse_dynamics(their_v, their_a)
    if free:
        torque[:3] = R @ torque[:3]
    np.testing.assert_allclose(one.inverse_dynamics(v, a), torque, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["every kind of joint", "every kind of joint, Pinocchio"])
@pytest.mark.parametrize("bodies", [["wrist"], ["tool", "arm"], ["base"]])
def test_the_bias_acceleration_of_parts_is_the_rate_of_their_jacobian(name, bodies):
    robot = ROBOTS[name]()
    q, v = moving(robot, 1)
    expected = rate(robot, q, v, lambda: robot.part_center_of_mass(bodies)[1] @ v)
    for _ in range(2):  # what is kept from the first time follows the robot
        np.testing.assert_allclose(robot.part_center_of_mass_bias_acceleration(bodies, v), expected, atol=1e-8)
        q, v = moving(robot, 2)
        expected = rate(robot, q, v, lambda v=v: robot.part_center_of_mass(bodies)[1] @ v)
    if bodies == ["base"]:
        whole = robot.center_of_mass_bias_acceleration(v)
        np.testing.assert_allclose(robot.part_center_of_mass_bias_acceleration(bodies, v), whole, atol=1e-12)
    with pytest.raises(RobotError, match="world"):
        robot.part_center_of_mass_bias_acceleration(["world"], v)


def test_what_accelerations_need_is_a_protocol_of_its_own():
    for robot in (MujocoRobot.from_arm(sawyer()), PinocchioRobot.from_arm(sawyer())):
        assert isinstance(robot, DynamicRobot)
    chain = random_chain(np.random.default_rng(0))
    assert isinstance(chain, Robot)
    assert not isinstance(chain, DynamicRobot)


def read(robot, v):
    M, h = np.full((robot.nv, robot.nv), np.nan), np.full(robot.nv, np.nan)
    dynamics_reader(robot)(v, M, h)
    return M, h


@pytest.mark.parametrize("name", ROBOTS)
def test_what_is_read_is_what_the_robot_states(name):
    robot = ROBOTS[name]()
    rng = np.random.default_rng(3)
    for _ in range(3):
        robot.update(robot.integrate(robot.neutral, rng.normal(size=robot.nv), 0.3))
        v = rng.normal(size=robot.nv)
        M, h = read(robot, v)  # first, so that nothing of the configuration is computed yet
        np.testing.assert_array_equal(M, robot.mass_matrix())
        np.testing.assert_array_equal(h, robot.bias(v))


def test_what_a_subclass_states_itself_counts():
    class Loaded(MujocoRobot):
        def mass_matrix(self):
            return 2.0 * super().mass_matrix()

    class Further(Loaded):
        pass

    class Both(Loaded):
        def _read_dynamics(self, v, mass_matrix, bias):
            mass_matrix[...], bias[...] = 3.0, 4.0

    model, v = MujocoRobot.from_arm(sawyer()).model, np.full(7, 0.2)
    for kind in (Loaded, Further):
        robot = kind(model)
        M, h = read(robot, v)
        np.testing.assert_array_equal(M, robot.mass_matrix())
        np.testing.assert_array_equal(h, robot.bias(v))
    assert read(Both(model), v)[0][0, 0] == 3.0


def test_what_is_stated_later_counts_from_then_on(monkeypatch):
    robot, v = MujocoRobot.from_arm(sawyer()), np.full(7, 0.2)
    stack = TorqueStack([PostureTask(robot.neutral)])

    def offset():
        return stack.dynamics(stack.problem(robot, 0.01, v)).offset

    own = robot.bias(v)
    np.testing.assert_array_equal(offset(), own)
    robot.bias = lambda v: np.arange(7)
    np.testing.assert_array_equal(offset(), np.arange(7.0))
    del robot.bias
    np.testing.assert_array_equal(offset(), own)
    with monkeypatch.context() as patched:
        patched.setattr(MujocoRobot, "bias", lambda self, v: 2.0 * own)
        np.testing.assert_array_equal(offset(), 2.0 * own)
    np.testing.assert_array_equal(offset(), own)


@pytest.mark.parametrize("wrong", [np.zeros(6), None, "abc", np.zeros(7, dtype=complex), 0.0])
def test_what_is_no_bias_is_refused(wrong):
    robot = MujocoRobot.from_arm(sawyer())
    robot.bias = lambda v: wrong
    with pytest.raises(RobotError, match=r"bias\(v\) of .* is an array .*; it must be \(7,\) of real numbers"):
        read(robot, np.zeros(7))
