"""mink's tasks and limits in our levels, against mink's own problem and solution."""

import mink
import mujoco
import numpy as np
import pytest
from mink.solve_ik import build_ik

import hqp_rp
from hqp_rp.control import JointLimit, PositionTask, PostureTask, Stack
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.robot import MujocoRobot, planar_arm, sawyer
from tests.control.chain import random_chain

DT = 0.02


def scene(arm, seed=0):
    rng = np.random.default_rng(seed)
    robot = MujocoRobot.from_arm(arm)
    robot.update(robot.neutral + rng.uniform(-0.5, 0.5, robot.nq))
    configuration = mink.Configuration(robot.model)
    configuration.update(robot.q)
    return rng, robot, configuration


def frame_type(robot, name):
    return "site" if name in [robot.model.site(i).name for i in range(robot.model.nsite)] else "body"


def frame_task(robot, rng, **costs):
    task = mink.FrameTask("tool", frame_type(robot, "tool"), **costs)
    wxyz = rng.normal(size=4)
    task.set_target(mink.SE3(wxyz_xyz=np.array([*(wxyz / np.linalg.norm(wxyz)), *rng.normal(size=3)])))
    return task


@pytest.fixture(params=["sawyer", "planar"])
def setting(request):
    return scene(sawyer() if request.param == "sawyer" else planar_arm(4))


def test_one_level_is_minks_own_answer(setting):
    """All tasks in one level, least squares over the weighted rows: mink's solution with no damping and no limits."""
    rng, robot, configuration = setting
    frame = frame_task(robot, rng, position_cost=[1.0, 2.0, 0.5], orientation_cost=0.3)
    frame.gain = 0.4
    posture = mink.PostureTask(robot.model, cost=np.linspace(0.1, 0.5, robot.nv), gain=0.8)
    posture.set_target(robot.neutral)
    theirs = mink.solve_ik(configuration, [frame, posture], DT, "quadprog", damping=0.0, limits=[])
    problem = Stack([[frame, posture]]).problem(robot, DT)
    ours = hqp_rp.solve(problem, "null_space")
    np.testing.assert_allclose(ours.x, theirs, rtol=1e-7, atol=1e-9)
    # And mink's QP is the normal equations of our rows, divided by dt.
    qp = build_ik(configuration, [frame, posture], DT, damping=0.0, limits=[])
    np.testing.assert_allclose(problem.matrix.T @ problem.matrix, qp.P, atol=1e-12)
    np.testing.assert_allclose(-problem.matrix.T @ problem.lower * DT, qp.q, atol=1e-12)


def test_two_levels_are_strict(setting):
    """A posture below a position: the position rows are met to rounding, which no finite weight of mink's reaches."""
    rng, robot, configuration = setting
    position = frame_task(robot, rng, position_cost=[1.0, 1.0, 0.0], orientation_cost=0.0)
    posture = mink.PostureTask(robot.model, cost=1.0)
    posture.set_target(robot.neutral)
    problem = Stack([position, posture]).problem(robot, DT)
    np.testing.assert_array_equal(problem.offsets, [0, 2, 2 + robot.nv])
    x = hqp_rp.solve(problem, "null_space").x
    A, e = position.compute_jacobian(configuration)[:2], position.compute_error(configuration)[:2]
    np.testing.assert_allclose(A @ x, -e / DT, atol=1e-9 * np.linalg.norm(e) / DT)
    soft = mink.solve_ik(configuration, [position, posture], DT, "quadprog", damping=0.0, limits=[])
    assert np.linalg.norm(A @ soft + e / DT) > 1e-3 * np.linalg.norm(e) / DT


