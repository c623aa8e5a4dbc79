"""pink's tasks in our levels, against pink's own problem and solution."""

import pickle
import warnings

import numpy as np
import pink
import pinocchio as pin
import pytest
from pink.limits import ConfigurationLimit, VelocityLimit
from pink.tasks import (
    ComTask,
    DampingTask,
    FrameTask,
    JointCouplingTask,
    JointVelocityTask,
    LinearHolonomicTask,
    LowAccelerationTask,
    ManipulabilityTask,
    OmniwheelTask,
    PostureTask,
    RelativeFrameTask,
    RollingTask,
)

import hqp_rp
from hqp_rp.control import (
    AccelerationStack,
    CenterOfMassTask,
    Contact,
    ContactForceTask,
    JointLimit,
    PositionTask,
    Stack,
    TorqueStack,
)
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.robot import MujocoRobot, PinocchioRobot, sawyer
from hqp_rp.robot.named import named_robot
from tests.bench.remote import arm_urdf
from tests.control.pink_scene import DT, FRAMES, away, frame_task, moved, scene, theirs_at

FIXED = ("LowAccelerationTask", "ManipulabilityTask")  # which pink has for robots without a free base only


@pytest.fixture(params=["arm", "floating"])
def setting(request, tmp_path):
    return request.param, *scene(request.param, tmp_path)


def tasks(kind, rng, robot, configuration):
    """One of each of pink's tasks, by class."""
    tip, root = FRAMES[kind]
    n = robot.nv - (6 if kind == "floating" else 0)
    relative = RelativeFrameTask(tip, root, position_cost=0.6, orientation_cost=[0.3, 1.0, 2.0], gain=0.7)
    relative.set_target(moved(configuration.get_transform(tip, root), rng))
    com = ComTask(cost=[2.0, 1.0, 0.4], gain=0.5)
    com.set_target(robot.center_of_mass() + rng.uniform(-0.2, 0.2, 3))
    posture = PostureTask(cost=0.7, gain=0.8)
    posture.set_target(away(robot, rng))
    velocity = JointVelocityTask(cost=0.5)
    velocity.set_target(rng.normal(size=n), DT)
    low = LowAccelerationTask(cost=2.0)
    low.set_last_integration(rng.normal(size=robot.nv), DT)
    made = [
        frame_task(kind, rng, configuration, position_cost=[1.0, 2.0, 0.5], orientation_cost=0.3, gain=0.4),
        relative,
        com,
        posture,
        DampingTask(cost=1.5),
        velocity,
        low,
        LinearHolonomicTask(rng.normal(size=(2, robot.nv)), rng.normal(size=2), None, cost=[1.0, 3.0], gain=0.3),
        JointCouplingTask(list(robot.model.names)[-2:], [1.0, -0.5], 2.0, configuration),
        RollingTask(tip, "universe", 0.1, cost=None, gain=0.9),
        OmniwheelTask(tip, "universe", 0.1, cost=0.5),
    ]
    if kind == "arm":
        made.append(ManipulabilityTask(tip, robot.model, cost=0.5))
    else:
        made.remove(low)
    return {type(task).__name__: task for task in made}


KINDS = [name for name in pink.tasks.__all__ if name != "Task"]


@pytest.mark.parametrize("kind", KINDS)
def test_one_task_alone_is_pinks_own_answer(setting, kind):
    """Least squares of least norm over the weighted rows: `solve_ik` with hardly any damping and no limits."""
    robot_kind, rng, robot, configuration = setting
    made = tasks(robot_kind, rng, robot, configuration)
    if kind not in made:
        assert kind in FIXED
        return
    task = made[kind]
    problem = Stack([task]).problem(robot, DT)
    # pink's QP is the normal equations of our rows, divided by dt.
    qp = pink.build_ik(configuration, [task], DT, damping=0.0, limits=[])
    np.testing.assert_allclose(problem.matrix.T @ problem.matrix, qp.P, atol=1e-12)
    np.testing.assert_allclose(-problem.matrix.T @ problem.lower * DT, qp.q, atol=1e-12)
    theirs = pink.solve_ik(configuration, [task], DT, "quadprog", damping=1e-9, limits=[])
    ours = hqp_rp.solve(problem, "null_space").x
    assert kind == "DampingTask" or np.linalg.norm(theirs) > 0.1
    np.testing.assert_allclose(ours, theirs, atol=1e-5 * (1.0 + np.linalg.norm(theirs)))


