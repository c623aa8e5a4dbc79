"""The stack: what it puts into the problem, what it refuses, and that priorities come out strict."""

import numpy as np
import pytest

import hqp_rp
from hqp_rp.control import (
    JointLimit,
    OrientationTask,
    PositionTask,
    PostureTask,
    RelativePoseTask,
    Stack,
    TwistTask,
    VelocityLimit,
)
from hqp_rp.core.errors import ProblemError, RobotError, SettingError
from tests.control.chain import random_chain


@pytest.fixture
def robot():
    return random_chain(np.random.default_rng(0))


def tasks(robot):
    return (
        PositionTask("tool", robot.pose("tool")[1] + 0.1, gain=2.0),
        OrientationTask("tool", np.eye(3), axes=("rx", "rz")),
        PostureTask(robot.neutral),
    )


class Rows:
    """A task and limit of a user: whatever arrays it is told to give."""

    name = "rows of mine"

    def __init__(self, *arrays):
        self.arrays = arrays


class MyTask(Rows):
    def evaluate(self, robot):
        return self.arrays


class MyLimit(Rows):
    def rows(self, robot, dt, v):
        return self.arrays


def test_levels_in_order(robot):
    position, orientation, posture = tasks(robot)
    problem = Stack([position, [orientation, posture]]).problem(robot)
    assert problem.names == ("tool position", "tool orientation + posture")
    np.testing.assert_array_equal(problem.offsets, [0, 3, 12])
    assert problem.is_equality
    assert problem.hard is None
    for rows, task in ((slice(0, 3), position), (slice(3, 5), orientation), (slice(5, 12), posture)):
        J, rate = task.evaluate(robot)
        np.testing.assert_array_equal(problem.matrix[rows], J)
        np.testing.assert_array_equal(problem.lower[rows], rate)
    # The same problem as through the checked constructor.
    checked = hqp_rp.Problem.from_stacked(problem.matrix, problem.lower, problem.upper, problem.offsets)
    np.testing.assert_array_equal(checked.matrix, problem.matrix)


def test_hard_and_soft_limits(robot):
    position, orientation, posture = tasks(robot)
    limit, speed = JointLimit(gain=0.5), VelocityLimit(0.7)
    problem = Stack([position, [limit, orientation], posture], limits=[speed, posture]).problem(robot, 0.01)
    assert problem.names[1] == "joint limits + tool orientation"
    np.testing.assert_array_equal(problem.offsets, [0, 3, 12, 19])
    G, low, high = limit.rows(robot, 0.01, None)
    np.testing.assert_array_equal(problem.levels[1].A[:7], G)
    np.testing.assert_array_equal(problem.levels[1].lower[:7], low)
    np.testing.assert_array_equal(problem.levels[1].upper[:7], high)
    np.testing.assert_array_equal(problem.levels[1].lower[7:], problem.levels[1].upper[7:])
    assert not problem.is_equality
    np.testing.assert_array_equal(problem.hard.A, np.vstack([np.eye(7), np.eye(7)]))
    np.testing.assert_array_equal(problem.hard.upper[:7], 0.7)
    np.testing.assert_array_equal(problem.hard.lower[7:], posture.evaluate(robot)[1])  # a hard equality
    np.testing.assert_array_equal(problem.hard.upper[7:], problem.hard.lower[7:])


def test_a_problem_stays_as_it_is_when_the_robot_moves_on(robot):
    stack = Stack(list(tasks(robot)), limits=[JointLimit()])
    problem = stack.problem(robot, 0.01)
    kept = problem.matrix.copy(), problem.lower.copy(), problem.hard.upper.copy()
    robot.update(robot.q + 0.3)
    later = stack.problem(robot, 0.01)
    for array, copy in zip((problem.matrix, problem.lower, problem.hard.upper), kept, strict=True):
        np.testing.assert_array_equal(array, copy)
        assert not array.flags.writeable
    assert np.abs(later.matrix[:3] - problem.matrix[:3]).max() > 0.01
    assert later.matrix.flags.c_contiguous


def test_the_velocity_before_reaches_the_limits(robot):
    v = np.linspace(-0.5, 0.5, 7)
    stack = Stack([PostureTask(robot.neutral)], limits=[JointLimit(position=False, acceleration=2.0)])
    problem = stack.problem(robot, 0.1, v.tolist())
    np.testing.assert_allclose(problem.hard.lower, v - 0.2)
    np.testing.assert_allclose(problem.hard.upper, v + 0.2)