def test_rows_of_zero_cost_are_dropped_and_costs_may_change():
    rng, robot, configuration = scene(sawyer())
    task = frame_task(robot, rng, position_cost=[1.0, 0.0, 3.0], orientation_cost=[0.0, 0.5, 0.0])
    task.gain = 0.5
    stack = Stack([task])
    A, e = task.compute_jacobian(configuration), task.compute_error(configuration)
    problem = stack.problem(robot, DT)
    np.testing.assert_allclose(problem.matrix, np.array([1.0, 3.0, 0.5])[:, None] * A[[0, 2, 4]], atol=1e-15)
    np.testing.assert_allclose(problem.lower, -0.5 / DT * np.array([1.0, 3.0, 0.5]) * e[[0, 2, 4]], atol=1e-12)
    task.set_orientation_cost(1.0)
    task.set_position_cost(1.0)
    np.testing.assert_array_equal(stack.problem(robot, DT).matrix, A)
    task.set_orientation_cost(0.0)
    task.set_position_cost(0.0)
    assert stack.problem(robot, DT).matrix.shape == (0, robot.nv)


def test_limits_are_minks_inequalities():
    _, robot, configuration = scene(sawyer())
    limits = [
        mink.ConfigurationLimit(robot.model),
        mink.VelocityLimit(robot.model, dict.fromkeys(robot.joint_names, 0.5)),
    ]
    posture = mink.PostureTask(robot.model, cost=1.0)
    posture.set_target(robot.neutral + 2.0)
    qp = build_ik(configuration, [posture], DT, damping=0.0, limits=limits)
    hard = Stack([posture], limits=limits).problem(robot, DT).hard
    np.testing.assert_array_equal(hard.A, qp.G)
    np.testing.assert_allclose(hard.upper * DT, qp.h, atol=1e-15)
    assert (hard.lower == -np.inf).all()
    # Soft, below another level, and the same answer as mink's where nothing else asks for anything.
    problem = Stack([limits[1], posture]).problem(robot, DT)
    np.testing.assert_array_equal(problem.levels[0].A, hard.A[-2 * robot.nv :])
    ours = hqp_rp.solve(Stack([posture], limits=limits).problem(robot, DT), "qp_cascade", backend="proxqp")
    theirs = mink.solve_ik(configuration, [posture], DT, "quadprog", damping=0.0, limits=limits)
    np.testing.assert_allclose(ours.x, theirs, atol=1e-6)


def test_an_inactive_limit_has_no_rows():
    _, robot, _ = scene(sawyer())
    problem = Stack([PositionTask("tool", np.zeros(3))], limits=[mink.VelocityLimit(robot.model)]).problem(robot, DT)
    assert problem.hard.A.shape == (0, robot.nv)


def test_other_tasks_of_mink_and_ours_mixed():
    _, robot, configuration = scene(sawyer())
    com = mink.ComTask(cost=1.0)
    com.set_target(np.array([0.1, 0.2, 0.3]))
    freeze = mink.DofFreezingTask(robot.model, [0, 3])
    damp = mink.DampingTask(robot.model, cost=2.0)
    stack = Stack([[com, PositionTask("tool", np.zeros(3))], damp], limits=[freeze, JointLimit()])
    problem = stack.problem(robot, DT)
    assert problem.names == ("mink ComTask + tool position", "mink DampingTask")
    np.testing.assert_allclose(problem.matrix[:3], com.compute_jacobian(configuration), atol=1e-15)
    np.testing.assert_array_equal(problem.matrix[6:], 2.0 * np.eye(7))
    np.testing.assert_array_equal(problem.lower[6:], 0.0)
    np.testing.assert_array_equal(problem.hard.A[:2], np.eye(7)[[0, 3]])
    np.testing.assert_array_equal(problem.hard.lower[:2], problem.hard.upper[:2])


def test_the_configuration_follows_the_robot():
    rng, robot, configuration = scene(sawyer())
    task = frame_task(robot, rng, position_cost=1.0, orientation_cost=1.0)
    stack = Stack([task])
    for _ in range(3):
        robot.update(robot.q + 0.1)
        configuration.update(robot.q)
        np.testing.assert_array_equal(stack.problem(robot, DT).matrix, task.compute_jacobian(configuration))


