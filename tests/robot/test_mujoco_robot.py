"""What is MuJoCo's own: the model of an arm, the simulation state, names, misuse."""

import pickle

import mujoco
import numpy as np
import pytest

from hqp_rp import RobotError
from hqp_rp.robot import MujocoRobot, arm_spec, planar_arm, sawyer
from tests.robot.models import ARMS, MIXED_MJCF


@pytest.fixture
def mixed() -> MujocoRobot:
    return MujocoRobot(mujoco.MjModel.from_xml_string(MIXED_MJCF))


@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: arm.name)
def test_inertias_are_those_mujoco_computes_from_the_capsules(arm):
    spec = arm_spec(arm)
    given = spec.compile()
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    for geom, mass in zip(spec.geoms, arm.mass, strict=True):
        geom.mass = mass
    computed = spec.compile()
    np.testing.assert_allclose(given.body_mass, computed.body_mass, rtol=1e-12)
    np.testing.assert_allclose(given.body_ipos, computed.body_ipos, atol=1e-12)
    np.testing.assert_allclose(np.sort(given.body_inertia), np.sort(computed.body_inertia), rtol=1e-10)
    assert given.body_subtreemass[0] == pytest.approx(arm.total_mass)


def test_the_model_of_an_arm_is_in_radians_and_has_a_tool_and_a_neutral_key():
    model = MujocoRobot.from_arm(sawyer(), timestep=0.002).model
    np.testing.assert_allclose(model.jnt_range, np.tile([-np.pi, np.pi], (7, 1)))
    assert model.opt.timestep == 0.002
    np.testing.assert_array_equal(model.key("neutral").qpos, sawyer().neutral)
    assert model.site("tool").bodyid == model.body("link7").id


def test_a_link_without_length_is_a_sphere():
    arm = planar_arm(2)
    arm = type(arm)(**{**arm.__dict__, "a": (0.0, 0.4)})
    model = arm_spec(arm).compile()
    assert model.geom("link1").type == mujoco.mjtGeom.mjGEOM_SPHERE
    assert model.geom("link2").type == mujoco.mjtGeom.mjGEOM_CAPSULE


def test_velocity_servos_reach_their_command_and_are_clipped_to_the_velocity_limits():
    robot = MujocoRobot.from_arm(sawyer())
    command = 0.1 * robot.velocity_limit * [1, -1, 1, 1, -1, 1, -1]
    robot.data.ctrl[:] = command
    for _ in range(500):
        mujoco.mj_step(robot.model, robot.data)
    np.testing.assert_allclose(robot.data.qvel, command, rtol=0.02)
    robot.data.ctrl[:] = 100.0
    mujoco.mj_step(robot.model, robot.data)
    limited = robot.model.actuator_gainprm[:, 0] * (robot.velocity_limit - robot.data.actuator_velocity)
    np.testing.assert_allclose(robot.data.actuator_force, limited, rtol=1e-9)


@pytest.mark.parametrize("compensated", [True, False])
def test_gravity_compensation_holds_the_arm_and_leaves_the_gravity_torque_as_it_is(compensated):
    robot = MujocoRobot.from_arm(sawyer(), gravity_compensation=compensated)
    reference = MujocoRobot.from_arm(sawyer())
    for _ in range(200):
        mujoco.mj_step(robot.model, robot.data)
    moved = np.abs(robot.data.qpos - robot.neutral).max()
    assert (moved < 1e-9) if compensated else (moved > 1e-4)
    np.testing.assert_array_equal(robot.gravity(), reference.gravity())


def test_an_arm_meets_the_world_and_never_itself():
    spec = arm_spec(planar_arm(3))
    robot = MujocoRobot.from_spec(spec)
    data = robot.data
    data.qpos[:] = [0.0, 3.0, 3.0]  # folded upon itself
    mujoco.mj_forward(robot.model, data)
    assert data.ncon == 0
    spec.worldbody.add_geom(name="wall", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 1.0, 1.0], pos=[1.2, 0.0, 0.0])
    walled = MujocoRobot.from_spec(spec)
    walled.data.qpos[:] = 0.0
    mujoco.mj_forward(walled.model, walled.data)
    assert walled.data.ncon > 0