@pytest.mark.parametrize(
    "kind", ["FrameTask", "RelativeFrameTask", "ComTask", "PostureTask", "LinearHolonomicTask", "JointCouplingTask"]
)
def test_jacobians_are_the_derivatives_of_the_errors(setting, kind):
    """rate = -gain * error / dt, so d(rate) along v is -gain / dt times rows times v."""
    robot_kind, rng, robot, configuration = setting
    task = tasks(robot_kind, rng, robot, configuration)[kind]
    stack, q, step = Stack([task]), robot.q, 1e-6
    matrix = stack.problem(robot, DT).matrix
    v = rng.normal(size=robot.nv)
    rates = []
    for sign in (1.0, -1.0):
        robot.update(robot.integrate(q, sign * v, step))
        rates.append(stack.problem(robot, DT).lower)
    found = (rates[0] - rates[1]) / (2.0 * step)
    np.testing.assert_allclose(found, -task.gain / DT * matrix @ v, rtol=1e-6, atol=1e-6)


def test_two_levels_are_strict(setting):
    """A posture below a position: the position rows are met to rounding, which no finite weight of pink's reaches."""
    kind, rng, robot, configuration = setting
    position = frame_task(kind, rng, configuration, position_cost=[1.0, 1.0, 0.0], orientation_cost=0.0)
    posture = PostureTask(cost=1.0)
    posture.set_target(away(robot, rng))
    # The base of the floating robot stays, so that the position asks of the joints.
    base = JointCouplingTask([], [], 1.0, configuration)
    base.A, base.b = np.eye(6, robot.nv), np.zeros(6)
    base.q_0 = robot.q
    first = [base] if kind == "floating" else []
    problem = Stack([*first, position, posture]).problem(robot, DT)
    rows = position.compute_jacobian(configuration)[:2], position.compute_error(configuration)[:2]
    x = hqp_rp.solve(problem, "null_space").x
    scale = np.linalg.norm(rows[1]) / DT
    assert np.linalg.norm(rows[0] @ x + rows[1] / DT) < 1e-9 * scale
    soft = pink.solve_ik(configuration, [*first, position, posture], DT, "quadprog", damping=1e-9, limits=[])
    assert np.linalg.norm(rows[0] @ soft + rows[1] / DT) > 1e-3 * scale


def test_rows_of_zero_cost_are_dropped_and_costs_may_change(tmp_path):
    rng, robot, configuration = scene("arm", tmp_path)
    task = frame_task("arm", rng, configuration, position_cost=[1.0, 0.0, 3.0], orientation_cost=[0.0, 0.5, 0.0])
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


def test_tasks_of_pink_and_ours_mixed(tmp_path):
    _, robot, configuration = scene("arm", tmp_path)
    com = ComTask(cost=1.0)
    com.set_target(np.array([0.1, 0.2, 0.3]))
    held = LinearHolonomicTask(np.eye(7)[[0, 3]], np.zeros(2), robot.q)
    stack = Stack(
        [[com, PositionTask("tool", np.zeros(3))], DampingTask(cost=2.0)],
        limits=[held, JointLimit(), VelocityLimit(robot.model)],
    )
    problem = stack.problem(robot, DT)
    assert problem.names == ("pink ComTask + tool position", "pink DampingTask")
    np.testing.assert_allclose(problem.matrix[:3], com.compute_jacobian(configuration), atol=1e-15)
    np.testing.assert_array_equal(problem.matrix[6:], 2.0 * np.eye(7))
    np.testing.assert_array_equal(problem.lower[6:], 0.0)
    np.testing.assert_array_equal(problem.hard.A[:2], np.eye(7)[[0, 3]])
    np.testing.assert_array_equal(problem.hard.lower[:2], problem.hard.upper[:2])


def test_the_configuration_follows_the_robot_once_per_problem(setting, monkeypatch):
    kind, rng, robot, configuration = setting
    task = frame_task(kind, rng, configuration, position_cost=1.0, orientation_cost=1.0)
    com = ComTask(cost=1.0)
    com.set_target(np.zeros(3))
    stack = Stack([task, com])
    calls, update = [], pink.Configuration.update
    monkeypatch.setattr(pink.Configuration, "update", lambda *a: calls.append(a) or update(*a))
    for _ in range(3):
        robot.update(robot.integrate(robot.q, np.full(robot.nv, 0.1), 1.0))
        before = robot.jacobian(FRAMES[kind][0])
        calls.clear()
        matrix = stack.problem(robot, DT).matrix
        assert len(calls) == 1
        np.testing.assert_allclose(matrix[:6], task.compute_jacobian(theirs_at(robot)), atol=1e-14)
        np.testing.assert_array_equal(robot.jacobian(FRAMES[kind][0]), before)  # pink has data of its own
    other = pickle.loads(pickle.dumps(robot))
    other.update(other.neutral)
    moved_task = stack.problem(other, DT).matrix[:6]
    np.testing.assert_allclose(moved_task, task.compute_jacobian(theirs_at(other)), atol=1e-14)
    copied = pickle.loads(pickle.dumps(stack))
    np.testing.assert_array_equal(copied.problem(other, DT).matrix, stack.problem(other, DT).matrix)


