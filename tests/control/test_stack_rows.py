"""Rows made by compiled code: every kind of task, alone and together, on every kind of robot, whatever is set in between."""

import copy
import pickle

import numpy as np
import pytest

from hqp_rp.control import (
    CenterOfMassTask,
    ForceReference,
    JointLimit,
    OrientationTask,
    PointingTask,
    PoseTask,
    PositionTask,
    PostureTask,
    RelativePoseTask,
    Stack,
    TwistTask,
)
from hqp_rp.control._coordinates import plain_coordinates
from hqp_rp.control._rotations import rotation_log, skew
from hqp_rp.core.errors import ProblemError, RobotError, SettingError
from hqp_rp.core.problem import Problem
from hqp_rp.robot import MujocoRobot, PinocchioRobot, sawyer
from hqp_rp.robot.named import named_robot
from tests.control.chain import expm_so3, random_chain, random_rotation

ROBOTS = {
    "chain": lambda: random_chain(np.random.default_rng(0)),
    "mujoco": lambda: MujocoRobot.from_arm(sawyer()),
    "pinocchio": lambda: PinocchioRobot.from_arm(sawyer()),
    "humanoid": lambda: named_robot("humanoid"),
}


def moved(robot, rng):
    robot.update(robot.integrate(robot.neutral, 0.3 * rng.normal(size=robot.nv), 1.0))


def frames(robot):
    return ("left_grip", "right_grip") if robot.nv > 7 else ("tool", "link3")


def every_task(robot, rng):
    """One task of each kind, none of them in its simplest form."""
    tip, other = frames(robot)
    R, p = random_rotation(rng), rng.normal(size=3)
    six = rng.normal(size=6)
    return [
        PositionTask(tip, p, axes="zx", expressed_in=other, gain=[2.0, 0.5], feedforward=six[:3], weight=3.0),
        OrientationTask(tip, R, expressed_in=tip, gain=1.5, feedforward=six[3:], weight=[1.0, 2.0, 0.5]),
        PoseTask(tip, (R, p), axes=("ry", "x", "rz"), gain=0.7, feedforward=six),
        TwistTask(other, six[:2], axes=("rx", "y"), expressed_in=tip, weight=0.3),
        RelativePoseTask(tip, other, (R, p), axes=("y", "rz", "x"), gain=1.2, feedforward=six, weight=2.0),
        PointingTask(other, p, axis=six[:3], gain=[0.4, 0.6], feedforward=six[3:], weight=1.7),
        PostureTask(robot.neutral, joints=[robot.nv - 1, robot.nv - 4], gain=[1.0, 2.0], feedforward=[0.1, -0.2]),
    ]


