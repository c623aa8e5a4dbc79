"""Inverse dynamics with contacts: the physics of every answer, and what is hard stays hard."""

import copy
import pickle
import sys
import threading

import mujoco
import numpy as np
import pytest

import hqp_rp
from hqp_rp.control import (
    AccelerationStack,
    CenterOfMassTask,
    Contact,
    ContactForceTask,
    JointLimit,
    OrientationTask,
    PositionTask,
    PostureTask,
    TorqueController,
    TorqueStack,
    TorqueTask,
)
from hqp_rp.control._rotations import skew
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.row_names import row_names
from hqp_rp.robot import MujocoRobot, PinocchioRobot, sawyer
from hqp_rp.robot.named import named_robot
from hqp_rp.robot.pinocchio_model import configuration_from_mujoco

SOLE = np.array([[x, y, 0.0] for x in (-0.1, 0.1) for y in (-0.05, 0.05)])


def standing(seed=0, **settings):
    """The library's humanoid on both soles, and a stack of five levels with every limit hard."""
    robot = named_robot("humanoid")
    robot.update(robot.neutral)
    rng = np.random.default_rng(seed)
    contacts = [Contact(f"{side}_sole", points=SOLE, friction=0.6, max_force=500.0) for side in ("left", "right")]
    hand = PositionTask("left_hand", robot.pose("left_hand")[1] + 0.1 * rng.normal(size=3), gain=5.0)
    levels = [
        CenterOfMassTask(robot.center_of_mass() - np.array([0.0, 0.0, 0.02]), gain=5.0),
        hand,
        OrientationTask("pelvis", np.eye(3), gain=5.0),
        [
            PostureTask(robot.neutral, joints=range(6, robot.nv), gain=5.0),
            ContactForceTask(contacts, each=True, weight=0.1),
        ],
    ]
    most = np.concatenate([np.full(6, np.inf), np.full(robot.nv - 6, 100.0)])
    given = {"torque": 120.0} | settings
    return robot, contacts, TorqueStack(levels, [JointLimit(acceleration=most)], contacts=contacts, **given)


def at_work(robot, seed):
    rng = np.random.default_rng(seed)
    robot.update(robot.integrate(robot.neutral, 0.02 * rng.normal(size=robot.nv), 1.0))
    return 0.05 * rng.normal(size=robot.nv)


@pytest.mark.parametrize("seed", range(6))
def test_an_answer_is_physical_and_certified(seed):
    robot, _, stack = standing(seed)
    v = at_work(robot, seed)
    problem = stack.problem(robot, 0.002, v)
    found = hqp_rp.solve(problem, "hierarchical_active_set")
    assert found.status is hqp_rp.Status.SOLVED, found.message
    assert hqp_rp.certify(problem, found.x).ok
    dynamics = stack.dynamics(problem)
    a, forces, torque = dynamics.acceleration(found.x), dynamics.forces(found.x), dynamics.torque(found.x)
    applied = np.zeros(robot.nv)
    applied[dynamics.driven] = torque
    # Equation of motion, by the robot's own inverse dynamics.
    np.testing.assert_allclose(robot.inverse_dynamics(v, a), applied + dynamics.contact_jacobian.T @ forces, atol=1e-8)
    assert (np.abs(torque) <= 120.0 + 1e-7).all()
    each = forces.reshape(-1, 3)
    assert (each[:, 2] >= -1e-9 * 500.0).all()
    assert (each[:, 2] <= 500.0 + 1e-6).all()
    assert (np.linalg.norm(each[:, :2], axis=1) <= 0.6 * each[:, 2] + 1e-6).all()
    np.testing.assert_array_less(found.levels[0].residual, 1e-7)  # the contacts


