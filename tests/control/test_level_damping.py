"""Still at the limit: targets out of reach under hard limits, with damping of the level that cannot get there."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from hqp_rp import ConstantDamping, ErrorDamping, SettingError, Solver, get_solver
from hqp_rp.control import CenterOfMassTask, JointLimit, PoseTask, PositionTask, PostureTask, Stack, VelocityLimit
from hqp_rp.control.stack_file import parse_stack
from hqp_rp.robot import MujocoRobot, planar_arm, sawyer

DT = 0.002
DAMPING = ErrorDamping(0.002, power=1)


@dataclasses.dataclass(frozen=True)
class Run:
    """The last second of a run: largest change of a joint velocity in one step, distance at the end."""

    jump: float
    distance: float
    speed: float


def run(robot: Any, stack: Stack, target: np.ndarray, seconds: float, solver: Solver | None = None) -> Run:
    solver = solver or get_solver("hierarchical_active_set")
    robot.update(robot.neutral)
    v, speeds = np.zeros(robot.nv), []
    for _ in range(round(seconds / DT)):
        solution = solver.solve(stack.problem(robot, DT, v))
        assert solution.status.ok, solution.message
        v = solution.x
        speeds.append(v)
        robot.update(robot.integrate(robot.q, v, DT))
    last = np.array(speeds[-round(1.0 / DT) :])
    distance = float(np.linalg.norm(robot.pose("tool")[1] - target))
    return Run(float(np.abs(np.diff(last, axis=0)).max()), distance, float(np.abs(last).max()))


@pytest.fixture(scope="module")
def arm() -> MujocoRobot:
    return MujocoRobot.from_arm(sawyer())


def stack(arm: MujocoRobot, target: np.ndarray, damping: Any, limits: Any) -> Stack:
    return Stack([PositionTask("tool", target, gain=2.0), PostureTask(arm.neutral)], limits, damping=damping)


@pytest.mark.parametrize("limit", [VelocityLimit(), JointLimit()], ids=["velocity", "joint"])
def test_a_target_far_out_of_reach(arm: MujocoRobot, limit: Any) -> None:
    target = np.array([1.6, 0.3, 0.5])
    exact = run(arm, stack(arm, target, None, [limit]), target, 3.0)
    still = run(arm, stack(arm, target, [DAMPING, None], [limit]), target, 8.0)
    assert exact.jump > 1.0  # rad/s from one step to the next: what damping is for
    assert still.jump < 1e-6
    assert still.distance < exact.distance + 1e-3


def test_a_target_three_millimetres_out_of_reach(arm: MujocoRobot) -> None:
    far = np.array([1.6, 0.3, 0.5])
    run(arm, stack(arm, far, [DAMPING, None], [JointLimit()]), far, 8.0)
    tip = arm.pose("tool")[1]
    target = tip + 0.003 * (far - tip) / np.linalg.norm(far - tip)
    still = run(arm, stack(arm, target, [DAMPING, None], [JointLimit()]), target, 8.0)
    assert still.jump < 1e-6
    assert still.distance < 0.003 + 1e-3
    exact = run(arm, stack(arm, target, None, [JointLimit()]), target, 8.0)
    assert exact.jump > 0.5


@pytest.mark.parametrize("name", ["qp_cascade", "saturation_null_space"])
def test_so_with_other_solvers(arm: MujocoRobot, name: str) -> None:
    target = np.array([1.6, 0.3, 0.5])
    limits = [VelocityLimit()]
    still = run(arm, stack(arm, target, [DAMPING, None], limits), target, 6.0, get_solver(name))
    assert still.jump < 1e-2


def test_a_target_within_reach_is_reached_exactly(arm: MujocoRobot) -> None:
    arm.update(arm.neutral)
    target = arm.pose("tool")[1] + [0.05, 0.1, -0.05]
    for damping in (None, [DAMPING, None]):
        reached = run(arm, stack(arm, target, damping, [JointLimit()]), target, 15.0)
        assert reached.distance < 1e-9
    # and at each step, where the error is nearly gone, level 1 is what it is without damping
    problem = stack(arm, target, [DAMPING, None], [JointLimit()]).problem(arm, DT, np.zeros(7))
    solution = get_solver("hierarchical_active_set").solve(problem)
    assert solution.levels[0].residual < 1e-9


def test_towards_rest_the_posture_below_chatters(arm: MujocoRobot) -> None:
    """Why `toward="below"`: with the same mu towards rest, the direction that the posture must leave alone turns every step."""
    target = np.array([1.6, 0.3, 0.5])
    rest = dataclasses.replace(DAMPING, toward="rest")
    assert run(arm, stack(arm, target, [rest, None], [JointLimit()]), target, 8.0).jump > 0.05


def test_a_planar_arm_with_a_pose_between() -> None:
    arm = MujocoRobot.from_arm(planar_arm(4))
    arm.update(arm.neutral)
    target = np.array([6.0, 0.5, 0.0])
    tasks = [PositionTask("tool", target, axes="xy", gain=2.0), PostureTask(np.full(4, 0.3), gain=1.0)]
    still = run(arm, Stack(tasks, [VelocityLimit(1.0)], damping=[ErrorDamping(0.01, power=1), None]), target, 10.0)
    assert still.jump < 1e-2


def test_damping_of_a_stack() -> None:
    arm = MujocoRobot.from_arm(sawyer())
    tasks = [PositionTask("tool", [1.6, 0.3, 0.5]), PostureTask(arm.neutral)]
    assert Stack(tasks).damping == (None, None)
    assert Stack(tasks, damping=DAMPING).damping == (DAMPING, DAMPING)
    assert Stack(tasks).problem(arm).damping is None
    assert Stack(tasks, damping=[None, DAMPING]).problem(arm).damping == (None, DAMPING)
    problem = Stack(tasks, damping=[DAMPING, None]).problem(arm)
    rate = problem.levels[0].lower
    D, _, offsets = problem.damping_rows
    assert offsets.tolist() == [0, 7, 7]
    np.testing.assert_allclose(D, np.sqrt(0.002 * np.linalg.norm(rate)) * np.eye(7))
    with pytest.raises(SettingError, match="damping has 1 entries for 2 levels"):
        Stack(tasks, damping=[DAMPING])
    with pytest.raises(SettingError, match=r"damping of level 2 is 0.1; give None, ConstantDamping\(factor\)"):
        Stack(tasks, damping=[None, 0.1])  # type: ignore[list-item]
    with pytest.raises(SettingError, match="has damped levels, which a batch cannot hold"):
        Stack(tasks, damping=DAMPING).batch(arm, arm.neutral[None])


FILE = """
[[level]]
damping = {text}
[[level.task]]
type = "position"
frame = "tool"
[[level]]
[[level.task]]
type = "posture"
"""


@pytest.mark.parametrize(
    ("text", "policy"),
    [
        ("{ error = 0.1 }", ErrorDamping(0.1)),
        ("{ error = 0.002, power = 1 }", ErrorDamping(0.002, power=1)),
        ("{ error = 0.1, toward = 'rest' }", ErrorDamping(0.1, toward="rest")),
        ("{ constant = 0.05 }", ConstantDamping(0.05)),
    ],
)
def test_damping_in_a_stack_file(arm: MujocoRobot, text: str, policy: Any) -> None:
    file = parse_stack(FILE.replace("{text}", text))
    assert file.stack(arm).damping == (policy, None)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0.1", r"level 1: damping is 0.1; give one of constant, error, variable, truncation"),
        ("{ error = -1.0 }", r"level 1: damping: factor is -1.0; it must be a finite number >= 0"),
        ("{ constant = 0.1, power = 1 }", r"level 1: damping: constant takes no 'power'"),
        ("{ variable = 0.1 }", r"level 1: damping: variable is 0.1; it takes 2 numbers"),
        ("{ error = 0.1, constant = 0.1 }", r"damping is .*; give one of constant, error"),
    ],
)
def test_misuse_in_a_stack_file(text: str, words: str) -> None:
    with pytest.raises(SettingError, match=words):
        parse_stack(FILE.replace("{text}", text))


def test_a_humanoid_leans_for_something_too_far() -> None:
    pytest.importorskip("jvrc_description", reason="the robot of this test comes with the extra humanoid")
    from hqp_rp.robot.named import named_robot

    robot = named_robot("humanoid")
    robot.update(robot.neutral)
    feet = [PoseTask(f"{side}_sole", robot.pose(f"{side}_sole"), gain=5.0) for side in ("left", "right")]
    hand = "right_hand"
    target = robot.pose(hand)[1] + [1.0, 0.0, 0.0]
    tasks = [
        feet,
        CenterOfMassTask(robot.center_of_mass(), gain=5.0),
        PositionTask(hand, target, gain=2.0),
        PostureTask(robot.neutral, gain=0.2),
    ]
    damping = [None, None, ErrorDamping(0.005, power=1), None]
    dt, solver = 0.005, get_solver("hierarchical_active_set")
    jumps, ground = {}, {}
    for damped in (False, True):
        robot.update(robot.neutral)
        stack = Stack(tasks, [JointLimit(velocity=5.0)], damping=damping if damped else None)
        v, last = np.zeros(robot.nv), []
        for _ in range(1600):
            solution = solver.solve(stack.problem(robot, dt, v))
            assert solution.status.ok, solution.message
            v = solution.x
            last.append(v)
            robot.update(robot.integrate(robot.q, v, dt))
        jumps[damped] = float(np.abs(np.diff(last[-200:], axis=0)).max())
        ground[damped] = float(np.linalg.norm(tasks[1].error(robot)))
    assert jumps[True] < 0.01
    assert jumps[False] > 1.0
    assert ground[True] < 1e-6 < ground[False]  # what shaking costs the levels above