def test_quaternions_need_not_be_normalized(tmp_path):
    rng, robot, configuration = scene("floating", tmp_path)
    task = frame_task("floating", rng, configuration, position_cost=1.0, orientation_cost=1.0)
    stack = Stack([task])
    expected = stack.problem(robot, DT)
    q = robot.q.copy()
    q[3:7] *= 3.0
    q[8:10] *= 0.5
    robot.update(q)
    found = stack.problem(robot, DT)
    np.testing.assert_allclose(found.matrix, expected.matrix, atol=1e-12)
    np.testing.assert_allclose(found.lower, expected.lower, atol=1e-10)


@pytest.mark.parametrize("locked", [[1, 4, 5], [1, 2, 3, 4, 5, 6]])
def test_reduced_models(locked):
    """Four joints of seven, and one, where Pinocchio's bindings return vectors for matrices."""
    full = pin.buildModelFromXML(arm_urdf(sawyer()))
    robot = PinocchioRobot(pin.buildReducedModel(full, locked, np.full(7, 0.3)))
    assert robot.nv == 7 - len(locked)
    robot.update(robot.q + 0.4)
    configuration = theirs_at(robot)
    task = FrameTask("tool", position_cost=1.0, orientation_cost=0.5)
    task.set_target(configuration.get_transform_frame_to_world("tool") * pin.exp6(np.full(6, 0.3)))
    limits = [ConfigurationLimit(robot.model), VelocityLimit(robot.model)]
    theirs = pink.solve_ik(configuration, [task], DT, "quadprog", damping=0.0, limits=limits)
    problem = Stack([task], limits=limits).problem(robot, DT)
    assert problem.matrix.shape == (6, robot.nv)
    np.testing.assert_allclose(hqp_rp.solve(problem, "hierarchical_active_set").x, theirs, atol=1e-7)


def test_our_tasks_converge_where_pinks_do(setting):
    """Our position task and pink's, each driven to its target, end at the same point."""
    kind, _, robot, configuration = setting
    frame, start = FRAMES[kind][0], robot.q
    target = robot.pose(frame)[1] + [0.05, -0.05, 0.05]
    theirs = FrameTask(frame, position_cost=1.0, orientation_cost=0.0, gain=0.2)
    theirs.set_target(pin.SE3(configuration.get_transform_frame_to_world(frame).rotation, target))
    for task in (theirs, PositionTask(frame, target, gain=10.0)):
        robot.update(start)
        stack = Stack([task])
        for _ in range(100):
            robot.update(robot.integrate(robot.q, hqp_rp.solve(stack.problem(robot, DT), "null_space").x, DT))
        np.testing.assert_allclose(robot.pose(frame)[1], target, atol=1e-6)


def test_levenberg_marquardt_damping_is_pinks_own(setting):
    """All tasks in one level: pink's answer with its lm_damping, which may change from step to step."""
    kind, rng, robot, configuration = setting
    frame = frame_task(kind, rng, configuration, position_cost=[1.0, 2.0, 0.5], orientation_cost=0.3, lm_damping=0.3)
    frame.gain = 0.4
    posture = PostureTask(cost=0.4, gain=0.8, lm_damping=0.1)
    posture.set_target(away(robot, rng))
    stack = Stack([[frame, posture]])
    for lm_damping in (0.3, 0.0, 2.0):
        frame.lm_damping = lm_damping
        theirs = pink.solve_ik(configuration, [frame, posture], DT, "quadprog", damping=0.0, limits=[])
        for solver in ("null_space", "hierarchical_active_set", "qp_cascade"):
            ours = hqp_rp.solve(stack.problem(robot, DT), solver)
            assert ours.status.ok
            np.testing.assert_allclose(ours.x, theirs, rtol=1e-6, atol=1e-8)
    # Damping of the level takes its place.
    problem = Stack([[frame, posture]], damping=hqp_rp.ConstantDamping(0.2)).problem(robot, DT)
    assert problem.damping == (hqp_rp.ConstantDamping(0.2),)


class Energy(PostureTask):
    """An objective without rows."""

    def compute_qp_objective(self, configuration):
        return np.eye(configuration.model.nv), np.zeros(configuration.model.nv)


