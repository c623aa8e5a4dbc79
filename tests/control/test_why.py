"""What a stack tells of limits that contradict each other, and of a level that is held back."""

from __future__ import annotations

import copy
import pathlib
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

import hqp_rp
from hqp_rp.control import (
    AccelerationStack,
    ConeLimit,
    FrameSpeedLimit,
    HalfSpaceLimit,
    JointLimit,
    LockedJoints,
    Mode,
    MotionRunner,
    OrientationTask,
    PoseLimit,
    PositionTask,
    PostureTask,
    Stack,
    TorqueStack,
    VelocityLimit,
)
from hqp_rp.core.conflict import Conflict
from hqp_rp.core.problem import Problem
from hqp_rp.robot import MujocoRobot, sawyer

DT = 0.01
SOLVER = "hierarchical_active_set"


@pytest.fixture
def robot() -> MujocoRobot:
    arm = MujocoRobot.from_arm(sawyer())
    arm.update(arm.neutral)
    return arm


def conflict_of(stack: Stack, robot: MujocoRobot, v: np.ndarray | None = None) -> tuple[Problem, Conflict]:
    problem = stack.problem(robot, DT, np.zeros(robot.nv) if v is None else v)
    conflict = hqp_rp.solve(problem, SOLVER).conflict
    assert conflict is not None
    return problem, conflict


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))])
def test_a_copy_tells_the_same_names_and_causes(robot: MujocoRobot, copied: Callable[[Any], Any]) -> None:
    stack = Stack([PostureTask(robot.neutral)], [JointLimit(acceleration=2.0), LockedJoints([0])])
    moving = np.eye(7)[0] * 0.3
    for other in (stack, AccelerationStack(stack.levels, stack.limits)):
        problem, conflict = conflict_of(other, robot, moving)
        copy_of = hqp_rp.solve(copied(problem), SOLVER)
        assert copy_of.conflict == conflict
        assert str(copy_of.conflict) == str(conflict)
        assert "acceleration 2 rad/s^2 x dt" in str(conflict) or isinstance(other, AccelerationStack)
    far = PositionTask("tool", robot.pose("tool")[1] + [9.0, 0.0, 0.0], gain=50.0)
    free = Stack([VelocityLimit(name="soft limits"), far], [LockedJoints([0])]).problem(robot, DT)
    solution = hqp_rp.solve(free, SOLVER)
    assert any(row.startswith("soft limits: joint") for row in solution.active_rows or ())
    assert hqp_rp.solve(copied(free), SOLVER).active_rows == copied(solution).active_rows == solution.active_rows
    command = MotionRunner(stack, SOLVER, acceleration=2.0).step(robot, DT, moving)
    assert "locked joints: joint1" in command.reason
    assert copied(command).reason == command.reason


def most(problem: Problem, conflict: Conflict) -> float:
    """What a_i x of the row that asks comes to where the conflict's other rows are met, by linear programming."""
    hard = problem.hard
    assert hard is not None
    k = conflict.asks
    A, b = [], []
    for i, row in enumerate(conflict.rows):
        if i != k:
            sign = 1.0 if conflict.sides[i] == "upper" else -1.0
            A.append(sign * hard.A[row])
            b.append(sign * (hard.upper if sign > 0.0 else hard.lower)[row])
    sign = 1.0 if conflict.sides[k] == "upper" else -1.0
    found = linprog(sign * hard.A[conflict.rows[k]], np.array(A), np.array(b), bounds=[(None, None)] * problem.n)
    assert found.success
    return sign * float(found.fun)