@pytest.mark.parametrize("seed", range(3))
def test_the_torques_put_into_mujoco_give_back_the_acceleration(seed):
    """A solved step into `mj_inverse` with the contact forces as applied ones: the same torques."""
    robot, contacts, stack = standing(seed)
    v = at_work(robot, seed)
    problem = stack.problem(robot, 0.002, v)
    x = hqp_rp.solve(problem, "hierarchical_active_set").require()
    dynamics = stack.dynamics(problem)
    model = copy.deepcopy(robot.model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    model.dof_damping[:] = 0.0
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = robot.q, v, dynamics.acceleration(x)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    applied = np.zeros(robot.nv)
    forces = dynamics.forces(x).reshape(2, 4, 3)
    for contact, own in zip(contacts, forces, strict=True):
        R, p = robot.pose(contact.frame)
        body = int(model.site_bodyid[model.site(contact.frame).id])
        for point, force in zip(contact.points, own, strict=True):
            mujoco.mj_applyFT(model, data, contact.axes(np.eye(3)) @ force, np.zeros(3), p + R @ point, body, applied)
    mujoco.mj_inverse(model, data)
    np.testing.assert_allclose(data.qfrc_inverse[:6], applied[:6], atol=1e-7)
    np.testing.assert_allclose((data.qfrc_inverse - applied)[dynamics.driven], dynamics.torque(x), atol=1e-7)


def rows_in_numpy(robot, contacts, v):
    """The point Jacobian, the motion rows and what they should be, from the robot's public methods alone."""
    jacobians, motions, rates = [], [], []
    for contact in contacts:
        J, (R, p) = robot.jacobian(contact.frame), robot.pose(contact.frame)
        twist, bias, surface = J @ v, robot.bias_acceleration(contact.frame, v), np.eye(3)
        if contact.on != "world":
            S, (surface, origin) = robot.jacobian(contact.on), robot.pose(contact.on)
            arm, V, A = p - origin, S @ v, robot.bias_acceleration(contact.on, v)
            carried = np.vstack((S[:3] - skew(arm) @ S[3:], S[3:]))
            J = J - carried
            bias = bias - A
            bias[:3] += skew(arm) @ A[3:] - np.cross(V[3:], twist[:3] - V[:3])
            omega, twist = twist[3:], J @ v
        else:
            omega = twist[3:]
        axes = contact.axes(surface)
        jacobians += [axes.T @ (J[:3] - skew(R @ point) @ J[3:]) for point in contact.points]
        basis, wanted = contact.motion_basis(), -bias - contact.kd * twist
        if len(basis) < 6:
            wanted[:3] += np.cross(omega, twist[:3])
            turned = np.hstack((basis[:, :3] @ R.T, basis[:, 3:] @ R.T))
        else:
            turned = np.eye(6)
        motions.append(turned @ J)
        rates.append(turned @ wanted)
    return np.vstack(jacobians), np.vstack(motions), np.concatenate(rates)


@pytest.mark.parametrize("adapter", ["mujoco", "pinocchio"])
@pytest.mark.parametrize("seed", range(3))
def test_native_rows_are_those_in_numpy(seed, adapter):
    source = named_robot("humanoid")
    robot = source if adapter == "mujoco" else PinocchioRobot.from_mujoco(source.model)
    rng = np.random.default_rng(seed)
    q = source.integrate(source.neutral, 0.3 * rng.normal(size=source.nv), 1.0)
    robot.update(q if adapter == "mujoco" else configuration_from_mujoco(source.model, q))
    v = rng.normal(size=robot.nv)
    contacts = [
        Contact("left_sole", points=SOLE, normal=[0.1, 0.2, 1.0]),
        Contact("right_sole", points=[0.1, 0.0, 0.02], kd=3.0),
        Contact("left_hand", points=[[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]], on="right_hand", normal=[1.0, 0.0, 0.0]),
    ]
    stack = TorqueStack([PostureTask(robot.neutral)], contacts=contacts, torque=100.0)
    problem = stack.problem(robot, 0.01, v)
    jacobian, motion, rate = rows_in_numpy(robot, contacts, v)
    dynamics = stack.dynamics(problem)
    np.testing.assert_allclose(dynamics.contact_jacobian, jacobian, atol=1e-10)
    np.testing.assert_allclose(problem.levels[0].A[:, : robot.nv], motion, atol=1e-10)
    np.testing.assert_allclose(problem.levels[0].lower, rate, atol=1e-8)
    M, h = robot.mass_matrix(), robot.bias(v)
    whole = np.hstack((M, -100.0 * jacobian.T))
    np.testing.assert_allclose(problem.hard.A[:6], whole[:6], atol=1e-9)
    np.testing.assert_allclose(problem.hard.lower[:6], -h[:6], atol=1e-9)
    np.testing.assert_allclose(dynamics.map, whole[6:], atol=1e-9)
    np.testing.assert_allclose(dynamics.offset, h[6:], atol=1e-9)


def test_motion_rows_bring_a_contact_to_rest():
    """Along the motion that the rows ask for, d/dt of the contact's twist is -kd times it: by finite differences."""
    robot = named_robot("humanoid")
    rng = np.random.default_rng(5)
    q = robot.integrate(robot.neutral, 0.2 * rng.normal(size=robot.nv), 1.0)
    robot.update(q)
    v = rng.normal(size=robot.nv)
    contact = Contact("left_hand", points=[0.05, 0.02, 0.1], kd=4.0)
    problem = TorqueStack([PostureTask(robot.neutral)], contacts=[contact]).problem(robot, 0.01, v)
    a = np.linalg.lstsq(problem.levels[0].A[:, : robot.nv], problem.levels[0].lower, rcond=None)[0]

    def slip(s):
        robot.update(robot.integrate(q, v + 0.5 * s * a, s))
        R = robot.pose("left_hand")[0]
        J = robot.jacobian("left_hand")
        return R.T @ (J[:3] - skew(R @ contact.points[0]) @ J[3:]) @ (v + s * a)

    h = 1e-5
    change = (slip(h) - slip(-h)) / (2 * h)
    np.testing.assert_allclose(change, -4.0 * slip(0.0), atol=1e-6)


def test_an_arm_alone_is_computed_torque():
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    v = 0.3 * np.random.default_rng(0).normal(size=7)
    levels = [PositionTask("tool", np.array([0.6, 0.2, 0.4])), PostureTask(robot.neutral)]
    problem = TorqueStack(levels).problem(robot, 0.002, v)
    x = hqp_rp.solve(problem, "null_space").require()
    expected = hqp_rp.solve(AccelerationStack(levels).problem(robot, 0.002, v), "null_space").require()
    np.testing.assert_allclose(x, expected, atol=1e-9)
    stack = TorqueStack(levels, torque=50.0)
    torque = stack.dynamics(stack.problem(robot, 0.002, v)).torque(x)
    np.testing.assert_allclose(torque, robot.inverse_dynamics(v, x), atol=1e-9)


def test_forces_are_tracked_shared_and_kept_small():
    robot, contacts, _ = standing()
    robot.update(robot.neutral)
    left, right = contacts
    share = ContactForceTask(left, [0.0, 0.0, 250.0], axes="z")
    even = ContactForceTask([left, right], each=True)
    posture = PostureTask(robot.neutral, joints=range(6, robot.nv), gain=2.0)
    com = CenterOfMassTask(robot.center_of_mass())
    stack = TorqueStack([com, share, posture, even], contacts=contacts, torque=200.0)
    problem = stack.problem(robot, 0.002, np.zeros(robot.nv))
    forces = stack.dynamics(problem).forces(hqp_rp.solve(problem, "hierarchical_active_set").require()).reshape(2, 4, 3)
    assert forces[0, :, 2].sum() == pytest.approx(250.0, abs=1e-6)
    share.target = [0.0, 0.0, 300.0]
    problem = stack.problem(robot, 0.002, np.zeros(robot.nv))
    forces = stack.dynamics(problem).forces(hqp_rp.solve(problem, "hierarchical_active_set").require()).reshape(2, 4, 3)
    assert forces[0, :, 2].sum() == pytest.approx(300.0, abs=1e-6)
    small = TorqueStack([com, posture, TorqueTask()], contacts=contacts, torque=200.0)
    problem = small.problem(robot, 0.002, np.zeros(robot.nv))
    x = hqp_rp.solve(problem, "hierarchical_active_set").require()
    level = problem.levels[-1]
    np.testing.assert_allclose(level.A @ x - level.lower, small.dynamics(problem).torque(x), atol=1e-9)


def test_a_box_holds_what_the_pyramid_holds_at_its_force():
    contact = Contact("a", friction=0.5, cone="box", nominal_force=80.0)
    G, lower, upper = contact.cone_rows()
    np.testing.assert_array_equal(G, np.eye(3))
    np.testing.assert_allclose(upper[:2], 40.0 / np.sqrt(2.0))
    np.testing.assert_allclose(lower[:2], -40.0 / np.sqrt(2.0))
    assert np.hypot(*upper[:2]) == pytest.approx(0.5 * 80.0)


@pytest.mark.parametrize("edges", [3, 4, 8])
def test_the_pyramid_lies_within_the_cone_and_touches_it(edges):
    contact = Contact("a", friction=0.7, edges=edges)
    G, lower, upper = contact.cone_rows()
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    furthest = 0.0
    for t in angle:
        direction = np.array([np.cos(t), np.sin(t), 0.0])
        reach = min((-G[i, 2]) / (G[i] @ direction) for i in range(edges) if G[i] @ direction > 1e-12)
        assert reach <= 0.7 + 1e-12
        furthest = max(furthest, reach)
    assert furthest == pytest.approx(0.7, abs=1e-4)
    assert (lower[:-1] == -np.inf).all()
    assert (upper[:-1] == 0.0).all()
    assert lower[-1] == 0.0


def test_an_open_contact_has_neither_force_nor_rows():
    robot, contacts, stack = standing()
    robot.update(robot.neutral)
    contacts[1].activation = 0.0
    problem = stack.problem(robot, 0.002, np.zeros(robot.nv))
    x = hqp_rp.solve(problem, "hierarchical_active_set").require()
    np.testing.assert_allclose(stack.dynamics(problem).forces(x).reshape(2, 4, 3)[1], 0.0, atol=1e-7)
    assert not problem.levels[0].A[6:].any()
    contacts[1].activation = 0.25
    problem = stack.problem(robot, 0.002, np.zeros(robot.nv))
    x = hqp_rp.solve(problem, "hierarchical_active_set").require()
    assert stack.dynamics(problem).forces(x).reshape(2, 4, 3)[1, :, 2].max() <= 125.0 + 1e-6
    np.testing.assert_array_equal(stack.dynamics(problem).degrees[:12], [1.0] * 6 + [0.25] * 6)


def test_the_metric_is_that_of_the_accelerations():
    robot, _, stack = standing(metric="inertia")
    robot.update(robot.neutral)
    problem = stack.problem(robot, 0.002, np.zeros(robot.nv))
    np.testing.assert_allclose(problem.metric[: robot.nv, : robot.nv], robot.mass_matrix())
    np.testing.assert_array_equal(problem.metric[robot.nv :, robot.nv :], np.eye(24))
    assert hqp_rp.solve(problem, "hierarchical_active_set").status is hqp_rp.Status.SOLVED


def test_a_contradiction_is_told_by_contact_and_joint():
    robot, contacts, _ = standing()
    robot.update(robot.neutral)
    for contact in contacts:
        contact.max_force = 20.0  # 160 N do not carry the robot, and its limits do not let it fall
    posture = PostureTask(robot.neutral, joints=range(6, robot.nv))
    limits = [CenterOfMassTask(robot.center_of_mass(), gain=1.0), JointLimit(acceleration=100.0)]
    held = TorqueStack([posture], limits, contacts=contacts, torque=100.0)
    found = hqp_rp.solve(held.problem(robot, 0.002, np.zeros(robot.nv)), "hierarchical_active_set")
    assert found.status is hqp_rp.Status.INFEASIBLE
    assert any("sole contact" in name for name in found.conflict.names)
    assert any("equation of motion" in name or "centre of mass" in name for name in found.conflict.names)
    stated = dict(zip(found.conflict.names, found.conflict.units, strict=True))
    for name, unit in stated.items():
        group, _, row = name.partition(": ")
        slides = row.partition(" ")[0] in {f"root[{i}]" for i in range(3)}
        units = ("N", "m/s^2") if slides else ("N m", "rad/s^2")
        expected = {"equation of motion": units[0], "joint torque": units[0], "joint limits": units[1]}
        assert unit == ("x 100 N" if "contact" in group else expected.get(group, "")), name
    hard = found.problem.hard
    lengths = np.linalg.norm(hard.A[list(found.conflict.rows)], axis=1)
    np.testing.assert_allclose(found.conflict.misses, found.conflict.gap * lengths)
    assert "x 100 N" in str(found.conflict)
    assert "Hard rows '" in found.message


def test_each_problem_keeps_the_names_of_its_own_robot():
    """One stack in turns on two robots, one on a floating base, with other torque limits; asked afterwards."""

    def chain(joints, base=""):
        bodies = "".join(
            f'<body name="{name}" pos="0.3 0 0"><joint name="{name}" axis="0 1 0" {limit}/><geom size="0.1" mass="1"/>'
            for name, limit in joints.items()
        )
        body = f'<body name="base">{base}<geom size="0.1" mass="1"/>{bodies}{"</body>" * len(joints)}</body>'
        robot = MujocoRobot(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>"))
        robot.update(robot.neutral)
        return robot

    effort = 'actuatorfrcrange="-4 4"'
    fixed = chain({"a": effort, "b": effort})
    floating = chain({"left": "", "right": effort, "other": ""}, '<freejoint name="base"/>')
    limit = JointLimit(position=False, velocity=1.0, acceleration=5.0)
    stack = TorqueStack([PositionTask("base", np.zeros(3))], [limit])
    expected = {
        fixed: ["joint torque: a", "joint torque: b", "joint limits: a", "joint limits: b"],
        floating: [
            *(f"equation of motion: base[{i}]" for i in range(6)),
            "joint torque: right",
            *(f"joint limits: base[{i}]" for i in range(6)),
            *("joint limits: left", "joint limits: right", "joint limits: other"),
        ],
    }
    made = [(robot, stack.problem(robot, 0.01, np.zeros(robot.nv))) for robot in (fixed, floating, fixed, floating)]
    for robot, problem in made:
        assert [str(name) for name in row_names(problem)] == expected[robot]
    # Only torques on the way: the stack has met another robot since its last problem.
    stack.holding_torque(fixed, np.zeros(2), 1.0)
    assert [str(name) for name in row_names(made[-1][1])] == expected[floating]


def test_limits_come_from_the_model_where_none_are_given():
    joint = '<joint name="a" axis="0 1 0" actuatorfrcrange="-4 4"/>'
    body = f'<body>{joint}<geom size="0.1" mass="1" pos="0.5 0 0"/></body>'
    xml = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    robot = MujocoRobot(mujoco.MjModel.from_xml_string(xml))
    robot.update(robot.neutral)
    stack = TorqueStack([PostureTask(robot.neutral + 1.0, gain=10.0)])
    problem = stack.problem(robot, 0.01, np.zeros(1))
    x = hqp_rp.solve(problem, "hierarchical_active_set").require()
    assert abs(stack.dynamics(problem).torque(x)[0]) == pytest.approx(4.0)


def test_copies_make_the_same_problem():
    robot, _, stack = standing()
    v = at_work(robot, 0)
    for made in (copy.deepcopy(stack), pickle.loads(pickle.dumps(stack))):
        one, other = stack.problem(robot, 0.002, v), made.problem(robot, 0.002, v)
        np.testing.assert_array_equal(one.given, other.given)
        np.testing.assert_array_equal(one.given_lower, other.given_lower)
        assert repr(stack) == repr(made)


def test_a_problem_stays_as_it_is_when_the_robot_moves_on():
    robot, _, stack = standing()
    v = at_work(robot, 0)
    problem = stack.problem(robot, 0.002, v)
    before, jacobian = problem.given.copy(), stack.dynamics(problem).contact_jacobian.copy()
    stack.problem(robot, 0.002, at_work(robot, 1))
    np.testing.assert_array_equal(problem.given, before)
    np.testing.assert_array_equal(stack.dynamics(problem).contact_jacobian, jacobian)


POSTURE = PostureTask(np.zeros(7))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: TorqueStack([]), "at least one level"),
        (lambda: TorqueStack([[]]), "level 1 is empty"),
        (lambda: TorqueStack([POSTURE], contacts=["foot"]), "list of Contact"),
        (lambda: TorqueStack([POSTURE, ContactForceTask(Contact("a"))]), "not among the stack's contacts"),
        (lambda: TorqueStack([TorqueTask()]), "no task on the motion"),
        (lambda: TorqueStack([POSTURE], names=["a", "b"]), "one name for each of the 1"),
        (lambda: TorqueStack([POSTURE], damping=[None, None]), "2 entries for 1 levels"),
        (lambda: TorqueStack([POSTURE, TorqueTask()], damping=hqp_rp.ConstantDamping(0.1)), "need no damping"),
        (lambda: TorqueStack([POSTURE], force_unit=0.0), "force_unit is 0"),
        (lambda: TorqueStack([POSTURE], torque=-1.0), "must be > 0"),
        (lambda: TorqueStack([POSTURE], metric="mass"), 'give "inertia"'),
        (lambda: Contact("a", on="a"), "cannot rest on itself"),
        (lambda: Contact("a", cone="circle"), "choose one of pyramid, box"),
        (lambda: Contact("a", cone="box"), "a box needs it"),
        (lambda: Contact("a", nominal_force=1.0), "a pyramid has none"),
        (lambda: Contact("a", friction=0.0), "the friction of"),
        (lambda: Contact("a", edges=2), "at least 3"),
        (lambda: Contact("a", points=np.zeros((0, 3))), "k at least 1"),
        (lambda: Contact("a", points=np.zeros((2, 2))), "k at least 1"),
        (lambda: Contact("a", normal=np.zeros(3)), "no direction"),
        (lambda: Contact("a", min_force=5.0, max_force=2.0), "between 0 and max_force"),
        (lambda: Contact("a", max_force=0.0), "must be > 0"),
        (lambda: Contact("a", kd=-1.0), "the kd of"),
        (lambda: setattr(Contact("a"), "activation", 0.5), "has no max_force"),
        (lambda: setattr(Contact("a"), "activation", 2.0), "in [0, 1]"),
        (lambda: ContactForceTask([]), "give a Contact"),
        (lambda: ContactForceTask(Contact("a"), [1.0]), "3 numbers in N"),
        (lambda: ContactForceTask(Contact("a"), axes="rx"), "axes of"),
        (lambda: TorqueTask([[1.0]]), "one finite number"),
    ],
)
def test_what_does_not_fit_is_refused(make, words):
    with pytest.raises(SettingError) as error:
        make()
    assert words in str(error.value)


