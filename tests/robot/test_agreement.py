"""MuJoCo, Pinocchio and the closed form agree on the same robot; every Jacobian is the derivative of what it claims."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp.control import CenterOfMassTask, PositionTask, Stack
from hqp_rp.core.errors import RobotError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot import DHArm, MujocoRobot, PinocchioRobot, Robot, load_robot
from tests.control.chain import random_chain
from tests.robot.models import ARMS, MIXED_MJCF, URDF, free_base_change, mixed_configurations

TOLERANCE = 1e-10
by_name = pytest.mark.parametrize("arm", ARMS, ids=lambda arm: arm.name)
seeds = st.integers(0, 2**32 - 1)


def assert_same_dynamics(first: Robot, second: Robot, change: FloatArray) -> None:
    """`change` is T of v_first = T v_second."""
    T = change
    np.testing.assert_allclose(T.T @ first.mass_matrix() @ T, second.mass_matrix(), atol=TOLERANCE, rtol=0)
    np.testing.assert_allclose(T.T @ first.gravity(), second.gravity(), atol=TOLERANCE, rtol=0)
    np.testing.assert_allclose(first.center_of_mass(), second.center_of_mass(), atol=TOLERANCE, rtol=0)
    jacobians = first.center_of_mass_jacobian() @ T, second.center_of_mass_jacobian()
    np.testing.assert_allclose(*jacobians, atol=TOLERANCE, rtol=0)


def assert_same_frames(first: Robot, second: Robot, change: FloatArray, frames: tuple[str, ...]) -> None:
    for frame in frames:
        (r1, p1), (r2, p2) = first.pose(frame), second.pose(frame)
        np.testing.assert_allclose(r1, r2, atol=TOLERANCE, rtol=0)
        np.testing.assert_allclose(p1, p2, atol=TOLERANCE, rtol=0)
        np.testing.assert_allclose(
            first.jacobian(frame) @ change, second.jacobian(frame), atol=TOLERANCE, rtol=0, err_msg=frame
        )


def closed_form_dynamics(arm: DHArm, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Mass matrix, gravity torque, centre of mass and its Jacobian, summed link by link from the DH kinematics."""
    mass, torque = np.diag(np.array(arm.armature)), np.zeros(arm.n)
    center, center_jacobian = np.zeros(3), np.zeros((3, arm.n))
    for link in arm.links:
        (rotation, origin), jacobian = arm.pose(q, link.name), arm.jacobian(q, link.name)
        arm_of = rotation @ link.center
        linear = jacobian[:3] + np.cross(jacobian[3:], arm_of, axis=0)
        inertia = rotation @ link.inertia @ rotation.T
        mass = mass + link.mass * linear.T @ linear + jacobian[3:].T @ inertia @ jacobian[3:]
        torque = torque - link.mass * linear.T @ np.array(arm.gravity)
        center = center + link.mass / arm.total_mass * (origin + arm_of)
        center_jacobian = center_jacobian + link.mass / arm.total_mass * linear
    return mass, torque, center, center_jacobian


@by_name
def test_both_adapters_agree_with_the_closed_form(arm):
    rng = np.random.default_rng(1)
    robots: tuple[Robot, ...] = (MujocoRobot.from_arm(arm), PinocchioRobot.from_arm(arm))
    for robot in robots:
        assert isinstance(robot, Robot)
        assert robot.joint_names == arm.joint_names
        assert robot.frame_names == ("world", *arm.frame_names)
        np.testing.assert_array_equal(robot.lower, arm.lower)
        np.testing.assert_array_equal(robot.upper, arm.upper)
        np.testing.assert_array_equal(robot.velocity_limit, arm.velocity_limit)
        np.testing.assert_array_equal(robot.neutral, arm.neutral)
        np.testing.assert_array_equal(robot.q, arm.neutral)
    for _ in range(10):
        q = rng.uniform(arm.lower, arm.upper)
        mass, torque, center, center_jacobian = closed_form_dynamics(arm, q)
        for robot in robots:
            robot.update(q)
            for frame in arm.frame_names:
                rotation, origin = arm.pose(q, frame)
                np.testing.assert_allclose(robot.pose(frame)[0], rotation, atol=TOLERANCE, rtol=0)
                np.testing.assert_allclose(robot.pose(frame)[1], origin, atol=TOLERANCE, rtol=0)
                jacobian = robot.jacobian(frame)
                assert jacobian.shape == (6, arm.n)
                np.testing.assert_allclose(jacobian, arm.jacobian(q, frame), atol=TOLERANCE, rtol=0)
            np.testing.assert_allclose(robot.mass_matrix(), mass, atol=TOLERANCE, rtol=0)
            np.testing.assert_allclose(robot.gravity(), torque, atol=TOLERANCE, rtol=0)
            np.testing.assert_allclose(robot.center_of_mass(), center, atol=TOLERANCE, rtol=0)
            np.testing.assert_allclose(robot.center_of_mass_jacobian(), center_jacobian, atol=TOLERANCE, rtol=0)
        assert_same_frames(*robots, np.eye(arm.n), arm.frame_names)
        assert_same_dynamics(*robots, np.eye(arm.n))


