"""Stacks on accelerations: second-order rows of every task, limits that stay feasible, what a task of one's own needs."""

import contextlib
import copy

import mink
import mujoco
import numpy as np
import pink
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hqp_rp
from hqp_rp.control import (
    AccelerationStack,
    CenterOfMassTask,
    JointLimit,
    LookAtTask,
    MotionRunner,
    OrientationTask,
    PointingTask,
    PoseTask,
    PositionTask,
    PostureTask,
    RelativePoseTask,
    Stack,
    TorqueLimit,
    TwistTask,
    VelocityLimit,
)
from hqp_rp.core.errors import ProblemError, RobotError, SettingError
from hqp_rp.robot import MujocoRobot, PinocchioRobot, sawyer
from hqp_rp.robot.pinocchio_model import configuration_from_mujoco
from tests.control.chain import random_chain
from tests.robot.test_dynamics import every_joint

MOVED = (PositionTask, LookAtTask, CenterOfMassTask)  # whose place moves with the feed-forward


def tasks(rng, frame, other, pose):
    vector = rng.normal(size=(12, 3))
    return {
        "position": PositionTask(frame, vector[0], point=[0.1, 0.2, 0.3], feedforward=vector[1]),
        "position in its own axes": PositionTask(frame, vector[0], expressed_in=frame, feedforward=vector[1]),
        "position in other axes": PositionTask(
            frame, vector[0], expressed_in=other, axes="zx", weight=[2.0, 3.0], gain=[1.0, 2.0]
        ),
        "pose": PoseTask(frame, pose, expressed_in=other),
        "orientation": OrientationTask(frame, pose[0], expressed_in=frame, feedforward=vector[2]),
        "twist": TwistTask(frame, rng.normal(size=6), expressed_in=frame, point=[0.1, 0.0, 0.2]),
        "relative": RelativePoseTask(frame, other, pose, point=[0.1, 0.0, 0.2], feedforward=rng.normal(size=6)),
        "pointing": PointingTask(frame, vector[3], feedforward=vector[4]),
        "look at": LookAtTask(frame, 3.0 * vector[5], point=[0.1, 0.0, 0.2], feedforward=vector[6]),
        "centre of mass": CenterOfMassTask(vector[7], axes="zx", feedforward=vector[8]),
        "centre of mass of parts": CenterOfMassTask(
            vector[7], axes="zx", bodies=[other], feedforward=vector[8], weight=[2.0, 3.0]
        ),
    }


ROBOTS = {
    "sawyer": (lambda: MujocoRobot.from_arm(sawyer()), "tool", "link3"),
    "sawyer, Pinocchio": (lambda: PinocchioRobot.from_arm(sawyer()), "tool", "link3"),
    "every kind of joint": (every_joint, "tool", "arm"),
}
TASKS = list(tasks(np.random.default_rng(0), "a", "b", (np.eye(3), np.zeros(3))))


def missing(task, robot, v):
    """J v - feedforward, weighted, at the robot's configuration: what must come to rest."""
    J, rate = task.evaluate(robot)
    if isinstance(task, TwistTask):
        return J @ v - rate
    weight = np.broadcast_to(task.weight, rate.shape)
    return J @ v - (rate - weight * task.gain * task.error(robot))


@pytest.mark.parametrize("which", TASKS)
@pytest.mark.parametrize("name", ROBOTS)
def test_rows_are_the_second_derivative_of_every_task(name, which):
    make, frame, other = ROBOTS[name]
    robot, rng = make(), np.random.default_rng(3)
    q = robot.integrate(robot.neutral, 0.3 * rng.normal(size=robot.nv), 1.0)
    v = rng.normal(size=robot.nv)
    robot.update(q)
    task = tasks(rng, frame, other, robot.pose(other))[which]
    forward = getattr(task, "feedforward", None)
    if forward is not None:
        task.feedforward_acceleration = rng.normal(size=len(forward))
    h, sides = 1e-5, []
    for s in (h, -h):
        moved = copy.copy(task)
        moved._packed = moved._alone = None
        if forward is not None:
            moved.feedforward = forward + s * task.feedforward_acceleration
            if isinstance(task, MOVED):
                moved.target = task.target + s * forward
            if isinstance(task, PointingTask):
                moved.direction = task.direction + s * np.cross(forward, task.direction)
        robot.update(robot.integrate(q, v, s))
        sides.append(missing(moved, robot, v))
    robot.update(q)
    drift = (sides[0] - sides[1]) / (2 * h)
    J, _ = task.evaluate(robot)
    if isinstance(task, TwistTask):
        expected = -20.0 * missing(task, robot, v) - drift
    else:
        gain, weight = np.broadcast_to(task.gain, len(J)), np.broadcast_to(task.weight, len(J))
        expected = -2.0 * gain * missing(task, robot, v) + weight * gain**2 * task.error(robot) - drift
    problem = AccelerationStack([task]).problem(robot, 0.01, v)
    np.testing.assert_allclose(problem.lower, expected, atol=2e-7)
    np.testing.assert_allclose(problem.matrix, J, atol=1e-12)
    np.testing.assert_array_equal(robot.q, q)