def test_a_wall_that_joints_cannot_brake_before(robot: MujocoRobot) -> None:
    p = robot.pose("tool")[1]
    passed = {}
    for name, settings in {"gain": {}, "deceleration": {"deceleration": 1.0}}.items():
        robot.update(robot.neutral)
        wall = HalfSpaceLimit("tool", [1.0, 0.0, 0.0], p[0] + 0.1, gain=50.0, name="wall", **settings)
        stack = Stack(
            [PositionTask("tool", p + np.array([0.6, 0.0, 0.0]), gain=3.0), PostureTask(robot.neutral)],
            [JointLimit(velocity=1.0, acceleration=2.0), wall],
        )
        runner, first, worst = MotionRunner(stack, SOLVER, acceleration=2.0), "", -np.inf
        for _ in range(300):
            command = runner.step(robot, DT)
            if command.mode is not Mode.RUNNING and not first:
                first, failed = command.reason, command.solution
            robot.update(robot.integrate(robot.q, command.v, DT))
            worst = max(worst, -wall.distance(robot))
        passed[name] = worst
        if name == "gain":
            assert runner.mode is Mode.STOPPED
            assert runner.reason == first  # of the step at which it began
            assert command.problem is None
            assert runner.problem is not None  # to be saved all the same
            conflict = failed.conflict
            problem = failed.problem
            assert conflict.possible == pytest.approx(most(problem, conflict))
            assert conflict.bounds[conflict.asks] > conflict.possible
            assert conflict.units[conflict.asks] == "m/s"
            assert conflict.remedies == ("wall", "joint limits")
            assert conflict.joint_limits == ("joint limits",)
            assert conflict.advice == (
                "To brake in time, give 'wall' deceleration=, at most what the joints can brake there, or a gain= below 50.",
            )
            places = [first.index(part) for part in ("To brake in time", "Moving 'wall'", "Last of all")]
            assert places == sorted(places)
            assert "acceleration 2 rad/s^2 x dt from 0.5 rad/s" in first
        else:
            assert runner.mode is Mode.RUNNING
            assert runner.reason == ""
    assert passed["gain"] > 0.05
    assert passed["deceleration"] < 1e-3


def test_walls_that_only_joint_limits_would_make_way_for(robot: MujocoRobot) -> None:
    p = robot.pose("tool")[1]
    walls = [
        HalfSpaceLimit("tool", -axis, -(axis @ p) - 0.1, gain=50.0, name=f"wall {name}")
        for axis, name in zip(np.eye(3), "xyz", strict=True)
    ]
    stack = Stack([PostureTask(robot.neutral)], [JointLimit(velocity=0.02), *walls])
    problem, conflict = conflict_of(stack, robot)
    assert conflict.possible == pytest.approx(most(problem, conflict))
    assert conflict.remedies == ("joint limits",)
    assert conflict.together == ("wall x", "wall y", "wall z")
    assert all(cause in ("", "velocity 0.02 rad/s") for cause in conflict.causes)
    told = str(conflict)
    assert "'wall x', 'wall y' and 'wall z' together do" in told
    assert told.endswith("Last of all, moving 'joint limits' does: x may then exceed them.")
    assert "give 'wall x' a return_speed= below 0.1" in told
    without = Stack([walls, PostureTask(robot.neutral)], [JointLimit(velocity=0.02)])
    assert hqp_rp.solve(without.problem(robot, DT, np.zeros(7)), SOLVER).status.ok
    for pair in (walls[1:], walls[:2], walls[::2]):  # fewer do not help: each wall by itself is too much
        rest = [wall for wall in walls if wall not in pair]
        fewer = Stack([pair, PostureTask(robot.neutral)], [JointLimit(velocity=0.02), *rest])
        assert hqp_rp.solve(fewer.problem(robot, DT, np.zeros(7)), SOLVER).status is hqp_rp.Status.INFEASIBLE