def test_a_robot_that_does_not_fit_is_refused():
    robot = MujocoRobot.from_arm(sawyer())
    posture = PostureTask(robot.neutral)
    with pytest.raises(RobotError, match="foot"):
        TorqueStack([posture], contacts=[Contact("foot")]).problem(robot, 0.01, np.zeros(7))
    with pytest.raises(RobotError, match="joint"):
        TorqueStack([posture], driven=["nothing"]).problem(robot, 0.01, np.zeros(7))
    with pytest.raises(SettingError, match="7 velocities are driven"):
        TorqueStack([posture, TorqueTask(np.zeros(3))]).problem(robot, 0.01, np.zeros(7))
    plain = TorqueStack([posture])
    with pytest.raises(SettingError, match="not made by TorqueStack"):
        plain.dynamics(AccelerationStack([posture]).problem(robot, 0.01, np.zeros(7)))
    with pytest.raises(SettingError):
        plain.problem(robot, 0.01, np.full(7, np.nan))


def test_rows_are_right_after_gravity_was_compensated_for_a_contact_that_has_changed():
    robot, contacts, stack = standing()
    v = at_work(robot, 0)
    stack.problem(robot, 0.002, v)
    contacts[0].friction = 0.3
    stack.holding_torque(robot, v, 5.0)
    found = stack.problem(robot, 0.002, v)
    anew = TorqueStack(stack.levels, stack.limits, contacts=contacts, torque=120.0).problem(robot, 0.002, v)
    np.testing.assert_array_equal(found.hard.A, anew.hard.A)
    np.testing.assert_array_equal(found.matrix, anew.matrix)