@pytest.mark.parametrize("joints", [None, [0, 2, 5]])
def test_a_posture_has_gains_and_feed_forward(joints):
    robot = MujocoRobot.from_arm(sawyer())
    rng = np.random.default_rng(0)
    robot.update(robot.neutral + 0.1)
    m = 7 if joints is None else 3
    task = PostureTask(robot.neutral, joints=joints, gain=3.0, feedforward=rng.normal(size=m), weight=2.0)
    task.feedforward_acceleration, task.kp, task.kd = rng.normal(size=m), np.arange(1.0, m + 1), 5.0
    v = rng.normal(size=7)
    rows = slice(None) if joints is None else joints
    expected = task.feedforward_acceleration + 5.0 * (task.feedforward - v[rows]) - 0.1 * np.arange(1.0, m + 1)
    np.testing.assert_allclose(AccelerationStack([task]).problem(robot, None, v).lower, 2.0 * expected, atol=1e-12)


def test_a_whole_posture_of_a_floating_base():
    robot = every_joint()
    rng = np.random.default_rng(0)
    robot.update(robot.integrate(robot.neutral, rng.normal(size=robot.nv), 0.3))
    v = rng.normal(size=robot.nv)
    problem = AccelerationStack([PostureTask(robot.neutral, gain=2.0)]).problem(robot, None, v)
    np.testing.assert_allclose(problem.lower, -4.0 * v + 4.0 * robot.difference(robot.q, robot.neutral), atol=1e-12)


def test_an_error_decays_critically_damped():
    """(1 + g t) exp(-g t) e_0 from rest, to the discretization error."""
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    p = robot.pose("tool")[1]
    target, gain, dt = p + np.array([0.05, -0.04, 0.03]), 4.0, 2e-4
    stack = AccelerationStack([PositionTask("tool", target, gain=gain), PostureTask(robot.neutral, gain=gain)])
    v, e0, worst = np.zeros(7), target - p, 0.0
    for step in range(int(1.0 / dt)):
        t = step * dt
        expected = (1.0 + gain * t) * np.exp(-gain * t) * e0
        worst = max(worst, float(np.abs(target - robot.pose("tool")[1] - expected).max()))
        v = v + dt * hqp_rp.solve(stack.problem(robot, dt, v), "null_space").require()
        robot.update(robot.integrate(robot.q, v, dt))
    assert worst < 3.0 * gain * dt * np.linalg.norm(e0)


@pytest.mark.parametrize("solver", ["hierarchical_active_set", "saturation_null_space"])
def test_limits_hold_for_thousands_of_steps_into_them(solver):
    """A target beyond the limits; positions, velocities and accelerations in one box that is never empty."""
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    dt, most = 0.002, 20.0
    hand = PositionTask("tool", robot.pose("tool")[1], gain=8.0)
    stack = AccelerationStack([hand, PostureTask(robot.neutral, gain=4.0)], [JointLimit(acceleration=most)])
    chosen, v, rng, touched = hqp_rp.get_solver(solver), np.zeros(7), np.random.default_rng(0), 0
    for step in range(3000):
        if step % 500 == 0:
            hand.target = rng.normal(size=3) * 1.5
        found = chosen.solve(stack.problem(robot, dt, v))
        assert found.status is hqp_rp.Status.SOLVED, (step, found.message)
        assert np.abs(found.x).max() <= most * (1.0 + 1e-9)
        v = v + dt * found.x
        assert (np.abs(v) <= robot.velocity_limit + 1e-9).all()
        robot.update(robot.integrate(robot.q, v, dt))
        assert (robot.q >= robot.lower - 1e-9).all()
        assert (robot.q <= robot.upper + 1e-9).all()
        touched += bool((np.minimum(robot.q - robot.lower, robot.upper - robot.q) < 1e-3).any())
    assert touched > 100