def test_both_adapters_agree_on_a_floating_base_and_every_kind_of_joint(tmp_path):
    path = tmp_path / "mixed.xml"
    path.write_text(MIXED_MJCF)
    first, second = MujocoRobot.from_file(path), PinocchioRobot.from_file(path)
    assert first.joint_names == second.joint_names == ("float", "hinge", "slide", "unnamed_joint_3", "last")
    frames = ("world", "fixed", "base", "arm", "body:both", "site:both", "mark")
    assert set(first.frame_names) == set(second.frame_names) == set(frames)
    np.testing.assert_array_equal(first.lower, second.lower)
    np.testing.assert_array_equal(first.upper, second.upper)
    np.testing.assert_allclose(first.lower[6:8], [np.radians(-20.0), -1.0], atol=1e-15)
    assert_same_frames(first, second, free_base_change(first, "base"), frames)  # at neutral, references included
    rng = np.random.default_rng(2)
    for _ in range(10):
        q, other = mixed_configurations(rng)
        first.update(q)
        second.update(other)
        change = free_base_change(first, "base")
        assert_same_frames(first, second, change, frames)
        assert_same_dynamics(first, second, change)


@pytest.mark.parametrize("floating", [False, True])
def test_both_adapters_agree_on_a_urdf(tmp_path, floating):
    path = tmp_path / "two.urdf"
    path.write_text(URDF)
    first = MujocoRobot.from_file(path, floating_base=floating)
    second = PinocchioRobot.from_file(path, floating_base=floating)
    assert first.joint_names == second.joint_names == (*(("root_joint",) if floating else ()), "shoulder", "elbow")
    frames = ("world", "base", "upper", "fore", "tool")
    assert set(frames) == set(first.frame_names) <= set(second.frame_names)
    for name in ("lower", "upper", "velocity_limit"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    np.testing.assert_array_equal(first.velocity_limit[-2:], [3.0, np.inf])
    rng = np.random.default_rng(3)
    for _ in range(5):
        q = rng.normal(size=first.nq)
        other = np.concatenate([q[:-1], [np.cos(q[-1]), np.sin(q[-1])]])
        if floating:
            q[3:7] /= np.linalg.norm(q[3:7])
            other[3:7] = np.roll(q[3:7], -1)
        first.update(q)
        second.update(other)
        change = free_base_change(first, "base") if floating else np.eye(2)
        assert_same_frames(first, second, change, frames)
        assert_same_dynamics(first, second, change)


def assert_derivatives(robot: Robot, q: FloatArray, frames: tuple[str, ...]) -> None:
    step = 1e-5
    robot.update(q)
    jacobians = {frame: robot.jacobian(frame) for frame in frames}
    poses = {frame: robot.pose(frame) for frame in frames}
    center_jacobian = robot.center_of_mass_jacobian()
    for k in range(robot.nv):
        sides = []
        for sign in (1.0, -1.0):
            robot.update(robot.integrate(q, np.eye(robot.nv)[k], sign * step))
            sides.append(({frame: robot.pose(frame) for frame in frames}, robot.center_of_mass()))
        (ahead, center_ahead), (behind, center_behind) = sides
        for frame in frames:
            spin = (ahead[frame][0] - behind[frame][0]) @ poses[frame][0].T / (2.0 * step)
            linear = (ahead[frame][1] - behind[frame][1]) / (2.0 * step)
            expected = [*linear, spin[2, 1], spin[0, 2], spin[1, 0]]
            np.testing.assert_allclose(jacobians[frame][:, k], expected, atol=1e-7, err_msg=frame)
        np.testing.assert_allclose(center_jacobian[:, k], (center_ahead - center_behind) / (2.0 * step), atol=1e-7)


@given(seed=seeds, arm=st.sampled_from(ARMS), library=st.sampled_from([MujocoRobot, PinocchioRobot]))
@settings(max_examples=30, deadline=None)
def test_jacobians_are_derivatives(seed, arm, library):
    rng = np.random.default_rng(seed)
    assert_derivatives(library.from_arm(arm), rng.uniform(arm.lower, arm.upper), arm.frame_names)


@given(seed=seeds)
@settings(max_examples=15, deadline=None)
def test_jacobians_of_a_floating_base_are_derivatives_in_either_convention(seed):
    first = MujocoRobot(mujoco.MjModel.from_xml_string(MIXED_MJCF))
    second = PinocchioRobot.from_mujoco(first.model)
    q, other = mixed_configurations(np.random.default_rng(seed))
    assert_derivatives(first, q, first.frame_names)
    assert_derivatives(second, other, second.frame_names)


@given(seed=seeds)
@settings(max_examples=30, deadline=None)
def test_integrate_and_difference_undo_each_other(seed):
    rng = np.random.default_rng(seed)
    first = MujocoRobot(mujoco.MjModel.from_xml_string(MIXED_MJCF))
    second = PinocchioRobot.from_mujoco(first.model)
    for robot, q in zip((first, second), mixed_configurations(rng), strict=True):
        v = rng.uniform(-1.0, 1.0, robot.nv)
        reached = robot.integrate(q, v, 0.5)
        np.testing.assert_allclose(robot.difference(q, reached), 0.5 * v, atol=1e-12)
        np.testing.assert_allclose(robot.integrate(q, np.zeros(robot.nv), 1.0), q, atol=1e-15)


@by_name
@pytest.mark.parametrize("library", [MujocoRobot, PinocchioRobot])
def test_gravity_is_the_gradient_of_the_potential(arm, library):
    robot = library.from_arm(arm)
    q, step = np.full(arm.n, 0.4), 1e-5
    robot.update(q)
    gravity = robot.gravity()
    for k in range(arm.n):
        energy = []
        for sign in (1.0, -1.0):
            robot.update(q + sign * step * np.eye(arm.n)[k])
            energy.append(-arm.total_mass * robot.center_of_mass() @ np.array(arm.gravity))
        assert gravity[k] == pytest.approx((energy[0] - energy[1]) / (2.0 * step), abs=1e-6)


@pytest.mark.parametrize("library", ["mujoco", "pinocchio"])
def test_what_is_fixed_to_the_world_has_no_part_in_the_centre_of_mass(tmp_path, library):
    path = tmp_path / "mixed.xml"
    path.write_text(MIXED_MJCF)
    whole = load_robot(path, library)
    path.write_text(MIXED_MJCF.replace('mass="3"', 'mass="300"'))
    heavier = load_robot(path, library)
    np.testing.assert_allclose(whole.center_of_mass(), heavier.center_of_mass(), atol=1e-12)
    np.testing.assert_allclose(whole.center_of_mass_jacobian(), heavier.center_of_mass_jacobian(), atol=1e-12)


def test_parts_have_the_same_centre_of_mass_in_both_libraries_and_its_velocity():
    source = mujoco.MjModel.from_xml_string(MIXED_MJCF)
    first, second = MujocoRobot(source), PinocchioRobot.from_mujoco(source)
    rng = np.random.default_rng(3)
    for _ in range(5):
        q, other = mixed_configurations(rng)
        first.update(q)
        second.update(other)
        T = free_base_change(first, "base")
        for bodies in (["arm"], ["base"], ["body:both", "arm"], ["mark"]):
            (c1, J1), (c2, J2) = first.part_center_of_mass(bodies), second.part_center_of_mass(bodies)
            np.testing.assert_allclose(c1, c2, atol=TOLERANCE, rtol=0)
            np.testing.assert_allclose(J1 @ T, J2, atol=TOLERANCE, rtol=0)
            v, ends = rng.normal(size=first.nv), []
            for sign in (1e-6, -1e-6):
                first.update(first.integrate(q, v, sign))
                ends.append(first.part_center_of_mass(bodies)[0])
            first.update(q)
            np.testing.assert_allclose((ends[0] - ends[1]) / 2e-6, J1 @ v, atol=1e-7)
        np.testing.assert_allclose(first.part_center_of_mass(["base"])[0], first.center_of_mass(), atol=TOLERANCE)
        np.testing.assert_array_equal(first.part_center_of_mass(["mark"])[0], first.part_center_of_mass(["arm"])[0])
    for robot in (first, second):
        with pytest.raises(RobotError, match=r"The frame 'fixed' of .* is fixed to the world; name one that moves"):
            robot.part_center_of_mass(["fixed"])
        with pytest.raises(RobotError, match="nowhere"):
            robot.part_center_of_mass(["nowhere"])
        with pytest.raises(RobotError, match="have no mass"):
            robot.part_center_of_mass([])


def test_a_task_moves_the_centre_of_mass_of_a_part():
    robot = MujocoRobot(mujoco.MjModel.from_xml_string(MIXED_MJCF))
    robot.update(mixed_configurations(np.random.default_rng(1))[0])
    center, jacobian = robot.part_center_of_mass(["arm"])
    task = CenterOfMassTask(
        center + np.array([0.1, 0.2, 0.3]), axes="zx", bodies="arm", gain=2.0, weight=[1.0, 3.0], feedforward=[1, 0, 0]
    )
    assert task.name == "centre of mass of arm"
    np.testing.assert_allclose(task.error(robot), [0.3, 0.1])
    np.testing.assert_allclose(task.jacobian(robot), jacobian[[2, 0]])
    J, rate = task.evaluate(robot)
    np.testing.assert_allclose(J, [[1.0], [3.0]] * jacobian[[2, 0]])
    np.testing.assert_allclose(rate, [0.6, 3.6])
    problem = Stack([task, PositionTask("mark", [0, 0, 0])]).problem(robot)
    np.testing.assert_array_equal(problem.levels[0].A, J)
    chain = random_chain(np.random.default_rng(0))
    with pytest.raises(RobotError, match="a Chain does not tell the centre of mass of a part"):
        CenterOfMassTask([0, 0, 0], bodies="tool").evaluate(chain)