def by_formula(task, robot):
    """Rows from the formulas in the docstrings, with numpy and the robot's own calls."""

    def frame(name):
        return (*robot.pose(name), robot.jacobian(name))

    if isinstance(task, PostureTask):
        rows = list(task.joints)
        J, e, feed = np.eye(robot.nv)[rows], robot.difference(robot.q, task.target)[rows], task.feedforward
    elif isinstance(task, CenterOfMassTask):
        rows = ["xyz".index(axis) for axis in task.axes]
        J, e, feed = (
            robot.center_of_mass_jacobian()[rows],
            (task.target - robot.center_of_mass())[rows],
            task.feedforward[rows],
        )
    elif isinstance(task, PointingTask):
        R, _, J_w = frame(task.frames[0])
        B = R @ task._basis
        cross = np.cross(B[:, 2], task.direction)
        angle = np.arctan2(np.linalg.norm(cross), B[:, 2] @ task.direction)
        J, e = B[:, :2].T @ J_w[3:], B[:, :2].T @ cross * angle / np.linalg.norm(cross)
        feed = B[:, :2].T @ task.feedforward
    elif isinstance(task, RelativePoseTask):
        (R_b, p_b, J_b), (R_a, p_a, J_a) = (frame(name) for name in task.frames)
        R, p = task.target
        e = np.concatenate([p - R_a.T @ (p_b - p_a), rotation_log(R @ (R_a.T @ R_b).T)])
        J = np.vstack([R_a.T @ (J_b[:3] - J_a[:3] + skew(p_b - p_a) @ J_a[3:]), R_a.T @ (J_b[3:] - J_a[3:])])
        feed = task.feedforward
    elif isinstance(task, TwistTask):
        J_w = robot.jacobian(task.frames[0])
        R_f = robot.pose(task.frames[1])[0]
        J = np.vstack([R_f.T @ J_w[:3], R_f.T @ J_w[3:]])
        rows = [("x", "y", "z", "rx", "ry", "rz").index(axis) for axis in task.axes]
        w = np.broadcast_to(task._weight, len(rows))
        return w[:, None] * J[rows], w * task.velocity
    else:
        R, p, J_w = frame(task.frame)
        turned = task.expressed_in != "world"
        R_f, _, J_f = frame(task.expressed_in) if turned else (np.eye(3), None, np.zeros_like(J_w))
        target = task.target
        R_star, p_star = target if isinstance(task, PoseTask) else (target, target)
        parts = []
        if not isinstance(task, OrientationTask):
            e_p = R_f.T @ (p_star - p)
            parts.append((R_f.T @ J_w[:3] - skew(e_p) @ R_f.T @ J_f[3:], e_p))
        if not isinstance(task, PositionTask):
            parts.append((R_f.T @ J_w[3:], R_f.T @ rotation_log(R_star @ R.T)))
        J, e = np.vstack([J for J, _ in parts]), np.concatenate([e for _, e in parts])
        feed = np.concatenate([R_f.T @ half for half in task.feedforward.reshape(-1, 3)])
    if not isinstance(task, PostureTask | CenterOfMassTask | PointingTask):
        valid = ("x", "y", "z", "rx", "ry", "rz")[3 * isinstance(task, OrientationTask) :]
        rows = [valid.index(axis) for axis in task.axes]
        J, e, feed = J[rows], e[rows], feed[rows]
    w = np.broadcast_to(task.weight, len(e))
    return w[:, None] * J, w * (task.gain * e + feed)


@pytest.mark.parametrize("kind", ROBOTS)
def test_every_task_by_its_formula_alone_and_in_a_stack(kind):
    robot, rng = ROBOTS[kind](), np.random.default_rng(1)
    tasks = [*every_task(robot, rng), CenterOfMassTask(rng.normal(size=3), axes="zy", feedforward=rng.normal(size=3))]
    stack = Stack([tasks[0], [*tasks[1:5]], [*tasks[5:]]])
    for _ in range(3):
        moved(robot, rng)
        problem = stack.problem(robot)
        end = 0
        for task in tasks:
            J, rate = task.evaluate(robot)
            rows = slice(end, end + len(rate))
            end += len(rate)
            np.testing.assert_array_equal(problem.matrix[rows], J, err_msg=repr(task))
            np.testing.assert_array_equal(problem.lower[rows], rate, err_msg=repr(task))
            expected = by_formula(task, robot)
            np.testing.assert_allclose(J, expected[0], atol=2e-14, err_msg=repr(task))
            np.testing.assert_allclose(rate, expected[1], atol=2e-14, err_msg=repr(task))
        assert end == len(problem.matrix)