def test_every_limit_bounds_the_velocity_after_the_step():
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    v, dt, rng = 0.1 * np.random.default_rng(0).normal(size=7), 0.01, np.random.default_rng(1)
    limits = [JointLimit(acceleration=5.0), TorqueLimit(60.0), VelocityLimit(1.0)]
    task = PostureTask(robot.neutral)
    on_v = Stack([task], limits).problem(robot, dt, v).hard
    on_a = AccelerationStack([task], limits).problem(robot, dt, v).hard
    np.testing.assert_allclose(on_a.A[7:14], robot.mass_matrix())  # torques in N m
    torque = robot.inverse_dynamics(v, np.zeros(7))
    np.testing.assert_allclose(on_a.upper[7:14], 60.0 - torque)
    lengths = np.ones(21)
    lengths[7:14] = dt
    for _ in range(20):
        a = 5.0 * rng.normal(size=7)
        for bound_v, bound_a, sign in ((on_v.upper, on_a.upper, 1.0), (on_v.lower, on_a.lower, -1.0)):
            room_v, room_a = sign * (bound_v - on_v.A @ (v + dt * a)), sign * (bound_a - on_a.A @ a)
            np.testing.assert_allclose(lengths * room_v, dt * room_a, atol=1e-9)


def test_jerk_is_bounded_too():
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    dt, a, v = 0.002, np.zeros(7), np.zeros(7)
    hand = PositionTask("tool", robot.pose("tool")[1] + [0.3, 0.3, 0.3], gain=10.0)
    stack = AccelerationStack([hand], [JointLimit(acceleration=10.0, jerk=200.0)])
    for _ in range(500):
        found = hqp_rp.solve(stack.problem(robot, dt, v, a), "hierarchical_active_set").require()
        assert np.abs(found - a).max() <= 200.0 * dt * (1.0 + 1e-6)
        a, v = found, v + dt * found
        robot.update(robot.integrate(robot.q, v, dt))


def test_both_libraries_make_the_same_problem():
    one, other = MujocoRobot.from_arm(sawyer()), PinocchioRobot.from_arm(sawyer())
    rng = np.random.default_rng(0)
    q, v = one.neutral + 0.3 * rng.normal(size=7), rng.normal(size=7)
    made = []
    for robot in (one, other):
        robot.update(q)
        levels = list(tasks(np.random.default_rng(1), "tool", "link3", (np.eye(3), np.zeros(3))).values())
        made.append(AccelerationStack(levels, [JointLimit(acceleration=50.0)]).problem(robot, 0.01, v))
    np.testing.assert_allclose(made[0].given, made[1].given, atol=1e-9)
    np.testing.assert_allclose(made[0].given_lower, made[1].given_lower, atol=1e-6)


class Stated:
    """A velocity stated by a class of one's own, with or without its own Jdot v."""

    name = "stated"

    def __init__(self, rate):
        self.rate = rate

    def evaluate(self, robot):
        return robot.jacobian("tool")[:3], self.rate


class Knowing(Stated):
    kd = 7.0

    def bias_acceleration(self, robot, v):
        return robot.bias_acceleration("tool", v)[:3]


def test_a_task_of_ones_own_follows_its_velocity():
    robot = MujocoRobot.from_arm(sawyer())
    rng = np.random.default_rng(0)
    robot.update(robot.neutral + 0.2)
    v, rate, J = rng.normal(size=7), rng.normal(size=3), robot.jacobian("tool")[:3]
    bias = robot.bias_acceleration("tool", v)[:3]
    for task, kd, tolerance in ((Stated(rate), 11.0, 1e-7), (Knowing(rate), 7.0, 1e-12)):
        lower = AccelerationStack([task], kd=11.0).problem(robot, None, v).lower
        np.testing.assert_allclose(lower, kd * (rate - J @ v) - bias, atol=tolerance)
    still = AccelerationStack([Stated(rate)], kd=11.0).problem(robot, None, np.zeros(7)).lower
    np.testing.assert_allclose(still, 11.0 * rate, atol=1e-12)


