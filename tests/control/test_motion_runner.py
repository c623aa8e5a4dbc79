"""The loop without force: the solver's answer while there is one, and a straight stop when there is none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hqp_rp
from hqp_rp import Level, Problem, SettingError, Solution, Solver, Status, UnknownNameError
from hqp_rp.control import JointLimit, MotionRunner, PositionTask, PostureTask, Stack, TwistTask, VelocityLimit
from hqp_rp.control.command import Mode, fault_of
from hqp_rp.robot import MujocoRobot, sawyer

DT = 0.01


class Failing(Solver):
    """Fails at the calls whose numbers it is given."""

    name, takes_hard = "failing", True

    def __init__(self, bad: dict[int, Any]) -> None:
        self.__dict__.update(bad=bad, calls=0)

    def solve(self, problem: Problem, secondary: Any = None) -> Solution:
        self.__dict__["calls"] += 1
        call = self.__dict__["calls"]
        if call in self.__dict__["bad"]:
            status, x = self.__dict__["bad"][call]
            return Solution(problem, x, status, 0, "On purpose.")
        return Solution(problem, np.full(problem.n, 0.5))


@pytest.fixture
def robot() -> MujocoRobot:
    return MujocoRobot.from_arm(sawyer())


@pytest.fixture
def stack(robot: MujocoRobot) -> Stack:
    return Stack([PostureTask(robot.neutral)])


def test_it_runs(robot: MujocoRobot) -> None:
    target = robot.pose("tool")[1] + [0.0, 0.1, 0.0]
    stack = Stack([PositionTask("tool", target), PostureTask(robot.neutral)], [JointLimit(acceleration=5.0)])
    runner, before = MotionRunner(stack, "hierarchical_active_set", acceleration=5.0), np.zeros(7)
    for _ in range(800):
        command = runner.step(robot, DT)
        assert command.mode is Mode.RUNNING
        assert np.abs(command.v - before).max() <= 5.0 * DT + 1e-12
        before = command.v
        robot.update(robot.integrate(robot.q, command.v, DT))
    assert np.linalg.norm(robot.pose("tool")[1] - target) < 1e-3


@pytest.mark.parametrize(
    "failure",
    [
        (Status.INFEASIBLE, None),
        (Status.SOLVED, np.full(7, np.nan)),
        (Status.NOT_FINITE, None),
        (Status.ITERATION_LIMIT, np.ones(7)),
    ],
)
def test_it_brakes_on_a_straight_line_and_stays(robot: MujocoRobot, stack: Stack, failure: Any) -> None:
    acceleration = np.linspace(4.0, 10.0, 7)
    runner = MotionRunner(stack, Failing(dict.fromkeys(range(3, 99), failure)), acceleration=acceleration)
    before = runner.step(robot, DT).v
    before, modes = runner.step(robot, DT).v, []
    for _ in range(40):
        command = runner.step(robot, DT)
        assert np.isfinite(command.v).all()
        assert (np.abs(command.v - before) <= acceleration * DT + 1e-12).all()
        assert np.ptp(command.v) < 1e-12  # the direction of before
        assert (command.v <= before).all()
        before = command.v
        modes.append(command.mode)
    assert not before.any()
    assert modes[0] is Mode.HOLDING
    assert modes[-1] is Mode.STOPPED
    assert "The solver failed" in runner.reason
    runner.reset()
    assert runner.step(robot, DT).mode is Mode.STOPPED  # at rest there is nothing to hold


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_no_joint_passes_its_limit_while_faster_ones_brake(robot: MujocoRobot, side: float) -> None:
    acceleration, left = 5.0, 0.1
    q, v = robot.neutral.copy(), np.zeros(7)
    q[3] = side * (robot.upper[3] - left)
    v[0], v[3] = 3.0, side * 0.9 * np.sqrt(2.0 * acceleration * left)
    robot.update(q)
    stack = Stack([PostureTask(robot.neutral)], [JointLimit(acceleration=acceleration, velocity=3.0)])
    runner = MotionRunner(
        stack, Failing(dict.fromkeys(range(1, 999), (Status.NOT_FINITE, None))), acceleration=acceleration
    )
    runner.reset(v)
    before = v
    for _ in range(100):
        command = runner.step(robot, DT)
        assert (np.abs(command.v) <= np.abs(before)).all()
        assert (np.abs(command.v - before) <= acceleration * DT + 1e-12).all()
        before = command.v
        robot.update(robot.integrate(robot.q, command.v, DT))
        assert abs(robot.q[3]) <= robot.upper[3] + 1e-12
    assert runner.mode is Mode.STOPPED


class Odd(Failing):
    """Raises at the calls whose numbers it is given."""

    def solve(self, problem: Problem, secondary: Any = None) -> Solution:
        self.__dict__["calls"] += 1
        if self.__dict__["calls"] in self.__dict__["bad"]:
            raise ZeroDivisionError("on purpose")
        return Solution(problem, np.full(problem.n, 0.5))


def test_a_solver_that_raises(robot: MujocoRobot, stack: Stack) -> None:
    runner = MotionRunner(stack, Odd({2: None, 3: None}), acceleration=1.0)
    assert runner.solution is None
    assert [runner.step(robot, DT).mode for _ in range(3)] == [Mode.RUNNING, Mode.HOLDING, Mode.HOLDING]
    assert runner.reason == "ZeroDivisionError: on purpose"
    assert runner.failures == 2
    assert runner.solution is not None  # the last there was
    assert runner.step(robot, DT).mode is Mode.RUNNING
    assert runner.failures == 0
    with pytest.raises(ZeroDivisionError):
        MotionRunner(stack, Odd({1: None}), acceleration=1.0).step(robot, DT)


def test_it_remembers_the_last_solution_and_counts_failures(robot: MujocoRobot, stack: Stack) -> None:
    runner = MotionRunner(
        stack, Failing(dict.fromkeys(range(2, 99), (Status.INFEASIBLE, None))), acceleration=0.5 / (2.5 * DT)
    )
    counts = []
    for _ in range(6):
        command = runner.step(robot, DT)
        counts.append(runner.failures)
        if command.solution is not None:
            assert runner.solution is command.solution
    assert counts == [0, 1, 2, 3, 3, 3]  # stopped at the third: it asks no more
    assert runner.solution is not None
    assert runner.solution.status is Status.INFEASIBLE
    runner.reset()
    assert (runner.failures, runner.solution) == (0, None)


@pytest.mark.parametrize("v", [np.full(7, np.nan), np.zeros(5), "fast"])
def test_a_measured_velocity_that_cannot_be_used(robot: MujocoRobot, stack: Stack, v: Any) -> None:
    runner = MotionRunner(stack, "null_space", acceleration=1.0)
    with pytest.raises(SettingError, match="v is "):
        runner.step(robot, DT, v)
    robot.update(robot.neutral + 0.3)
    first = runner.step(robot, DT)
    command = runner.step(robot, DT, v)
    assert command.mode is Mode.HOLDING
    assert command.reason.startswith("v is ")
    assert np.abs(command.v - first.v).max() <= DT + 1e-12


def test_limits_on_accelerations_start_from_the_measured_velocity(robot: MujocoRobot) -> None:
    stack = Stack([PostureTask(robot.neutral + 1.0, gain=50.0)], [JointLimit(acceleration=2.0)])
    runner = MotionRunner(stack, "hierarchical_active_set", acceleration=2.0)
    assert runner.step(robot, DT).v == pytest.approx(np.full(7, 2.0 * DT))
    assert runner.step(robot, DT, np.full(7, 0.5)).v == pytest.approx(np.full(7, 0.5 + 2.0 * DT))


def test_velocities_next_to_nothing(robot: MujocoRobot, stack: Stack) -> None:
    runner = MotionRunner(stack, Failing({1: (Status.NOT_FINITE, None)}), acceleration=1.0)
    runner.reset(np.full(7, 1e-320))
    command = runner.step(robot, DT)
    assert command.mode is Mode.STOPPED
    assert not command.v.any()


def test_an_answer_of_another_length(robot: MujocoRobot) -> None:
    solution = Solution(Problem([Level.equality(np.eye(6), np.zeros(6))]), np.zeros(6))
    assert fault_of(solution, (Status.SOLVED,), 6) == ""
    assert fault_of(solution, (Status.SOLVED,), 7) == ("The solver failed: its x has shape (6,); the robot has nv = 7.")


def test_it_goes_on_when_an_answer_comes_in_time(robot: MujocoRobot, stack: Stack) -> None:
    runner = MotionRunner(
        stack, Failing({2: (Status.INFEASIBLE, None), 3: (Status.INFEASIBLE, None)}), acceleration=1.0
    )
    modes = [runner.step(robot, DT).mode for _ in range(4)]
    assert modes == [Mode.RUNNING, Mode.HOLDING, Mode.HOLDING, Mode.RUNNING]
    assert runner.reason == ""


def test_an_inaccurate_answer(robot: MujocoRobot, stack: Stack) -> None:
    bad = {1: (Status.INACCURATE, np.full(7, 0.1))}
    assert MotionRunner(stack, Failing(bad), acceleration=1.0).step(robot, DT).mode is Mode.RUNNING
    strict = MotionRunner(stack, Failing(bad), acceleration=1.0, accept_inaccurate=False)
    assert strict.step(robot, DT).mode is Mode.STOPPED


def test_misuse(robot: MujocoRobot, stack: Stack) -> None:
    with pytest.raises(SettingError, match="stack is a list"):
        MotionRunner([], "null_space", acceleration=1.0)  # type: ignore[arg-type]
    with pytest.raises(SettingError, match=r"acceleration is 0\.0; it must be > 0 and finite"):
        MotionRunner(stack, "null_space", acceleration=0.0)
    with pytest.raises(UnknownNameError, match="no solver named 'nul_space'"):
        MotionRunner(stack, "nul_space", acceleration=1.0)
    with pytest.raises(SettingError, match="acceleration has 2 numbers; the robot has nv = 7"):
        MotionRunner(stack, "null_space", acceleration=[1.0, 2.0]).step(robot, DT)
    with pytest.raises(SettingError, match=r"acceleration is \[\]"):
        MotionRunner(stack, "null_space", acceleration=[])
    runner = MotionRunner(stack, "null_space", acceleration=1.0)
    runner.reset([1.0, 2.0])
    with pytest.raises(SettingError, match="the velocity before has 2 numbers; the robot has nv = 7"):
        runner.step(robot, DT)
    limited = Stack([PostureTask(robot.neutral)], [JointLimit(acceleration=1.0)])
    with pytest.raises(SettingError, match="dt is -1"):
        MotionRunner(limited, "daqp", acceleration=1.0).step(robot, -1.0)


@pytest.mark.parametrize("share", [0.3, 1.0])
@pytest.mark.parametrize("jerk", [20.0, 200.0, 1e5])
@pytest.mark.parametrize("failing", [5, 30, 60, 90, 110])
def test_it_stops_within_the_jerk_of_a_joint_limit(robot: MujocoRobot, failing: int, jerk: float, share: float) -> None:
    """Driven to a limit and back, it stops from whatever motion it has, and keeps everything."""
    acceleration = 4.0
    limit = JointLimit(acceleration=share * acceleration, jerk=jerk, velocity=1.5)
    posture = PostureTask(robot.upper + 1.0, gain=5.0)
    bad = dict.fromkeys(range(failing, 9999), (Status.NOT_FINITE, None))
    runner = MotionRunner(Stack([posture], [limit]), OnPurpose(bad), acceleration=acceleration)
    robot.update(robot.upper - 0.5)
    v, a = np.zeros(7), np.zeros(7)
    for k in range(900):
        if k == 70:
            posture.target = robot.lower
        command = runner.step(robot, DT)
        new = (command.v - v) / DT
        assert np.abs(command.v).max() <= 1.5 + 1e-12
        assert np.abs(new).max() <= acceleration + 1e-9
        assert np.abs(new - a).max() <= jerk * DT + 1e-8
        v, a = command.v, new
        robot.update(robot.integrate(robot.q, v, DT))
        assert (robot.q <= robot.upper + 1e-12).all()
        if command.mode is Mode.STOPPED and not a.any():
            break
    assert runner.mode is Mode.STOPPED
    assert not v.any()


def test_it_begins_with_the_acceleration_that_it_is_told(robot: MujocoRobot) -> None:
    stack = Stack([PostureTask(robot.upper, gain=5.0)], [JointLimit(jerk=10.0)])
    runner = MotionRunner(stack, "hierarchical_active_set", acceleration=5.0)
    robot.update(robot.neutral)
    runner.reset(np.full(7, 0.1), np.full(7, 0.5))
    np.testing.assert_allclose(runner.step(robot, DT).v, 0.1 + DT * (0.5 + 10.0 * DT))
    runner.reset(np.full(7, 0.1), np.full(6, 0.5))
    with pytest.raises(SettingError, match="the acceleration before has 6 numbers; the robot has nv = 7"):
        runner.step(robot, DT)


class OnPurpose(Failing):
    """The hierarchical active set's answers, but for the calls whose numbers it is given."""

    def solve(self, problem: Problem, secondary: Any = None) -> Solution:
        failed = super().solve(problem, secondary)
        if self.__dict__["calls"] in self.__dict__["bad"]:
            return failed
        return hqp_rp.solve(problem, "hierarchical_active_set")