def test_objectives_without_rows_are_refused():
    with pytest.raises(
        SettingError, match=r"pink task Energy is an objective without rows A dq = -gain \* error: it has"
    ):
        Stack([Energy(cost=1.0)])
    with pytest.raises(
        SettingError, match=r"the class FrameTask, which is neither a Task, a Limit, or a task or limit of"
    ):
        Stack([FrameTask])


def test_what_is_not_set_up_is_refused_in_a_sentence(tmp_path):
    rng, robot, configuration = scene("arm", tmp_path)
    posture = PostureTask(cost=1.0)
    posture.set_target(np.zeros(3))
    unknown = FrameTask("hand", 1.0, 1.0)
    unknown.set_target(pin.SE3.Identity())
    narrow = LinearHolonomicTask(np.eye(3), np.zeros(3), None)
    costs = frame_task("arm", rng, configuration, position_cost=1.0, orientation_cost=1.0)
    costs.cost = np.ones(5)
    for task, told in (
        (
            FrameTask("tool", 1.0, 1.0),
            r"pink FrameTask tool: no target set for frame 'tool'\. Set it up as pink asks for",
        ),
        (posture, r"pink PostureTask: wrong argument size: expected 7, got 3.* Set it up as pink asks for"),
        (unknown, r'pink FrameTask hand: Name "hand" is not a robot frame name in .* Set it up as pink asks for'),
        (narrow, r"pink LinearHolonomicTask: TaskJacobianNotSet\. Set it up as pink asks for"),
        (
            costs,
            r"pink FrameTask tool: its Jacobian has shape \(6, 7\), its error \(6,\) and its cost \(5,\), which do not",
        ),
    ):
        with pytest.raises(SettingError, match=told):
            Stack([task]).problem(robot, DT)
    with pytest.raises(SettingError, match=r"limits, or tasks of mink or pink; they need the time step"):
        Stack([costs]).problem(robot)


def test_a_task_that_pink_has_for_fixed_bases_only(tmp_path):
    _, robot, _ = scene("floating", tmp_path)
    with pytest.raises(SettingError, match=r"LowAccelerationTask: its Jacobian has shape \(2, 8\), its error \(8,\)"):
        Stack([LowAccelerationTask(cost=1.0)]).problem(robot, DT)


def test_a_robot_that_mujoco_computes_is_refused():
    with pytest.raises(
        RobotError, match=r"need a robot that Pinocchio computes; this one is a MujocoRobot. Load it as"
    ):
        Stack([DampingTask(cost=1.0)]).problem(MujocoRobot.from_arm(sawyer()), DT)


def standing_pink(gain, lm_damping=0.0, seed=0):
    """A humanoid on Pinocchio under torques, its hand led by a pink task, and pink's configuration."""
    robot = PinocchioRobot.from_mujoco(named_robot("humanoid").model, neutral="neutral")
    robot.update(robot.neutral)
    hand = FrameTask("left_hand", position_cost=1.0, orientation_cost=0.0, gain=gain, lm_damping=lm_damping)
    hand.set_target_from_configuration(theirs_at(robot))
    hand.transform_target_to_world.translation += np.array([0.05, 0.0, 0.05])
    corners = [[x, y, 0.0] for x in (-0.1, 0.1) for y in (-0.05, 0.05)]
    soles = [Contact(f"{side}_sole", points=corners, friction=0.6) for side in ("left", "right")]
    return robot, hand, soles


def torque_stack(robot, hand, soles, **settings):
    even = ContactForceTask(soles, each=True, weight=0.1)
    levels = [
        CenterOfMassTask(robot.center_of_mass(), axes="xy", gain=6.0),
        hand,
        [hqp_rp.PostureTask(robot.neutral, joints=["*"], gain=4.0), even],
    ]
    return TorqueStack(levels, [JointLimit(acceleration={"*": 100.0})], contacts=soles, torque=150.0, **settings)


@pytest.mark.parametrize(("gain", "kd", "ratio"), [(1.0, 20.0, "0.1"), (0.1, 20.0, "0.32"), (0.1, 60.0, "0.55")])
def test_a_pink_gain_that_swings_under_torques_is_warned_of_once(gain, kd, ratio):
    robot, hand, soles = standing_pink(gain)
    stack = torque_stack(robot, hand, soles, kd=kd)
    v = np.zeros(robot.nv)
    told = (
        f"'pink FrameTask left_hand' has the gain {gain:g} at dt 0.002 s.*damping ratio {ratio}\\).*= {kd / 2000:g}, or"
    )
    with pytest.warns(UserWarning, match=told) as warned:
        stack.problem(robot, 0.002, v)
    assert len(warned) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        stack.problem(robot, 0.002, v)
        stack.problem(robot, 0.0019, v)