def test_tasks_of_mink_are_taken():
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral + 0.2)
    task = mink.FrameTask("tool", "site", position_cost=1.0, orientation_cost=0.0, gain=0.5)
    task.set_target(mink.SE3.from_translation(np.array([0.5, 0.1, 0.4])))
    v, dt = 0.3 * np.random.default_rng(0).normal(size=7), 0.01
    J, rate = (lambda p: (p.matrix, p.lower))(Stack([task]).problem(robot, dt))
    h, sides = 1e-5, []
    for s in (h, -h):
        robot.update(robot.integrate(robot.neutral + 0.2, v, s))
        sides.append(Stack([task]).problem(robot, dt).matrix @ v)
    robot.update(robot.neutral + 0.2)
    with pytest.warns(UserWarning, match="swings"):
        lower = AccelerationStack([task]).problem(robot, dt, v).lower
    np.testing.assert_allclose(lower, 20.0 * (rate - J @ v) - (sides[0] - sides[1]) / (2 * h), atol=1e-5)


def test_the_inertia_as_metric_is_dynamically_consistent():
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral + 0.2)
    v = 0.1 * np.ones(7)
    hand = PositionTask("tool", np.array([0.5, 0.1, 0.4]))
    problem = AccelerationStack([hand], metric="inertia").problem(robot, None, v)
    M, J = robot.mass_matrix(), problem.matrix
    expected = np.linalg.solve(M, J.T) @ np.linalg.solve(J @ np.linalg.solve(M, J.T), problem.lower)
    np.testing.assert_allclose(hqp_rp.solve(problem, "operational_space").x, expected, atol=1e-8)


def test_what_is_missing_is_said():
    robot = MujocoRobot.from_arm(sawyer())
    stack = AccelerationStack([PositionTask("tool", np.zeros(3))])
    with pytest.raises(SettingError, match="accelerations need the velocity"):
        stack.problem(robot, 0.01)
    with pytest.raises(SettingError, match="makes no batches"):
        stack.batch(robot, robot.neutral[None])
    with pytest.raises(SettingError, match="kd is 0"):
        AccelerationStack([PositionTask("tool", np.zeros(3))], kd=0.0)
    for bad in (-1.0, [1.0, 2.0], np.nan):
        for name in ("kp", "kd"):
            with pytest.raises(SettingError, match=f"the {name} of"):
                setattr(PositionTask("tool", np.zeros(3)), name, bad)
    with pytest.raises(SettingError, match="feedforward_acceleration"):
        PositionTask("tool", np.zeros(3)).feedforward_acceleration = np.zeros(2)
    chain = random_chain(np.random.default_rng(0))
    with pytest.raises(RobotError, match=r"no method bias_acceleration\(\)"):
        stack.problem(chain, 0.01, np.zeros(chain.nv))


def test_gains_do_not_matter_to_velocities():
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral + 0.1)
    plain, other = (PositionTask("tool", np.zeros(3), gain=2.0) for _ in range(2))
    other.kp, other.kd, other.feedforward_acceleration = 3.0, 4.0, np.ones(3)
    for a, b in zip(plain.evaluate(robot), other.evaluate(robot), strict=True):
        np.testing.assert_array_equal(a, b)


def in_motion(robot, seed=0):
    rng = np.random.default_rng(seed)
    robot.update(robot.integrate(robot.neutral, 0.3 * rng.normal(size=robot.nv), 1.0))
    return 0.3 * rng.normal(size=robot.nv)


AWAY = 0.3 * np.array([0.5, -0.6, 0.62])