def test_what_is_set_takes_effect_at_the_next_step():
    robot, rng = ROBOTS["mujoco"](), np.random.default_rng(2)
    tasks = every_task(robot, rng)
    stack = Stack([tasks])
    held = stack.problem(robot)
    kept = held.lower.copy()
    R, p = random_rotation(rng), rng.normal(size=3)
    changes = [
        (tasks[0], "target", p), (tasks[0], "gain", 0.1), (tasks[0], "feedforward", None), (tasks[0], "weight", 7.0),
        (tasks[1], "target", R), (tasks[2], "target", (R, p)), (tasks[3], "velocity", [0.5, 0.6]),
        (tasks[4], "target", (R, p)), (tasks[4], "feedforward", p.repeat(2)), (tasks[5], "direction", p),
        (tasks[5], "feedforward", p), (tasks[6], "target", robot.neutral + 0.1), (tasks[6], "feedforward", [0.3, 0.4]),
        (tasks[6], "gain", [0.5, 0.25]),
    ]  # fmt: skip
    for task, name, value in changes:
        before = stack.problem(robot)
        setattr(task, name, value)
        after = stack.problem(robot)
        assert not np.array_equal(before.lower, after.lower), (task, name)
        fresh = Stack([tasks]).problem(robot)
        np.testing.assert_array_equal(after.lower, fresh.lower)
        np.testing.assert_array_equal(after.matrix, fresh.matrix)
    np.testing.assert_array_equal(held.lower, kept)


def test_one_task_in_several_stacks_on_several_robots():
    first, second = random_chain(np.random.default_rng(3)), random_chain(np.random.default_rng(4), 5)
    position = PositionTask("tool", np.zeros(3))
    one, two = Stack([position]), Stack([[position, TwistTask("tool")]])
    for gain in (1.0, 2.0, 3.0):
        position.gain = gain
        for stack in (one, two):
            for robot in (first, second):
                expected = -gain * robot.pose("tool")[1]
                np.testing.assert_allclose(stack.problem(robot).lower[:3], expected, atol=1e-15)


def test_a_copy_works_on_its_own_robot():
    """What a stack reads its frames from belongs to one robot's state: a copy must not read the old one's."""
    robot = ROBOTS["mujoco"]()
    task = PositionTask("tool", np.zeros(3))
    stack = Stack([task, PostureTask(robot.neutral)], limits=[JointLimit()])
    stack.problem(robot, 0.01)
    task.evaluate(robot)
    for other_robot, other_stack in (copy.deepcopy((robot, stack)), pickle.loads(pickle.dumps((robot, stack)))):
        other_robot.update(robot.neutral + 0.2)
        found = other_stack.problem(other_robot, 0.01)
        np.testing.assert_allclose(found.lower[:3], -other_robot.pose("tool")[1], atol=1e-15)
        own = other_stack.levels[0][0]
        np.testing.assert_allclose(own.evaluate(other_robot)[1], -other_robot.pose("tool")[1], atol=1e-15)
        np.testing.assert_array_equal(robot.q, robot.neutral)


class Halved(PositionTask):
    """A user's own idea of a task, on top of ours."""

    def evaluate(self, robot):
        J, rate = super().evaluate(robot)
        return J, 0.5 * rate


def test_an_evaluate_of_ones_own_is_called():
    robot = ROBOTS["mujoco"]()
    plain, halved = PositionTask("tool", np.zeros(3)), Halved("tool", np.zeros(3))
    problem = Stack([halved, plain]).problem(robot)
    np.testing.assert_array_equal(problem.lower[:3], 0.5 * problem.lower[3:])
    np.testing.assert_array_equal(halved.error(robot), plain.error(robot))


def test_a_reference_is_compiled_with_the_rest():
    robot = ROBOTS["mujoco"]()
    reference = ForceReference("tool", 1.0, 10.0, axes="z")
    reference.start(robot, np.full(7, 0.1))
    J, rate = reference.evaluate(robot)
    problem = Stack([reference, PostureTask(robot.neutral)]).problem(robot)
    np.testing.assert_array_equal(problem.matrix[:1], J)
    np.testing.assert_array_equal(problem.lower[:1], rate)
    assert rate[0] != 0.0