def test_a_pink_task_with_kd_dt_over_4_settles_under_torques():
    """gain = 5 dt with the kd of 20, or more with a greater kd, is critically damped; a greater gain swings as told."""

    def run(gain, kd):
        robot, hand, soles = standing_pink(gain)
        stack = torque_stack(robot, hand, soles, kd=kd)
        solver, v = hqp_rp.get_solver("hierarchical_active_set"), np.zeros(robot.nv)
        goal, errors = hand.transform_target_to_world.translation.copy(), []
        for _ in range(750):
            problem = stack.problem(robot, 0.002, v)
            v = v + 0.002 * stack.dynamics(problem).acceleration(solver.solve(problem).require())
            robot.update(robot.integrate(robot.q, v, 0.002))
            errors.append(goal - robot.pose("left_hand")[1])
        along = np.array(errors) @ errors[0] / (errors[0] @ errors[0])
        return np.linalg.norm(errors[-1]), -along.min()

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for gain, kd in ((5 * 0.002, 20.0), (20 * 0.002, 80.0)):
            left, overshoot = run(gain, kd)
            assert left < 1e-3
            assert overshoot < 0.01
    with pytest.warns(UserWarning, match="damping ratio 0.5"):
        # exp(-pi / sqrt(3)) = 0.16 in continuous time.
        assert 0.1 < run(20 * 0.002, 20.0)[1] < 0.17


def test_kd_of_a_torque_stack_is_that_of_its_motion_rows():
    robot, hand, soles = standing_pink(0.01)
    v = 0.1 * np.random.default_rng(3).normal(size=robot.nv)
    made = {}
    for kd in (20.0, 60.0):
        stack = torque_stack(robot, hand, soles, kd=kd)
        stack = pickle.loads(pickle.dumps(stack))
        made[kd] = stack.problem(robot, 0.002, v).levels[2].lower
        expected = AccelerationStack([hand], kd=kd).problem(robot, 0.002, v).levels[0].lower
        np.testing.assert_allclose(made[kd], expected, rtol=1e-9)
    assert np.abs(made[60.0] - made[20.0]).max() > 0.1
    with pytest.raises(SettingError, match=r"kd is -1\.0"):
        torque_stack(robot, hand, soles, kd=-1.0)


def test_lm_damping_that_accelerations_leave_out_is_warned_of():
    robot, hand, soles = standing_pink(0.01, lm_damping=0.5)
    v = np.zeros(robot.nv)
    for stack in (torque_stack(robot, hand, soles), AccelerationStack([hand])):
        with pytest.warns(UserWarning, match=r"has lm_damping 0.5, which damps displacements.*ErrorDamping") as warned:
            stack.problem(robot, 0.002, v)
        assert len(warned) == 1
    policy = hqp_rp.ErrorDamping(0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        AccelerationStack([hand], damping=policy).problem(robot, 0.002, v)
        Stack([hand]).problem(robot, 0.002)


def test_tasks_that_want_a_velocity_have_no_gain_to_warn_of():
    robot = PinocchioRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    velocity, low = JointVelocityTask(cost=1.0), LowAccelerationTask(cost=1.0)
    velocity.set_target(np.ones(7), 0.002)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        AccelerationStack([velocity, low, DampingTask(cost=1.0)]).problem(robot, 0.002, np.zeros(7))


def test_levels_of_a_torque_stack_have_the_names_of_a_stack():
    robot, hand, soles = standing_pink(0.01)
    stack = torque_stack(robot, hand, soles)
    assert stack.names[2] == Stack([hand]).names[0] == "pink FrameTask left_hand"
    assert stack.names == ("contacts", "centre of mass", "pink FrameTask left_hand", stack.names[3])


def test_a_pink_configuration_is_told_which_robot_to_make():
    robot, hand, _ = standing_pink(0.01)
    with pytest.raises(RobotError, match=r"pink Configuration; give .*PinocchioRobot\(configuration.model\)"):
        Stack([hand]).problem(theirs_at(robot), 0.002)


def test_a_position_task_takes_the_place_of_an_se3():
    pose = pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([0.4, 0.5, 0.6]))
    np.testing.assert_array_equal(PositionTask("tool", pose).target, [0.4, 0.5, 0.6])
    task = PositionTask("tool", np.zeros(3))
    task.target = pose
    np.testing.assert_array_equal(task.target, [0.4, 0.5, 0.6])
    with pytest.raises(SettingError, match="the target of 'tool position'"):
        PositionTask("tool", np.eye(4))