@pytest.mark.parametrize(
    ("make", "rows"),
    [
        (lambda R, p: OrientationTask("tool", rotation(AWAY) @ R, gain=4.0), 3),
        (lambda R, p: PoseTask("tool", (rotation(AWAY) @ R, p + 0.1 * AWAY), gain=4.0), 6),
        (lambda R, p: PointingTask("tool", rotation(AWAY) @ R[:, 2], gain=4.0), 2),
        (lambda R, p: CenterOfMassTask(p, axes="z", gain=4.0), 1),
    ],
    ids=["orientation", "pose", "pointing", "centre of mass"],
)
def test_errors_of_other_kinds_decay_so_too(make, rows):
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral + 0.1)
    R, p = robot.pose("tool")
    if rows == 1:
        p = robot.center_of_mass() + 0.05
    task, dt, v = make(R, p), 5e-4, np.zeros(7)
    first = task.error(robot)
    assert np.linalg.norm(first) > 0.03
    stack = AccelerationStack([task, PostureTask(robot.q, gain=4.0)])
    for step in range(1200):
        x = 4.0 * step * dt
        expected = (1.0 + x) * np.exp(-x) * np.linalg.norm(first)
        assert abs(np.linalg.norm(task.error(robot)) - expected) < 12.0 * dt * np.linalg.norm(first)
        v = v + dt * hqp_rp.solve(stack.problem(robot, dt, v), "null_space").require()
        robot.update(robot.integrate(robot.q, v, dt))


def rotation(vector):
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def test_both_libraries_mean_the_same_on_a_free_base():
    """Their v and v-dot differ; what each row has left at the same motion does not."""
    one = every_joint()
    other = PinocchioRobot.from_mujoco(one.model)
    v = in_motion(one)
    other.update(configuration_from_mujoco(one.model, one.q))
    R, a = one.pose("base")[0], np.random.default_rng(1).normal(size=one.nv)
    their_v, their_a = v.copy(), a.copy()
    their_v[:3], their_a[:3] = R.T @ v[:3], R.T @ (a[:3] - np.cross(R @ v[3:6], v[:3]))
    left = []
    for robot, velocity, acceleration in ((one, v, a), (other, their_v, their_a)):
        levels = list(tasks(np.random.default_rng(1), "tool", "wrist", (np.eye(3), np.zeros(3))).values())
        problem = AccelerationStack(levels).problem(robot, None, velocity)
        left.append(problem.matrix @ acceleration - problem.lower)
    np.testing.assert_allclose(*left, atol=1e-9)


def test_the_same_tasks_serve_both_levels():
    robot = MujocoRobot.from_arm(sawyer())
    v = in_motion(robot)
    made = tasks(np.random.default_rng(1), "tool", "link3", robot.pose("link3"))
    levels = list(made.values())
    on_v, on_a = (
        Stack(levels, [JointLimit(acceleration=9.0)]),
        AccelerationStack(levels, [JointLimit(acceleration=9.0)]),
    )

    def both():
        return on_v.problem(robot, 0.01, v), on_a.problem(robot, 0.01, v)

    first = both()
    for again in (both(), both()):
        for before, now in zip(first, again, strict=True):
            np.testing.assert_array_equal(before.given, now.given)
            np.testing.assert_array_equal(before.given_lower, now.given_lower)
    np.testing.assert_array_equal(first[0].given, first[1].given)
    made["position"].gain = 9.0
    alone = AccelerationStack(levels, [JointLimit(acceleration=9.0)]).problem(robot, 0.01, v)
    np.testing.assert_array_equal(both()[1].given_lower, alone.given_lower)
    assert not np.array_equal(alone.given_lower, first[1].given_lower)


def test_what_a_robot_does_not_drive_moves_on():
    """A door that swings by itself is part of Jdot v, and has no acceleration."""
    xml = """<mujoco><worldbody>
      <body name="door" pos="0.6 0.3 0"><joint name="hinge" axis="0 0 1"/><geom size="0.1"/>
        <site name="handle" pos="0 -0.3 0.1"/></body>
      <body><joint name="j1" axis="0 0 1"/><geom size="0.1"/><body pos="0.3 0 0"><joint name="j2" axis="0 1 0"/>
        <geom size="0.1"/><body pos="0.3 0 0"><joint name="j3" axis="0 1 0"/><geom size="0.1"/>
        <site name="tool" pos="0.2 0 0"/></body></body></body></worldbody>
      <actuator><motor joint="j1"/><motor joint="j2"/><motor joint="j3"/></actuator></mujoco>"""
    robot = MujocoRobot(mujoco.MjModel.from_xml_string(xml))
    robot.unactuated_velocity = [0.7]
    rng = np.random.default_rng(0)
    q, v = 0.5 * rng.normal(size=4), rng.normal(size=4)
    moving = v.copy()
    moving[robot.unactuated] = 0.7
    task = RelativePoseTask("tool", "handle", (np.eye(3), np.zeros(3)), gain=3.0)
    h, sides = 1e-5, []
    for s in (h, -h):
        robot.update(robot.integrate(q, moving, s))
        sides.append(missing(task, robot, v))
    robot.update(q)
    expected = -6.0 * missing(task, robot, v) + 9.0 * task.error(robot) - (sides[0] - sides[1]) / (2 * h)
    problem = AccelerationStack([task]).problem(robot, None, v)
    np.testing.assert_allclose(problem.lower, expected, atol=1e-6)
    assert not problem.matrix[:, robot.unactuated].any()