def test_the_simulation_state_and_the_kinematics_do_not_touch_each_other():
    robot = MujocoRobot.from_arm(sawyer())
    np.testing.assert_array_equal(robot.data.qpos, robot.neutral)
    before = robot.data.qpos.copy()
    q = np.linspace(-1.0, 1.0, 7)
    robot.update(q)
    tool, gravity = robot.pose("tool"), robot.gravity()
    np.testing.assert_array_equal(robot.data.qpos, before)
    robot.data.qvel[:] = 1.0
    for _ in range(10):
        mujoco.mj_step(robot.model, robot.data)
    np.testing.assert_array_equal(robot.pose("tool")[1], tool[1])
    np.testing.assert_array_equal(robot.gravity(), gravity)
    np.testing.assert_array_equal(robot.q, q)


def test_returned_arrays_are_fresh_and_the_stored_ones_read_only():
    robot = MujocoRobot.from_arm(sawyer())
    q = np.linspace(-1.0, 1.0, 7)
    robot.update(q)
    q[:] = 0.0
    assert robot.q[0] == -1.0
    for value in (robot.pose("tool")[0], robot.pose("tool")[1], robot.jacobian("tool"), robot.center_of_mass()):
        kept = value.copy()
        robot.update(np.zeros(7))
        np.testing.assert_array_equal(value, kept)
        value[:] = 0.0
    for value in (robot.q, robot.lower, robot.upper, robot.velocity_limit, robot.neutral):
        with pytest.raises(ValueError, match="read-only"):
            value[0] = 1.0


@pytest.mark.parametrize(
    "read",
    [
        lambda r: r.jacobian("mark"),
        lambda r: r.center_of_mass(),
        lambda r: r.center_of_mass_jacobian(),
        lambda r: r.mass_matrix(),
        lambda r: r.gravity(),
        lambda r: r.bias(np.linspace(-1.0, 1.0, 12)),
    ],
)
def test_whatever_is_asked_first_after_an_update_is_of_that_configuration(mixed, read):
    rng = np.random.default_rng(0)
    for _ in range(3):
        q = mixed.integrate(mixed.neutral, rng.normal(size=12), 1.0)
        mixed.update(q)
        found = read(mixed)
        data = mujoco.MjData(mixed.model)
        data.qpos[:] = q
        mujoco.mj_forward(mixed.model, data)
        fresh = MujocoRobot(mixed.model)
        fresh.update(q)
        fresh._data, fresh._qvel = data, data.qvel
        fresh._is_complete = True
        np.testing.assert_array_equal(found, read(fresh))


def test_the_configuration_is_kept_as_it_was_given(mixed):
    q = np.arange(1.0, 15.0)  # quaternions that are not normalized, and neither are they afterwards
    mixed.update(q)
    before = mixed.q
    assert mixed.q is before
    mixed.update([*q[:-1], 2.0])
    np.testing.assert_array_equal(before, q)
    np.testing.assert_array_equal(mixed.q, [*q[:-1], 2.0])
    mixed.update(q[::-1])
    np.testing.assert_array_equal(mixed.q, q[::-1])
    kept = mixed.q
    with pytest.raises(RobotError, match=r"q\[4\] is nan"):
        mixed.update(np.where(np.arange(14) == 4, np.nan, q))
    assert mixed.q is kept


def test_a_robot_can_be_sent_to_another_process():
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(np.linspace(-1.0, 1.0, 7))
    other = pickle.loads(pickle.dumps(robot))
    np.testing.assert_array_equal(other.q, robot.q)
    np.testing.assert_array_equal(other.jacobian("tool"), robot.jacobian("tool"))
    np.testing.assert_array_equal(other.velocity_limit, robot.velocity_limit)
    np.testing.assert_array_equal(other.neutral, robot.neutral)