def test_our_tasks_converge_where_minks_do():
    """Our position task and mink's, each driven to its target, end at the same point."""
    _, robot, _ = scene(sawyer())
    start = robot.q.copy()
    target = robot.pose("tool")[1] + [0.05, -0.05, 0.05]
    theirs = mink.FrameTask("tool", frame_type(robot, "tool"), position_cost=1.0, orientation_cost=0.0, gain=0.2)
    theirs.set_target(mink.SE3.from_rotation_and_translation(mink.SO3.identity(), target))
    for task in (theirs, PositionTask("tool", target, gain=10.0)):
        robot.update(start)
        stack = Stack([task])
        for _ in range(100):
            robot.update(robot.integrate(robot.q, hqp_rp.solve(stack.problem(robot, DT), "null_space").x, DT))
        np.testing.assert_allclose(robot.pose("tool")[1], target, atol=1e-6)


def test_refusals():
    rng, robot, _ = scene(sawyer())
    energy = mink.KineticEnergyRegularizationTask(cost=1.0)
    with pytest.raises(SettingError, match=r"KineticEnergyRegularizationTask is an objective without rows"):
        Stack([energy])
    unset = mink.FrameTask("tool", frame_type(robot, "tool"), 1.0, 1.0)
    with pytest.raises(SettingError, match=r"mink FrameTask tool: .*[Tt]arget"):
        Stack([unset]).problem(robot, DT)
    unknown = mink.FrameTask("hand", "body", 1.0, 1.0)
    unknown.set_target(mink.SE3.identity())
    with pytest.raises(SettingError, match=r"mink FrameTask hand: .*hand"):
        Stack([unknown]).problem(robot, DT)
    task = frame_task(robot, rng, position_cost=1.0, orientation_cost=0.0)
    with pytest.raises(SettingError, match=r"need the time step"):
        Stack([task]).problem(robot)
    with pytest.raises(RobotError, match=r"this one is a Chain. Load it as hqp_rp.robot.MujocoRobot"):
        Stack([task]).problem(random_chain(rng), DT)


def test_levenberg_marquardt_damping_is_minks_own(setting):
    """All tasks in one level: mink's answer with its lm_damping, which may change from step to step."""
    rng, robot, configuration = setting
    frame = frame_task(robot, rng, position_cost=[1.0, 2.0, 0.5], orientation_cost=0.3, lm_damping=0.3)
    frame.gain = 0.4
    posture = mink.PostureTask(robot.model, cost=np.linspace(0.1, 0.5, robot.nv), gain=0.8, lm_damping=0.1)
    posture.set_target(rng.normal(size=robot.nq))
    stack = Stack([[frame, posture]])
    for lm_damping in (0.3, 0.0, 2.0):
        frame.lm_damping = lm_damping
        theirs = mink.solve_ik(configuration, [frame, posture], DT, "quadprog", damping=0.0, limits=[])
        for solver in ("null_space", "hierarchical_active_set", "qp_cascade"):
            ours = hqp_rp.solve(stack.problem(robot, DT), solver)
            assert ours.status.ok
            np.testing.assert_allclose(ours.x, theirs, rtol=1e-6, atol=1e-9)
    # Damping of the level takes its place.
    problem = Stack([[frame, posture]], damping=hqp_rp.ConstantDamping(0.2)).problem(robot, DT)
    assert problem.damping == (hqp_rp.ConstantDamping(0.2),)
    with pytest.raises(SettingError, match="has damped levels, which a batch cannot hold"):
        stack.batch(robot, robot.neutral[None], DT)


def test_a_limit_of_mink_sees_mocap_bodies_where_they_are():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody>
        <body name="arm"><joint name="j" type="slide" axis="1 0 0"/><geom name="hand" size=".05"/></body>
        <body name="post" mocap="true" pos="1 0 0"><geom name="post" size=".05"/></body></worldbody></mujoco>"""
    )
    robot = MujocoRobot(model)
    limit = mink.CollisionAvoidanceLimit(
        model, [(["hand"], ["post"])], minimum_distance_from_collisions=0.0, collision_detection_distance=10.0
    )
    stack = Stack([PostureTask([0.0])], [limit])
    far = stack.problem(robot, 0.01).hard.upper.max()
    robot.set_mocap("post", [0.2, 0.0, 0.0])
    near = stack.problem(robot, 0.01).hard.upper.max()
    assert near == pytest.approx(far / 9.0, rel=1e-6)
