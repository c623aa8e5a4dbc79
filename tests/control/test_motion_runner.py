"""The loop without force: the solver's answer while there is one, and a straight stop when there is none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hqp_rp import Problem, SettingError, Solution, Solver, Status, UnknownNameError
from hqp_rp.control import JointLimit, MotionRunner, PositionTask, PostureTask, Stack
from hqp_rp.control.interaction_controller import Mode
from hqp_rp.robot import MujocoRobot, sawyer

DT = 0.01


class Failing(Solver):
    """Fails at the calls whose numbers it is given."""

    name = "failing"

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
    limited = Stack([PostureTask(robot.neutral)], [JointLimit(acceleration=1.0)])
    with pytest.raises(SettingError, match="dt is -1"):
        MotionRunner(limited, "null_space", acceleration=1.0).step(robot, -1.0)