def test_hold_brakes_as_a_failure_does_and_a_step_goes_on(robot: MujocoRobot, stack: Stack) -> None:
    acceleration = np.linspace(4.0, 10.0, 7)
    failing = MotionRunner(
        stack, Failing(dict.fromkeys(range(2, 99), (Status.NOT_FINITE, None))), acceleration=acceleration
    )
    held = MotionRunner(stack, Failing({}), acceleration=acceleration)
    for runner in (failing, held):
        runner.step(robot, DT)
    for _ in range(3):
        command = held.hold(robot, DT, "A door is open.")
        np.testing.assert_array_equal(command.v, failing.step(robot, DT).v)
        assert (command.mode, command.reason, command.solution) == (Mode.HOLDING, "A door is open.", None)
        assert held.reason == "A door is open."
    assert held.failures == 0
    assert held.step(robot, DT).mode is Mode.RUNNING
    while held.hold(robot, DT, "Stop.").mode is not Mode.STOPPED:
        pass
    command = held.step(robot, DT)
    assert (command.mode, command.reason, command.v.any()) == (Mode.STOPPED, "Stop.", False)
    assert held.hold(robot, DT, "Later.").reason == "Stop."
    held.reset()
    assert held.step(robot, DT).mode is Mode.RUNNING
    with pytest.raises(SettingError, match="reason is ''; give a sentence"):
        held.hold(robot, DT, "")
    with pytest.raises(SettingError, match="dt is 0"):
        held.hold(robot, 0.0)


def test_the_reason_of_a_contradiction_names_limits_and_joints(robot: MujocoRobot) -> None:
    belt = TwistTask("tool", [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], name="belt")
    damped = [None, hqp_rp.ErrorDamping(0.01)]
    for settings in ({}, {"metric": "inertia"}, {"damping": damped}, {"damping": damped, "metric": "inertia"}):
        levels = [PostureTask(robot.neutral, joints=[0]), PostureTask(robot.neutral)]
        contradicting = Stack(levels, [VelocityLimit(0.1), belt], **settings)
        for solver in ("hierarchical_active_set", "qp_cascade", "daqp", "weighted"):
            runner = MotionRunner(contradicting, solver, acceleration=1.0)
            command = runner.step(robot, DT)
            assert command.solution is not None
            assert command.solution.status is Status.INFEASIBLE
            assert command.reason == runner.reason
            assert str(command.solution.conflict) in command.reason
            assert "belt: x asks for at least 1 m/s; within " in command.reason
            assert "'joint velocity'" in command.reason
            assert "0.1 rad/s (velocity limit 0.1)" in command.reason
            assert "Hard row" not in command.reason  # one set of rows, once