def test_velocity_limits_are_a_number_an_array_or_a_mapping(mixed):
    assert np.isinf(mixed.velocity_limit).all()
    model = mixed.model
    np.testing.assert_array_equal(MujocoRobot(model, velocity_limit=2.0).velocity_limit, np.full(12, 2.0))
    mapped = MujocoRobot(model, velocity_limit={"float": 1.0, "slide": 3.0}).velocity_limit
    np.testing.assert_array_equal(mapped, [*[1.0] * 6, np.inf, 3.0, *[np.inf] * 4])


def test_an_unnormalized_quaternion_is_a_direction(mixed):
    q = np.array(mixed.neutral)
    mixed.update(q)
    expected = mixed.pose("base")
    q[3:7] *= 2.5
    mixed.update(q)
    np.testing.assert_allclose(mixed.pose("base")[0], expected[0], atol=1e-15)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda r: r.pose("both"),
            "'both' of the MuJoCo model 'mixed' is ambiguous: write 'body:both' or 'site:both'.",
        ),
        (
            lambda r: r.jacobian("bse"),
            "no frame of the MuJoCo model 'mixed' named 'bse'. Did you mean 'base'. Valid: arm, base, body:both, fixed,",
        ),
        (lambda r: r.jacobian(["base"]), "There is no frame"),
        (lambda r: r.update(np.zeros(12)), r"q has shape \(12,\); it must be \(14,\)."),
        (lambda r: r.update(np.full(14, np.nan)), r"q\[0\] is nan; every entry must be finite."),
        (lambda r: r.update(np.r_[r.neutral[:-1], np.inf]), r"q\[13\] is inf"),
        (lambda r: r.update(np.zeros(14)), r"q\[3:7\] is a zero quaternion; it must have a direction."),
        (lambda r: r.integrate(r.neutral, np.zeros(14), 1.0), r"v has shape \(14,\); it must be \(12,\)."),
        (lambda r: r.difference(r.neutral, np.zeros(3)), r"q1 has shape \(3,\)"),
        (
            lambda r: MujocoRobot(r.model, velocity_limit=[1.0]),
            r"velocity_limit has shape \(1,\); it must be one number",
        ),
        (lambda r: MujocoRobot(r.model, velocity_limit=-1.0), r"velocity_limit\[0\] is -1.0; it must be >= 0"),
        (lambda r: MujocoRobot(r.model, velocity_limit={"hing": 1.0}), "no joint named 'hing'. Did you mean 'hinge'"),
        (lambda r: MujocoRobot(r.model, neutral=np.zeros(3)), r"neutral has shape \(3,\)"),
        (lambda r: MujocoRobot("robot.xml"), "model is a str; give a mujoco.MjModel, or use MujocoRobot.from_file."),
        (
            lambda r: MujocoRobot.from_arm(sawyer(), timestep=0.0),
            "timestep is 0.0; it must be a finite number of seconds",
        ),
    ],
)
def test_misuse_gets_one_clear_error(mixed, call, message):
    with pytest.raises(RobotError, match=message):
        call(mixed)


def test_a_huge_finite_configuration_is_not_mistaken_for_an_infinite_one():
    robot = MujocoRobot.from_arm(planar_arm(2))
    robot.update(np.array([1e308, 1e308]))
    assert robot.q[0] == 1e308


def test_a_spec_that_does_not_compile_and_a_model_that_cannot_move():
    spec = arm_spec(planar_arm(2))
    spec.worldbody.add_body(name="loose").add_joint(name="loose")
    with pytest.raises(RobotError, match=r"MuJoCo does not compile the model 'planar2': .*loose"):
        MujocoRobot.from_spec(spec)
    with pytest.raises(RobotError, match="nothing can move: it has no joint"):
        MujocoRobot(mujoco.MjModel.from_xml_string("<mujoco/>"))
