"""Stacks on accelerations: second-order rows of every task, limits that stay feasible, what a task of one's own needs."""

import copy

import mink
import numpy as np
import pytest

import hqp_rp
from hqp_rp.control import (
    AccelerationStack,
    CenterOfMassTask,
    JointLimit,
    LookAtTask,
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
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.robot import MujocoRobot, PinocchioRobot, sawyer
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
        "centre of mass of parts": CenterOfMassTask(vector[7], bodies=[other], feedforward=vector[8]),
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
    for _ in range(20):
        a = 5.0 * rng.normal(size=7)
        for bound_v, bound_a, sign in ((on_v.upper, on_a.upper, 1.0), (on_v.lower, on_a.lower, -1.0)):
            room_v, room_a = sign * (bound_v - on_v.A @ (v + dt * a)), sign * (bound_a - on_a.A @ a)
            np.testing.assert_allclose(room_v, dt * room_a, atol=1e-9)


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
