"""The axes of a contact, and the forces in them on both robot libraries."""

import numpy as np
import pinocchio as pin
import pytest

import hqp_rp
from hqp_rp.control import Contact, ContactForceTask, JointLimit, PostureTask, TorqueStack
from hqp_rp.core.errors import SettingError
from hqp_rp.robot import PinocchioRobot
from hqp_rp.robot.named import named_robot

SOLE = np.array([[x, y, 0.0] for x in (-0.1, 0.1) for y in (-0.05, 0.05)])


def axes(normal, **settings):
    return Contact("a", normal=normal, **settings).axes(np.eye(3))


def test_on_flat_ground_the_axes_are_the_world_s():
    np.testing.assert_array_equal(axes((0.0, 0.0, 1.0)), np.eye(3))
    np.testing.assert_allclose(axes((1e-12, 0.0, 1.0)), np.eye(3), atol=2e-12)
    np.testing.assert_allclose(axes((-1e-12, 1e-12, 3.0)), np.eye(3), atol=2e-12)


@pytest.mark.parametrize("tangent", [None, (0.3, 1.0, -0.2)])
def test_axes_are_a_rotation_with_the_normal_as_z(tangent):
    rng = np.random.default_rng(0)
    for n in (
        *rng.normal(size=(200, 3)),
        [1, 0, 0],
        [-1, 0, 0],
        [0, 1, 0],
        [0, 0, -1],
        [1e-5, 0, -1],
        [1e-8, 1e-8, -1],
    ):
        R = axes(n, tangent=tangent)
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-9)
        assert np.linalg.det(R) > 0.0
        np.testing.assert_allclose(R[:, 2], np.array(n) / np.linalg.norm(n), atol=1e-9)


def test_axes_are_the_shortest_rotation_from_z_to_the_normal():
    for n in np.random.default_rng(1).normal(size=(50, 3)):
        z = np.array([0.0, 0.0, 1.0])
        n = n / np.linalg.norm(n)
        k = np.cross(z, n)
        expected = pin.exp3(np.arccos(n[2]) * k / np.linalg.norm(k))
        np.testing.assert_allclose(axes(n), expected, atol=1e-12)


@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (1, -2, 0.5), (1, 1, -1)])
def test_noise_of_a_normal_turns_the_axes_no_more_than_itself(normal):
    """Walls in each direction included; near -z alone the axes turn by more."""
    n = np.array(normal, dtype=np.float64) / np.linalg.norm(normal)
    R = axes(n)
    for noise in 1e-6 * np.random.default_rng(2).normal(size=(20, 3)):
        turned = np.linalg.norm(axes(n + noise) - R)
        assert turned <= 6.0 * np.linalg.norm(noise), turned


def test_a_tangent_is_what_x_points_along():
    normal = np.array([0.2, -0.1, 1.0]) / np.linalg.norm([0.2, -0.1, 1.0])
    R = axes(normal, tangent=(0.0, 2.0, 0.0))
    np.testing.assert_allclose(R[:, 1], np.cross(normal, R[:, 0]), atol=1e-15)
    shadow = np.array([0.0, 1.0, 0.0]) - normal * normal[1]
    np.testing.assert_allclose(R[:, 0], shadow / np.linalg.norm(shadow), atol=1e-15)
    # Under a ceiling, where the axes without a tangent jump.
    near, other = (axes((d, 0.0, -1.0), tangent=(1.0, 0.0, 0.0)) for d in (1e-6, -1e-6))
    np.testing.assert_allclose(near, other, atol=5e-6)


def test_a_tangent_along_the_normal_is_refused():
    with pytest.raises(SettingError, match="along its tangent"):
        Contact("a", tangent=(0.0, 0.0, -3.0))
    contact = Contact("a", tangent=(1.0, 0.0, 0.0))
    with pytest.raises(SettingError, match="give a tangent that lies nearer"):
        contact.normal = (-1.0, 0.0, 0.0)
    np.testing.assert_array_equal(contact.normal, (0.0, 0.0, 1.0))
    with pytest.raises(SettingError, match="the tangent of 'a contact'"):
        Contact("a", tangent=(0.0, 0.0, 0.0))


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (1e-12, 0.0, 1.0), (0.0, 1e-12, 1.0)])
def test_a_force_along_x_pushes_along_the_world_s_x_by_pinocchio_s_rnea(normal):
    """60 N asked along x of the left sole: rnea with that answer's forces, as pin.Force at the ankles, closes."""
    robot = PinocchioRobot.from_mujoco(named_robot("humanoid").model, neutral="neutral")
    robot.update(robot.neutral)
    soles = [Contact(f"{side}_sole", points=SOLE, friction=0.9, normal=normal) for side in ("left", "right")]
    push = ContactForceTask(soles[0], [60.0, 0.0, 0.0], axes="x")
    posture = PostureTask(robot.neutral, joints=["*"], gain=4.0)
    even = ContactForceTask(soles, each=True, weight=0.1)
    stack = TorqueStack([push, [posture, even]], [JointLimit(acceleration={"*": 100.0})], contacts=soles, torque=300.0)
    v = np.zeros(robot.nv)
    problem = stack.problem(robot, 0.002, v)
    dynamics, x = stack.dynamics(problem), hqp_rp.solve(problem, "hierarchical_active_set").require()
    forces = dynamics.forces(x).reshape(2, 4, 3)
    on_sole = soles[0].axes(np.eye(3)) @ forces[0].sum(axis=0)
    assert on_sole[0] == pytest.approx(60.0, abs=1e-6)

    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, robot.q)
    external = [pin.Force.Zero() for _ in range(model.njoints)]
    for contact, own in zip(soles, forces, strict=True):
        frame = model.frames[model.getFrameId(contact.frame)]
        for point, force in zip(contact.points, own, strict=True):
            world = contact.axes(np.eye(3)) @ force
            arm = data.oMf[model.getFrameId(contact.frame)].act(point)
            wrench = pin.Force(world, np.cross(arm, world))  # about the world's origin
            external[frame.parentJoint] += data.oMi[frame.parentJoint].actInv(wrench)
    tau = pin.rnea(model, data, robot.q, v, dynamics.acceleration(x), pin.StdVec_Force(external))
    np.testing.assert_allclose(tau[:6], 0.0, atol=1e-6)
    np.testing.assert_allclose(tau[dynamics.driven], dynamics.torque(x), atol=1e-6)
