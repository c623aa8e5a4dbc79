"""A solver that refuses the problems of a stack is said where solver and stack meet, not by a robot that does not move."""

from __future__ import annotations

import contextlib
import re
from typing import Any

import numpy as np
import pytest

import hqp_rp
from hqp_rp import AccelerationStack, ConstantDamping, Problem, SettingError, Solution, Solver, Status
from hqp_rp.control import (
    Contact,
    InteractionController,
    JointLimit,
    Mode,
    MotionRunner,
    OrientationTask,
    PositionTask,
    PostureTask,
    Stack,
    TorqueController,
    TorqueStack,
    VelocityLimit,
    WrenchSensor,
)
from hqp_rp.robot import MujocoRobot, sawyer
from hqp_rp.robot.named import named_robot
from tests.control.interaction import press

DT = 0.01


@pytest.fixture(scope="module")
def robot() -> MujocoRobot:
    arm = MujocoRobot.from_arm(sawyer())
    arm.update(arm.neutral)
    return arm


def levels(robot: Any) -> list[Any]:
    R, p = robot.pose("tool")
    return [PositionTask("tool", p), OrientationTask("tool", R), PostureTask(robot.neutral)]


STACKS = {
    "plain": lambda robot: Stack(levels(robot)),
    "two levels": lambda robot: Stack(levels(robot)[:2]),
    "hard": lambda robot: Stack(levels(robot), [VelocityLimit(1.0)]),
    "hard equality": lambda robot: Stack(levels(robot)[1:], [levels(robot)[0]]),
    "soft limit": lambda robot: Stack([VelocityLimit(1.0), *levels(robot)]),
    "damped": lambda robot: Stack(levels(robot), damping=ConstantDamping(0.1)),
    "damped beside limits": lambda robot: Stack(
        levels(robot), [JointLimit(velocity=1.0)], damping=ConstantDamping(0.1)
    ),
    "inertia": lambda robot: Stack(levels(robot), metric="inertia"),
    "weights": lambda robot: Stack(levels(robot), metric={"joint1": 3.0}),
    "inertia beside limits": lambda robot: Stack(levels(robot), [VelocityLimit(1.0)], metric="inertia"),
}
SOLVERS = {
    **{name: name for name in hqp_rp.all_solvers()},
    "null_space, damped": hqp_rp.get_solver("null_space", damping=ConstantDamping(0.1)),
    "weighted for two": hqp_rp.get_solver("weighted", weights=(2.0, 1.0)),
    "alpha for two": hqp_rp.get_solver("generalized_hierarchy", alpha=((0.0, 0.0), (1.0, 0.0))),
}


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("make", STACKS.values(), ids=STACKS)
def test_construction_raises_just_where_the_solver_refuses_and_in_its_words(
    robot: MujocoRobot, make: Any, solver: Any
) -> None:
    stack = make(robot)
    sentence = hqp_rp.get_solver(solver).refuses(stack.problem(robot, DT, np.zeros(7)))
    if sentence is None:
        assert MotionRunner(stack, solver, acceleration=1.0).step(robot, DT).mode is Mode.RUNNING
        return
    with pytest.raises(SettingError, match=re.escape(f"{sentence} It was given {stack!r}.")):
        MotionRunner(stack, solver, acceleration=1.0).step(robot, DT)  # what only the rows tell, at the first step
    if stack.limits == () or isinstance(stack.limits[0], VelocityLimit | JointLimit):
        with pytest.raises(SettingError, match="It was given"):
            MotionRunner(stack, solver, acceleration=1.0)


@pytest.mark.parametrize("name", hqp_rp.all_solvers())
@pytest.mark.parametrize("kind", ["free", "torque", "contacts", "inertia"])
def test_the_same_for_torques(name: str, kind: str) -> None:
    robot = named_robot("humanoid") if kind == "contacts" else MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    given: dict[str, Any] = {
        "free": {},
        "torque": {"torque": 100.0},
        "contacts": {"contacts": [Contact("left_sole")]},
        "inertia": {"metric": "inertia"},
    }[kind]
    stack = TorqueStack([PostureTask(robot.neutral)], **given)
    refused = hqp_rp.get_solver(name).refuses(stack.problem(robot, 0.001, np.zeros(robot.nv))) is not None
    expected = pytest.raises(SettingError, match="It was given TorqueStack") if refused else contextlib.nullcontext()
    with expected:
        TorqueController(stack, name)


def test_a_controller_of_references(robot: MujocoRobot) -> None:
    sensor = WrenchSensor("tool", measures="on_environment", expressed_in="world")
    stack = Stack(list(press(robot)), damping=[ConstantDamping(0.1), None])
    with pytest.raises(
        SettingError, match=r"reverse_priority knows no damping of single levels; .* It was given Stack"
    ):
        InteractionController(stack, sensor, "reverse_priority")
    InteractionController(stack, sensor, "null_space")


class Late(Solver):
    """Refuses from a call on."""

    name, summary, source = "late", "", ""

    def __init__(self, good: int) -> None:
        self.__dict__.update(good=good, calls=0)

    def refuses(self, problem: Problem) -> str | None:
        return None

    def solve(self, problem: Problem, secondary: Any = None) -> Solution:
        self.__dict__["calls"] += 1
        if self.__dict__["calls"] > self.__dict__["good"]:
            return Solution(problem, None, Status.REFUSED, message="late takes no such rows.")
        return Solution(problem, np.full(problem.n, 0.3))


def test_what_is_refused_at_the_first_step_is_raised_and_later_it_is_the_reason(robot: MujocoRobot) -> None:
    stack = Stack(levels(robot))
    with pytest.raises(SettingError, match=r"late takes no such rows\. It was given Stack"):
        MotionRunner(stack, Late(0), acceleration=1.0).step(robot, DT)
    runner = MotionRunner(stack, Late(1), acceleration=1.0)
    assert runner.step(robot, DT).mode is Mode.RUNNING
    command = runner.step(robot, DT)
    assert command.mode is Mode.HOLDING
    assert command.reason == "The solver refuses this problem: late takes no such rows."
    torques = TorqueController(TorqueStack([PostureTask(robot.neutral)]), Late(0))
    with pytest.raises(SettingError, match="late takes no such rows"):
        torques.step(robot, 0.001, np.zeros(7))


def test_what_depends_on_the_number_of_joints_is_seen_with_the_robot(robot: MujocoRobot) -> None:
    for size in (3, 10, 11):  # 10 and 11 are the sizes that are asked for
        solver = hqp_rp.get_solver("damped_least_squares", weight=np.ones(size))
        runner = MotionRunner(Stack(levels(robot)), solver, acceleration=1.0)
        with pytest.raises(SettingError, match=f"weight is for {size} unknowns and the problem has 7"):
            runner.step(robot, DT)


def test_accelerations_have_an_outline_too(robot: MujocoRobot) -> None:
    stack = AccelerationStack(levels(robot), [VelocityLimit(1.0)])
    assert hqp_rp.get_solver("null_space").refuses(stack._outline(9)) is not None
    assert hqp_rp.get_solver("daqp").refuses(stack._outline(9)) is None