@given(
    seed=st.integers(0, 2**32 - 1),
    dt=st.sampled_from([1e-4, 1e-3, 0.01, 0.1]),
    outside=st.sampled_from([0.0, 1e-12, 0.1]),
    jerk=st.sampled_from([None, 50.0]),
)
@settings(max_examples=200, deadline=None)
def test_the_box_on_accelerations_is_never_empty(seed, dt, outside, jerk):
    """At and beyond every bound: positions on their limits, velocities over theirs, rounding of (bound - v) / dt."""
    rng = np.random.default_rng(seed)
    robot = BOXED
    place = rng.choice([0.0, 0.5, 1.0], size=7)
    robot.update(robot.lower + place * (robot.upper - robot.lower) + outside * rng.choice([-1.0, 0.0, 1.0], size=7))
    v = rng.choice([-1.0, 0.0, 1.0], size=7) * robot.velocity_limit * (1.0 + outside)
    limit = JointLimit(acceleration=10.0, jerk=jerk)
    stack = AccelerationStack([PostureTask(robot.neutral, gain=1.0)], [limit])
    problem = stack.problem(robot, dt, v, rng.normal(size=7))
    assert (problem.hard.lower <= problem.hard.upper).all()
    assert hqp_rp.solve(problem, "hierarchical_active_set").status is hqp_rp.Status.SOLVED


BOXED = MujocoRobot.from_arm(sawyer())


@pytest.mark.parametrize("kd", [0.0, [1.0, 2.0, 3.0]])
def test_a_class_of_ones_own_has_its_own_kd(kd):
    robot = MujocoRobot.from_arm(sawyer())
    v = in_motion(robot)
    task = Knowing(np.ones(3))
    task.kd = kd
    J = robot.jacobian("tool")[:3]
    expected = np.asarray(kd) * (1.0 - J @ v) - robot.bias_acceleration("tool", v)[:3]
    np.testing.assert_allclose(AccelerationStack([task]).problem(robot, 0.01, v).lower, expected, atol=1e-12)


@pytest.mark.parametrize("kd", [-1.0, [1.0, 2.0], np.nan])
def test_a_kd_that_does_not_fit_is_refused(kd):
    robot = MujocoRobot.from_arm(sawyer())
    task = Knowing(np.ones(3))
    task.kd = kd
    with pytest.raises(ProblemError, match=r"level 1: 'stated': kd is .*; it must be finite and >= 0"):
        AccelerationStack([task]).problem(robot, None, np.ones(7))


class Wrong(Stated):
    def bias_acceleration(self, robot, v):
        return np.zeros(2)


class Unable(Stated):
    def bias_acceleration(self, robot, v):
        return None


class Fading(Stated):
    """Its rows are fewer a little further on."""

    def evaluate(self, robot):
        m = 3 if robot.q[0] <= 0.2 else 2
        return robot.jacobian("tool")[:m], self.rate[:m]


class Failing(Stated):
    def evaluate(self, robot):
        if robot.q[0] > 0.2:
            raise ArithmeticError("no answer here")
        return super().evaluate(robot)