def test_row_counts_may_change_between_steps(robot):
    changing = MyTask(np.eye(7)[:2], np.zeros(2))
    stack = Stack([changing, PostureTask(robot.neutral)])
    np.testing.assert_array_equal(stack.problem(robot).offsets, [0, 2, 9])
    changing.arrays = np.zeros((0, 7)), np.zeros(0)
    np.testing.assert_array_equal(stack.problem(robot).offsets, [0, 0, 7])
    changing.arrays = np.asfortranarray(np.arange(21, dtype=np.int64).reshape(3, 7)), np.arange(3)
    problem = stack.problem(robot)
    np.testing.assert_array_equal(problem.offsets, [0, 3, 10])
    assert problem.matrix.flags.c_contiguous
    assert problem.matrix.dtype == problem.lower.dtype == np.float64


def test_one_stack_for_several_robots():
    rng = np.random.default_rng(1)
    first, second = random_chain(rng, 7), random_chain(rng, 5)
    stack = Stack([PositionTask("tool", np.zeros(3))], limits=[VelocityLimit()])
    for robot in (first, second, first):
        problem = stack.problem(robot, 0.1)
        np.testing.assert_array_equal(problem.matrix, robot.jacobian("tool")[:3])
        assert problem.hard.n == robot.nv


def test_huge_rows_are_no_error(robot):
    """The quick test for nan overflows here; the rows are finite all the same."""
    stack = Stack(
        [MyTask(np.full((1, 7), 1e200), np.array([1e200])), MyLimit(np.eye(7), np.full(7, -1e300), np.full(7, np.inf))]
    )
    assert stack.problem(robot, 0.1).matrix[0, 0] == 1e200


def test_strict_priorities(robot):
    """Along a whole motion the upper level is met to rounding while the lower one conflicts with it."""
    position, _, posture = tasks(robot)
    stack, dt = Stack([position, posture]), 0.01
    for _ in range(600):
        solution = hqp_rp.solve(stack.problem(robot), "null_space")
        assert solution.status.ok
        J, rate = position.evaluate(robot)
        np.testing.assert_allclose(J @ solution.x, rate, atol=1e-12)
        robot.update(robot.integrate(robot.q, solution.x, dt))
    np.testing.assert_allclose(position.error(robot), 0.0, atol=1e-4)  # what explicit Euler steps leave
    assert np.linalg.norm(posture.error(robot)) > 0.1
    # Nearly at rest: the posture has moved as far as the position lets it.
    assert np.linalg.norm(solution.x) < 0.1 * np.linalg.norm(posture.error(robot))


MISUSE = [
    (lambda task: Stack([]), "give a list with at least one level"),
    (lambda task: Stack(task), "give a list with at least one level"),
    (lambda task: Stack([task, []]), "level 2 is empty; give it at least one task"),
    (
        lambda task: Stack([task, "posture"]),
        "level 2 holds 'posture', which is neither a Task, a Limit, or a task or limit",
    ),
    (lambda task: Stack([[task, 3]]), "level 1 holds 3, which is neither"),
    (lambda task: Stack([PositionTask]), "level 1 holds the class PositionTask"),
    (lambda task: Stack([task], limits=[None]), "limits holds None, which is neither"),
    (lambda task: Stack([task], limits=VelocityLimit()), "give a list of limits, empty for none"),
    (lambda task: Stack([task], names=["a", "b"]), "give one name for each of the 1 levels"),
    (lambda task: Stack([task], names="a"), "give one name for each of the 1 levels"),
]


@pytest.mark.parametrize(("build", "message"), MISUSE, ids=[message for _, message in MISUSE])
def test_bad_stacks(build, message):
    with pytest.raises(SettingError, match=message):
        build(PositionTask("tool", np.zeros(3)))


@pytest.mark.parametrize("dt", [0.0, -0.1, float("nan"), float("inf"), "fast", True])
def test_bad_time_steps(robot, dt):
    with pytest.raises(SettingError, match=r"dt is .*; it must be a finite number > 0"):
        Stack([PositionTask("tool", np.zeros(3))]).problem(robot, dt)


def test_a_missing_time_step(robot):
    with pytest.raises(SettingError, match=r"limits, or tasks of mink or pink; they need the time step"):
        Stack([PositionTask("tool", np.zeros(3))], limits=[VelocityLimit()]).problem(robot)


@pytest.mark.parametrize("kind", [np.float64, np.float32, int, object, np.longdouble, list, np.ma.masked_array])
def test_a_velocity_may_come_in_every_kind_of_array(robot, kind):
    v = kind(np.arange(7)) if kind in (list, np.ma.masked_array) else np.arange(7).astype(kind)
    stack = Stack([PositionTask("tool", np.zeros(3))], [JointLimit(acceleration=1.0)])
    found, meant = (stack.problem(robot, 0.1, given) for given in (v, np.arange(7.0)))
    np.testing.assert_array_equal(found.hard.lower, meant.hard.lower)