def test_a_robot_without_numbers_is_refused_by_the_task_that_shows_it():
    robot = random_chain(np.random.default_rng(5))
    stack = Stack([PostureTask(robot.neutral), OrientationTask("tool", np.eye(3))])
    stack.problem(robot)
    robot._poses["tool"] = (np.full((3, 3), np.nan), *robot._poses["tool"][1:])
    with pytest.raises(ProblemError, match=r"level 2: 'tool orientation': rate\[0\] is nan"):
        stack.problem(robot)


@pytest.mark.parametrize("kind", ROBOTS)
def test_a_batch_is_the_problems_one_by_one(kind):
    robot, rng = ROBOTS[kind](), np.random.default_rng(6)
    tasks = every_task(robot, rng)
    stack = Stack([tasks[:3], tasks[3:]])
    q = np.array([robot.integrate(robot.neutral, 0.5 * rng.normal(size=robot.nv), 1.0) for _ in range(19)])
    before = robot.q.copy()
    for threads in (1, 3):
        A, lower, upper, offsets = stack.batch(robot, q, threads=threads)
        assert upper is None
        np.testing.assert_array_equal(robot.q, before)
        for i, configuration in enumerate(q):
            robot.update(configuration)
            problem = stack.problem(robot)
            np.testing.assert_array_equal(offsets, problem.offsets)
            np.testing.assert_allclose(A[i], problem.matrix, atol=2e-14)
            np.testing.assert_allclose(lower[i], problem.lower, atol=2e-14)
        robot.update(before)


def test_a_batch_in_several_threads_is_the_same():
    robot, rng = ROBOTS["mujoco"](), np.random.default_rng(7)
    stack = Stack([every_task(robot, rng)])
    q = rng.uniform(-2.0, 2.0, (4100, 7))
    alone, several = (stack.batch(robot, q, threads=threads) for threads in (1, 3))
    for one, other in ((alone[0], several[0]), (alone[1], several[1])):
        np.testing.assert_array_equal(one, other)


def test_a_batch_with_a_soft_limit_has_two_sides():
    robot = ROBOTS["mujoco"]()
    stack = Stack([JointLimit(), PositionTask("tool", np.zeros(3))])
    q = robot.neutral + np.linspace(-0.3, 0.3, 21).reshape(3, 7)
    A, lower, upper, _ = stack.batch(robot, q, 0.1)
    for i, configuration in enumerate(q):
        robot.update(configuration)
        problem = stack.problem(robot, 0.1)
        for found, expected in ((A, problem.matrix), (lower, problem.lower), (upper, problem.upper)):
            np.testing.assert_array_equal(found[i], expected)


class Growing:
    """A task with one row more at every step."""

    name = "growing"

    def __init__(self):
        self.rows = 0

    def evaluate(self, robot):
        self.rows += 1
        return np.eye(7)[: self.rows], np.zeros(self.rows)


def test_misuse_of_a_batch():
    robot = ROBOTS["mujoco"]()
    posture = PostureTask(robot.neutral)
    q = np.tile(robot.neutral, (3, 1))
    with pytest.raises(SettingError, match="has hard limits, which a batch cannot hold; list them as a level"):
        Stack([posture], limits=[JointLimit()]).batch(robot, q, 0.1)
    with pytest.raises(RobotError, match=r"q has shape \(7,\); it must be \(N, 7\)"):
        Stack([posture]).batch(robot, robot.neutral)
    q[1, 4] = np.inf
    with pytest.raises(RobotError, match=r"q\[1, 4\] is inf"):
        Stack([posture]).batch(robot, q)
    with pytest.raises(ProblemError, match=r"At q\[1\] the levels end at rows \[2, 9\], at q\[0\] at \[1, 8\]"):
        Stack([Growing(), posture]).batch(robot, np.tile(robot.neutral, (2, 1)))


def test_large_turns_are_measured_the_short_way():
    robot = ROBOTS["mujoco"]()
    R = robot.pose("tool")[0]
    for angle in (1e-12, 1e-6, 1.0, 3.0, 3.1415):
        axis = np.array([2.0, -1.0, 0.5]) / np.sqrt(5.25)
        found = OrientationTask("tool", expm_so3(angle * axis) @ R).error(robot)
        np.testing.assert_allclose(found, angle * axis, rtol=1e-9, atol=1e-15)