def test_targets_set_at_every_step_are_those_of_fresh_tasks():
    robot = MujocoRobot.from_arm(sawyer())
    rng = np.random.default_rng(3)
    tasks = [
        lambda p, R: hqp_rp.PoseTask("tool", (R, p), axes=["ry", "x", "z"], gain=2.0, feedforward=np.arange(6.0)),
        lambda p, R: PositionTask("tool", p, axes="zx", weight=3.0),
        lambda p, R: OrientationTask("tool", R, gain=3.0, feedforward=[0.1, 0.2, 0.3]),
        lambda p, R: CenterOfMassTask(p, axes="yx", feedforward=[1.0, 2.0, 3.0]),
    ]
    p0, R0 = np.zeros(3), np.eye(3)
    kept = [make(p0, R0) for make in tasks]
    stack = AccelerationStack(kept)
    other = MujocoRobot.from_arm(sawyer())
    other.update(rng.normal(size=7))
    for step in range(6):
        robot.update(rng.normal(size=7))
        v, p = rng.normal(size=7), rng.normal(size=3)
        R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        R *= np.linalg.det(R)
        for task, target in zip(kept, ((R, p), p, R, p), strict=True):
            task.target = target
        if step == 3:  # gains and feed-forward between targets, and another robot in between
            kept[0].gain, kept[1].kp, kept[2].feedforward = 5.0, 7.0, [1.0, 1.0, 1.0]
            kept[3].feedforward_acceleration = [0.5, 0.6, 0.7]
        if step == 4:
            AccelerationStack(kept).problem(other, 0.001, v)
        found = stack.problem(robot, 0.001, v)
        fresh = [make(p, R) for make in tasks]
        if step >= 3:
            fresh[0].gain, fresh[1].kp, fresh[2].feedforward = 5.0, 7.0, [1.0, 1.0, 1.0]
            fresh[3].feedforward_acceleration = [0.5, 0.6, 0.7]
        anew = AccelerationStack(fresh).problem(robot, 0.001, v)
        np.testing.assert_array_equal(found.matrix, anew.matrix)
        np.testing.assert_array_equal(found.lower, anew.lower)