@pytest.mark.parametrize("v", [np.zeros(6), [np.nan] * 7, "fast", np.zeros(7, complex), np.zeros((7, 1)), [[1.0], 2.0]])
def test_bad_velocities(robot, v):
    with pytest.raises(SettingError, match=r"v is .*; it must be 7 (finite )?numbers in rad/s or m/s"):
        Stack([PositionTask("tool", np.zeros(3))]).problem(robot, 0.1, v)


def test_unknown_frames(robot):
    with pytest.raises(
        RobotError, match=r"level 2: 'tol position': There is no frame named 'tol'. Did you mean 'tool'\?"
    ):
        Stack([PostureTask(robot.neutral), PositionTask("tol", np.zeros(3))]).problem(robot)
    with pytest.raises(RobotError, match=r"level 1: .* no frame named 'hand'"):
        Stack([PositionTask("tool", np.zeros(3), expressed_in="hand")]).problem(robot)
    with pytest.raises(RobotError, match=r"limits: .* no frame named 'hand'"):
        Stack([PostureTask(robot.neutral)], limits=[TwistTask("hand")]).problem(robot)
    with pytest.raises(RobotError, match=r"no frame named 'elbow'"):
        Stack([RelativePoseTask("tool", "elbow", (np.eye(3), np.zeros(3)))]).problem(robot)


def test_unknown_frames_of_a_real_robot():
    from hqp_rp.robot import MujocoRobot, planar_arm

    robot = MujocoRobot.from_arm(planar_arm(3))
    with pytest.raises(RobotError, match=r"level 1: 'hand position': .*'hand'"):
        Stack([PositionTask("hand", np.zeros(3))]).problem(robot)


def test_not_a_robot():
    with pytest.raises(RobotError, match=r"robot is a str; give a robot with the methods of"):
        Stack([PositionTask("tool", np.zeros(3))]).problem("sawyer")


ROWS = [
    (MyTask(np.eye(6), np.zeros(6)), r"gives a matrix \(6, 6\) and bounds \(6,\); .* matrix \(m, 7\) and m bounds"),
    (MyTask(np.eye(7), np.zeros(3)), r"a matrix \(7, 7\) and bounds \(3,\)"),
    (MyTask(np.eye(7)[0], np.zeros(1)), r"a matrix \(7,\) and bounds \(1,\)"),
    (MyTask(np.full((1, 7), np.nan), np.zeros(1)), r"matrix\[0, 0\] is nan; every entry must be finite"),
    (MyTask(np.eye(7)[:1], np.array([np.inf])), r"rate\[0\] is inf; every entry must be finite"),
    (MyLimit(np.eye(7), np.zeros(7), np.zeros(6)), r"bounds \(7,\) and \(6,\)"),
    (MyLimit(np.eye(7), np.ones(7), np.zeros(7)), r"lower\[0\] is 1.0, upper\[0\] is 0.0; every bound"),
    (MyLimit(np.eye(7), np.full(7, np.nan), np.zeros(7)), r"lower\[0\] is nan"),
    (MyLimit(np.eye(7), np.full(7, np.inf), np.full(7, np.inf)), r"lower\[0\] is inf"),
    (MyLimit(np.full((7, 7), np.inf), np.zeros(7), np.zeros(7)), r"matrix\[0, 0\] is inf"),
    (MyTask([[0.0] * 7], [0.0, 1.0]), r"a matrix \(1, 7\) and bounds \(2,\)"),
    (MyTask(np.full((1, 7), 1j), np.zeros(1)), "it must hold real numbers"),
]


@pytest.mark.parametrize(("item", "message"), ROWS, ids=[message for _, message in ROWS])
@pytest.mark.parametrize("hard", [False, True])
def test_rows_that_do_not_fit(robot, item, message, hard):
    posture = PostureTask(robot.neutral)
    stack = Stack([posture], limits=[item]) if hard else Stack([posture, item])
    where = "limits" if hard else "level 2"
    with pytest.raises(ProblemError, match=f"{where}: 'rows of mine'.*{message}"):
        stack.problem(robot, 0.1)


def test_a_step_that_cannot_be_meant_is_said_once():
    robot = random_chain(np.random.default_rng(1))
    stack = Stack([PositionTask("tool", np.zeros(3), gain=20.0), PostureTask(robot.q)], [JointLimit()])
    with pytest.warns(UserWarning, match=r"dt is 500 s: .* A rate of 500 Hz is dt = 0.002"):
        stack.problem(robot, 500)
    with pytest.warns(
        UserWarning, match=r"level 1: 'tool position' has gain 20 1/s at dt 0.1 s: each step goes 2 times the way"
    ):
        stack.problem(robot, 0.1)
    stack.problem(robot, 0.1)
    stack.problem(robot, 0.05)