def humanoid_by_pinocchio():
    return PinocchioRobot.from_mujoco(named_robot("humanoid").model)


@pytest.mark.filterwarnings("ignore:the target of .* are these degrees")
@pytest.mark.parametrize(
    ("make", "floating"),
    [(ROBOTS["humanoid"], True), (humanoid_by_pinocchio, True), (ROBOTS["mujoco"], False)],
    ids=["humanoid", "humanoid by Pinocchio", "arm"],
)
def test_joints_of_a_floating_robot_are_subtracted_plainly(make, floating):
    """Rows of hinges need no call of the robot, however far the target; those of a free joint's turn still do."""
    robot, rng = make(), np.random.default_rng(8)
    target = robot.integrate(robot.neutral, 4.0 * rng.normal(size=robot.nv), 1.0)
    last, some = range(6 if floating else 0, robot.nv), range(0, robot.nv, 2)
    stack = Stack([PostureTask(target, joints=last), PostureTask(target, joints=some)])
    stack.problem(robot)
    moved(robot, rng)
    calls, difference = [], robot.difference
    robot.difference = lambda a, b: calls.append(1) or difference(a, b)
    problem = stack.problem(robot)
    assert len(calls) == floating
    np.testing.assert_allclose(problem.lower, difference(robot.q, target)[[*last, *some]], rtol=0.0, atol=4e-15)
    np.testing.assert_array_equal(problem.matrix, np.eye(robot.nv)[[*last, *some]])


def test_plain_coordinates_are_those_that_the_robot_itself_subtracts():
    humanoid, same, arm = named_robot("humanoid"), humanoid_by_pinocchio(), ROBOTS["mujoco"]()
    n = humanoid.nv
    # MuJoCo's free joint moves along world axes, Pinocchio's along the body's.
    assert plain_coordinates(humanoid).tolist() == [0, 1, 2, -1, -1, -1, *range(7, n + 1)]
    assert plain_coordinates(same).tolist() == [-1] * 6 + list(range(7, n + 1))
    assert plain_coordinates(arm).tolist() == list(range(7))
    difference = humanoid.difference
    # A robot that takes its last joint the short way round.
    humanoid.difference = lambda a, b: np.append(
        difference(a, b)[:-1], np.remainder(difference(a, b)[-1] + np.pi, 2.0 * np.pi) - np.pi
    )
    assert plain_coordinates(humanoid)[-2:].tolist() == [n - 1, -1]


@pytest.mark.parametrize("soft", [False, True])
def test_hard_rows_stand_on_top_for_solvers_that_take_them_so(soft):
    robot = ROBOTS["mujoco"]()
    levels = [JointLimit()] if soft else []
    stack = Stack(
        [*levels, PositionTask("tool", np.zeros(3)), PostureTask(robot.neutral)], limits=[JointLimit(), Growing()]
    )
    for step in range(1, 3):
        problem = stack.problem(robot, 0.1)
        assert problem.hard.m == 7 + step  # the last limit grows by a row at each step
        whole, plain = problem.with_hard, Problem(problem.levels, problem.hard).with_hard
        for found, expected in zip(whole, plain, strict=True):
            np.testing.assert_array_equal(found, expected)
        assert whole.matrix.flags.writeable
        for array in (problem.matrix, problem.lower, problem.hard.A, problem.hard.lower, problem.hard.upper):
            assert not array.flags.writeable
        assert problem.is_equality is not soft
        alone = Stack([*levels, *(item for (item,) in stack.levels if item not in levels)]).problem(robot, 0.1)
        np.testing.assert_array_equal(problem.matrix, alone.matrix)
        np.testing.assert_array_equal(problem.lower, alone.lower)
        np.testing.assert_array_equal(problem.upper, alone.upper)