def test_a_bias_that_cannot_be_had_is_said_and_the_robot_put_back():
    robot = MujocoRobot.from_arm(sawyer())
    q = np.full(7, 0.2)
    robot.update(q)
    v = np.ones(7)
    cases = [
        (Wrong, ProblemError, "bias_acceleration gives"),
        (Fading, ProblemError, "the number of its rows changes nearby"),
        (Failing, ArithmeticError, "no answer here"),
    ]
    for kind, error, text in cases:
        with pytest.raises(error, match=text):
            AccelerationStack([kind(np.ones(3))]).problem(robot, None, v)
        np.testing.assert_array_equal(robot.q, q)
    stated, unable = (AccelerationStack([kind(np.ones(3))]).problem(robot, None, v).lower for kind in (Stated, Unable))
    np.testing.assert_array_equal(stated, unable)


def test_parts_of_a_subclass_are_differentiated_by_their_own_rows():
    class Doubled(CenterOfMassTask):
        def evaluate(self, robot):
            J, rate = super().evaluate(robot)
            return 2.0 * J, 2.0 * rate

    robot = MujocoRobot.from_arm(sawyer())
    v = in_motion(robot)
    parts, zero = {"bodies": ["link3"], "gain": 0.0}, np.zeros(3)
    found = AccelerationStack([Doubled(zero, **parts)]).problem(robot, None, v)
    bias = robot.part_center_of_mass_bias_acceleration(["link3"], v)
    np.testing.assert_allclose(found.matrix, 2.0 * robot.part_center_of_mass(["link3"])[1], atol=1e-12)
    np.testing.assert_allclose(found.lower, -2.0 * bias, atol=1e-7)


def test_tasks_of_pink_are_taken():
    robot = PinocchioRobot.from_arm(sawyer())
    v = in_motion(robot)
    q, dt, task = robot.q, 0.01, pink.tasks.FrameTask("tool", position_cost=1.0, orientation_cost=0.5, gain=0.1)
    task.set_target(pin.SE3(np.eye(3), np.array([0.5, 0.1, 0.4])))
    J, rate = (lambda p: (p.matrix, p.lower))(Stack([task]).problem(robot, dt))
    h, sides = 1e-5, []
    for s in (h, -h):
        robot.update(robot.integrate(q, v, s))
        sides.append(Stack([task]).problem(robot, dt).matrix @ v)
    robot.update(q)
    lower = AccelerationStack([task], kd=40.0).problem(robot, dt, v).lower
    np.testing.assert_allclose(lower, 40.0 * (rate - J @ v) - (sides[0] - sides[1]) / (2 * h), atol=1e-5)


def after(kp, kd, dt, steps=4000):
    """|e| at last of e'' = -kd e' - kp e in steps v + dt v-dot, e + dt v, from (1, 0)."""
    e, v = 1.0, 0.0
    for _ in range(steps):
        v -= dt * (kd * v + kp * e)
        e += dt * v
        if abs(e) > 1e6:
            break
    return abs(e)


@pytest.mark.parametrize("dt", [0.002, 0.02])
def test_gains_that_are_too_quick_for_the_step_are_said(dt):
    robot = MujocoRobot.from_arm(sawyer())
    task = PositionTask("tool", np.zeros(3))
    for x, told in ((0.49, False), (0.51, True), (0.82, True), (0.84, True)):
        task.gain = x / dt
        assert (after((x / dt) ** 2, 2.0 * x / dt, dt) > 1.0) == (x > 2.0 * np.sqrt(2.0) - 2.0)
        quiet = pytest.warns(UserWarning, match="past what it aims at") if told else contextlib.nullcontext()
        with quiet:
            AccelerationStack([task]).problem(robot, dt, np.zeros(7))
    task.gain, task.kd, task.kp = 0.1, 0.0, 4.1 / dt**2
    assert after(task.kp, 0.0, dt) > 1e6
    with pytest.warns(UserWarning, match=r"level 1: 'tool position' has kp .* and kd 0 1/s at dt"):
        AccelerationStack([task]).problem(robot, dt, np.zeros(7))
    twist = TwistTask("tool", kd=1.1 / dt)
    with pytest.warns(UserWarning, match="'tool twist' has kp 0 1/s"):
        AccelerationStack([twist]).problem(robot, dt, np.zeros(7))


def test_loops_that_send_velocities_take_no_accelerations():
    stack = AccelerationStack([PostureTask(np.zeros(7))])
    with pytest.raises(SettingError, match="stack is a AccelerationStack; give a Stack: what is sent are velocities"):
        MotionRunner(stack, "null_space", acceleration=1.0)