def test_joint_limits_without_brakes_beside_torque_limits_are_said_once():
    robot = MujocoRobot.from_arm(sawyer(), gravity_compensation=False)
    robot.update(robot.neutral)
    levels = [PostureTask(robot.neutral)]
    words = r"'joint limits' asks joints to stop .* Give JointLimit\(acceleration=\.\.\.\) what the torques can deliver"
    with pytest.warns(UserWarning, match=words) as told:
        stack = TorqueStack(levels, [JointLimit()], torque=50.0)
    assert len(told) == 1
    assert told[0].filename == __file__
    # What is warned of: an arm at rest outside its limits, and no answer.
    out = robot.upper.copy()
    out[1] += 0.3
    robot.update(out)
    command = TorqueController(stack, "hierarchical_active_set").step(robot, 0.001, np.zeros(7))
    assert command.solution.status is hqp_rp.Status.INFEASIBLE
    assert "'joint limits: joint2'" in command.reason
    assert pickle.loads(pickle.dumps(stack)).limits[0].name == "joint limits"  # rebuilt without a word

    # Nothing to say of: brakes, a soft limit, speeds alone, torques without limit.
    for limit in (JointLimit(acceleration=5.0), JointLimit(jerk=50.0), JointLimit(position=False, velocity=1.0)):
        TorqueStack(levels, [limit], torque=50.0).problem(robot, 0.001, np.zeros(7), np.zeros(7))
    TorqueStack([JointLimit(), *levels], torque=50.0).problem(robot, 0.001, np.zeros(7))
    TorqueStack(levels, [JointLimit()], torque=np.inf)
    TorqueStack(levels, [JointLimit()])