def test_what_made_a_bound_of_the_joint_box(robot: MujocoRobot) -> None:
    q = robot.neutral.copy()
    q[3] = robot.upper[3] - 1e-3
    robot.update(q)
    v = np.array([0.0, 0.5, 0.0, 0.05, 0.0, 0.0, 0.0])
    limit = JointLimit(velocity=[1.0, 0.51, 1.0, 1.0, 1.0, 1.0, 1.0], acceleration=20.0)
    _, lower, upper = limit.rows(robot, DT, v)
    causes = limit.bound_causes(robot, DT, v, lower, upper)
    assert causes[0] == ("acceleration 20 rad/s^2 x dt from 0 rad/s", "acceleration 20 rad/s^2 x dt from 0 rad/s")
    assert causes[1] == ("acceleration 20 rad/s^2 x dt from 0.5 rad/s", "velocity 0.51 rad/s")
    assert causes[3][1] == "position"
    fast = np.array([0.0, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    _, lower, upper = limit.rows(robot, DT, fast)
    assert lower[1] == upper[1] == 0.51  # faster than it may: down to V at once, whatever A says
    assert limit.bound_causes(robot, DT, fast, lower, upper)[1] == (
        "velocity 0.51 rad/s, from 1.5 rad/s beyond it",
        "velocity 0.51 rad/s",
    )
    q[3] = robot.upper[3] + 0.5  # outside: it comes back as fast as it may
    robot.update(q)
    _, lower, upper = limit.rows(robot, DT, v)
    assert limit.bound_causes(robot, DT, v, lower, upper)[3][1].startswith("position: acceleration 20 rad/s^2 x dt")


@pytest.mark.parametrize(
    ("limit", "row"),
    [
        (lambda p: PoseLimit("tool", [p[2] + 0.1], [np.inf], axes="z", gain=50.0, name="table"), "table: tool z"),
        (lambda p: ConeLimit("tool", [0.3, -0.4, 0.5], 0.1, gain=50.0, name="upright"), "upright: tool"),
    ],
)
def test_other_limits_on_the_way_back(robot: MujocoRobot, limit, row: str) -> None:
    stack = Stack([PostureTask(robot.neutral)], [JointLimit(velocity=0.002), limit(robot.pose("tool")[1])])
    problem, conflict = conflict_of(stack, robot)
    assert str(conflict).startswith(f"{row} asks for at")
    assert conflict.possible == pytest.approx(most(problem, conflict))
    assert "return_speed=" in conflict.advice[0]


def test_rows_of_tasks_and_speeds_go_by_axes(robot: MujocoRobot) -> None:
    p = robot.pose("tool")[1]
    stack = Stack(
        [PostureTask(robot.neutral)],
        [
            PositionTask("tool", p + np.array([1.0, 0.0, 0.0]), gain=1.0),
            FrameSpeedLimit("tool", linear=0.1, name="slow"),
        ],
    )
    _, conflict = conflict_of(stack, robot)
    assert "tool position: x lower" in conflict.names
    assert any(name.startswith("slow: speed of tool") for name in conflict.names)
    assert not any("face" in name for name in conflict.names)
    weighted = Stack(
        [PostureTask(robot.neutral)],
        [PositionTask("tool", p + np.array([9.0, 0.0, 0.0]), weight=2.0), JointLimit(velocity=0.1)],
    )
    _, conflict = conflict_of(weighted, robot)
    assert conflict.units[conflict.asks] == ""  # a weighted row is in no unit


def test_saved_problems_keep_the_names(robot: MujocoRobot, tmp_path: pathlib.Path) -> None:
    p = robot.pose("tool")[1]
    wall = HalfSpaceLimit("tool", [1.0, 0.0, 0.0], p[0] - 0.1, gain=50.0, name="wall")
    problem, conflict = conflict_of(
        Stack([[wall], PostureTask(robot.neutral)], [JointLimit(velocity=0.002), wall]), robot
    )
    again = hqp_rp.load_problem(hqp_rp.save_problem(problem, tmp_path / "fault.npz"))
    assert str(hqp_rp.solve(again, SOLVER).conflict) == str(conflict)
    loose = Stack([[wall], PostureTask(robot.neutral)], [JointLimit(velocity=0.002)]).problem(robot, DT, np.zeros(7))
    said = hqp_rp.solve(loose, SOLVER).active_rows
    assert said is not None
    assert "wall: tool at its lower bound" in said
    again = hqp_rp.load_problem(hqp_rp.save_problem(loose, tmp_path / "loose.npz"))
    assert hqp_rp.solve(again, SOLVER).active_rows == said
    with np.load(tmp_path / "loose.npz") as archive:
        arrays = dict(archive)
    for name in ("row_names", "level_row_names"):
        np.savez(tmp_path / "odd.npz", **{**arrays, name: np.array('[["a", "b"]]')})
        with pytest.raises(hqp_rp.FileError, match=f"odd.npz: the array '{name}' names 1 rows; there are"):
            hqp_rp.load_problem(tmp_path / "odd.npz")
        np.savez(tmp_path / "odd.npz", **{**arrays, name: np.array("3")})
        with pytest.raises(hqp_rp.FileError, match=f"'{name}' holds no names of rows"):
            hqp_rp.load_problem(tmp_path / "odd.npz")
        del arrays[name]  # as files had it before there were names
    np.savez(tmp_path / "old.npz", **arrays)
    assert "limits[0] at its" in hqp_rp.solve(hqp_rp.load_problem(tmp_path / "old.npz"), SOLVER).active_rows[0]
    with pytest.raises(hqp_rp.ProblemError, match=r"problem is a NoneType; give a Problem, .* runner.problem"):
        hqp_rp.save_problem(None, tmp_path / "none.npz")  # type: ignore[arg-type]


def test_what_holds_a_level_back(robot: MujocoRobot) -> None:
    R, p = robot.pose("tool")
    stack = Stack(
        [
            PositionTask("tool", p + np.array([0.3, 0.3, 0.2]), gain=10.0),
            OrientationTask("tool", R),
            PostureTask(robot.neutral),
        ],
        [JointLimit(velocity=0.2)],
    )
    solution = hqp_rp.solve(stack.problem(robot, DT, np.zeros(7)), SOLVER)
    first, *rest = solution.held_back
    assert first.level == "tool position"
    assert first.residual == pytest.approx(solution.levels[0].residual)
    assert not first.alone
    assert first.rest < 1e-6
    assert sum(first.shares) + first.rest == pytest.approx(1.0)
    assert list(first.shares) == sorted(first.shares, reverse=True)
    assert all(name.startswith("joint limits: joint") for name in first.by)
    assert set(first.by) <= set(solution.active_rows)  # hard rows stand at the bounds that are told
    # Without what holds it back, the level is served better.
    loosened = np.full(7, 0.2)
    for name in first.by:
        loosened[int(name.split("joint limits: joint")[1].split()[0]) - 1] = 2.0
    loose = Stack(stack.levels, [JointLimit(velocity=loosened)])
    better = hqp_rp.solve(loose.problem(robot, DT, np.zeros(7)), SOLVER).levels[0].residual
    assert better < 0.9 * first.residual
    assert str(first).startswith("tool position is held back by joint limits: joint")
    assert any("tool position" in other.by for other in rest)


def test_a_level_held_back_by_hand() -> None:
    hard = hqp_rp.Level([[1.0, 0.0], [0.0, 1.0]], -1.0, 1.0, row_names=["along", "across"])
    wish = hqp_rp.Level.equality([[1.0, 0.0]], [3.0], name="wish")
    other = hqp_rp.Level.equality([[1.0, 1.0]], [9.0], name="other")
    solution = hqp_rp.solve(hqp_rp.Problem([wish, other], hard=hard), SOLVER)
    one, two = solution.held_back
    assert one.by == ("along at its upper bound",)
    assert one.shares == (1.0,)
    assert str(one) == "wish is held back by along at its upper bound (100%)"
    assert set(two.by) == {"across at its upper bound", "wish"} or set(two.by) == {
        "across at its upper bound",
        "along at its upper bound",
    }
    assert two.shares == pytest.approx((0.5, 0.5))
    met = hqp_rp.solve(hqp_rp.Problem([hqp_rp.Level.equality([[1.0, 0.0]], [0.5])], hard=hard), SOLVER)
    assert met.held_back == ()
    apart = hqp_rp.Problem([hqp_rp.Level.equality([[1.0], [1.0]], [0.0, 1.0], name="apart")])
    (alone,) = hqp_rp.solve(apart, SOLVER).held_back
    assert alone.alone
    assert "its own rows contradict each other" in str(alone)
    damped = hqp_rp.Problem([hqp_rp.Level.equality([[1.0]], [1.0], name="soft", damping=hqp_rp.ConstantDamping(1.0))])
    (soft,) = hqp_rp.solve(damped, SOLVER).held_back
    assert str(soft) == "soft is held back by its damping (100%)"
    with pytest.raises(ValueError, match="no x to judge"):
        _ = hqp_rp.solve(hqp_rp.Problem([wish], hard=hqp_rp.Level([[0.0, 0.0]], 1.0, 1.0)), SOLVER).held_back


def test_rows_named_by_hand() -> None:
    free = [hqp_rp.Level.equality([[1.0]], [0.0])]
    hard = hqp_rp.Level([[1.0], [1.0]], [1.0, -np.inf], [np.inf, 0.0], name="limits", row_names=["floor", "ceiling"])
    solution = hqp_rp.solve(hqp_rp.Problem(free, hard=hard), SOLVER)
    assert set(solution.conflict.names) == {"floor lower", "ceiling upper"}
    assert solution.message == "Hard rows 'floor', 'ceiling' contradict each other: no x meets them all."
    unnamed = hqp_rp.Level(hard.A, hard.lower, hard.upper, name="limits")
    assert set(hqp_rp.solve(hqp_rp.Problem(free, hard=unnamed), SOLVER).conflict.names) == {
        "limits[0] lower",
        "limits[1] upper",
    }
    for names in (["floor"], "ab", [1, 2]):
        with pytest.raises(hqp_rp.ProblemError, match=r"row_names is .*; give one string for each of its 2 rows"):
            hqp_rp.Level(hard.A, hard.lower, hard.upper, row_names=names)  # type: ignore[arg-type]
    with pytest.raises(hqp_rp.ProblemError, match=r"hard is a list: .* Stack the rows of several: Level\(np.vstack"):
        hqp_rp.Problem(free, hard=[hard, hard])  # type: ignore[arg-type]
    band = hqp_rp.Level([[1.0]], 2.0, 3.0, name="band", row_names=["height"])
    low = hqp_rp.Level([[1.0]], -1.0, 1.0)
    active = hqp_rp.solve(hqp_rp.Problem([band], hard=low), SOLVER).active_rows
    assert active == ("hard[0] at its upper bound", "band: height at its lower bound")


def test_locked_joints_are_no_limit_to_brake_before(robot: MujocoRobot) -> None:
    p = robot.pose("tool")[1]
    wall = HalfSpaceLimit("tool", [1.0, 0.0, 0.0], p[0] - 0.1, name="wall")
    _, conflict = conflict_of(Stack([PostureTask(robot.neutral)], [wall, LockedJoints(all_but=["joint7"])]), robot)
    assert conflict.advice == ()
    assert conflict.joint_limits == ()


def test_bounds_of_joints_alone_belong_into_one_joint_limit(robot: MujocoRobot) -> None:
    v = np.zeros(robot.nv)
    v[0] = 0.5
    limits = [JointLimit(acceleration=2.0, position=False), VelocityLimit(0.2)]
    _, conflict = conflict_of(Stack([PostureTask(robot.neutral)], limits), robot, v)
    assert "one JointLimit" in conflict.advice[0]
    assert "velocity limit 0.2" in conflict.causes
    assert "does:" not in str(conflict)


def test_what_physics_asks_moves_to_no_level(robot: MujocoRobot) -> None:
    stack = TorqueStack([PostureTask(robot.neutral)], [JointLimit(velocity=1.0, acceleration=1.0)], torque=0.5)
    _, conflict = conflict_of(stack, robot)
    assert "joint torque" not in conflict.remedies
    assert conflict.names[conflict.asks].startswith("joint limits")
    assert "cannot make way" in conflict.advice[0]


def test_accelerations_brake_in_time(robot: MujocoRobot) -> None:
    v = robot.jacobian("tool")[:3]
    toward = np.linalg.lstsq(v, np.array([0.6, 0.0, 0.0]), rcond=None)[0]
    wall = HalfSpaceLimit("tool", [1.0, 0.0, 0.0], robot.pose("tool")[1][0] + 0.001, gain=50.0, name="wall")
    stack = AccelerationStack([PostureTask(robot.neutral)], [JointLimit(acceleration=2.0), wall])
    _, conflict = conflict_of(stack, robot, toward)
    assert all(advice.startswith("To brake in time") for advice in conflict.advice)
    assert conflict.advice


def test_a_torque_stack_names_turned_rows_as_a_stack_does(robot: MujocoRobot) -> None:
    """mink's rows are minus a joint's velocity for its lower bound."""
    mink = pytest.importorskip("mink")
    v = np.zeros(robot.nv)
    v[0] = -0.5
    limits = [
        JointLimit(acceleration=2.0, position=False),
        mink.VelocityLimit(robot.model, {robot.joint_names[0]: 0.2}),
    ]
    for make in (AccelerationStack, TorqueStack):
        _, conflict = conflict_of(make([PostureTask(robot.neutral)], limits), robot, v)
        (turned,) = [name for name in conflict.names if "mink" in name]
        assert turned.endswith(f"{robot.joint_names[0]} lower"), turned
        assert conflict.sides[conflict.names.index(turned)] == "lower"