def test_torque_limits_of_the_model_and_brakes_of_some_joints():
    body = '<body pos="0.5 0 0"><joint name="{}" axis="0 1 0" range="-1 1" actuatorfrcrange="-9 9"/>{}</body>'
    link = '<geom size="0.1" mass="1" pos="0.3 0 0"/>'
    arm = body.format("a", link + body.format("b", link))
    xml = f"<mujoco><compiler angle='radian'/><worldbody>{arm}</worldbody></mujoco>"
    robot = MujocoRobot(mujoco.MjModel.from_xml_string(xml))
    robot.update(robot.neutral)
    stack = TorqueStack([PostureTask(robot.neutral)], [JointLimit(acceleration={"a": 3.0}, velocity=1.0)])
    with pytest.warns(UserWarning, match="'joint limits' asks 'b' to stop"):
        stack.problem(robot, 0.001, np.zeros(2))
    stack.problem(robot, 0.001, np.zeros(2))
    with pytest.warns(UserWarning, match="asks joints to stop"):
        hqp_rp.Stack([PostureTask(robot.neutral)], [JointLimit(), hqp_rp.TorqueLimit(5.0)])
    hqp_rp.Stack([PostureTask(robot.neutral), hqp_rp.TorqueLimit(5.0)], [JointLimit()])


def test_two_threads_with_a_robot_each_share_a_stack():
    """What is written at every step belongs to a robot: no torque is made of another one's dynamics."""
    robots = [MujocoRobot.from_arm(sawyer()) for _ in range(2)]
    stack = TorqueStack([PostureTask(robots[0].neutral)])
    wrong = []

    def work(robot, seed):
        rng = np.random.default_rng(seed)
        for _ in range(300):
            robot.update(robot.neutral + rng.normal(size=7))
            v = rng.normal(size=7)
            try:
                dynamics = stack.dynamics(stack.problem(robot, 0.01, v))
            except Exception as error:
                wrong.append(error)
                continue
            if not np.array_equal(dynamics.offset, robot.bias(v)):
                wrong.append(seed)

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        threads = [threading.Thread(target=work, args=(robot, seed)) for seed, robot in enumerate(robots)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(before)
    assert not wrong
