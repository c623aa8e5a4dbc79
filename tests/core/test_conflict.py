"""Why hard rows cannot all be met: the rows, their names, the gap, and what would help."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import linprog

from hqp_rp import Level, NoSolutionError, Problem, Status, solve
from hqp_rp.control import (
    HalfSpaceLimit,
    JointLimit,
    LockedJoints,
    PostureTask,
    Stack,
    TorqueLimit,
    TwistTask,
    VelocityLimit,
)
from hqp_rp.core.conflict import conflict_of
from hqp_rp.core.row_names import ROW_NAMES
from hqp_rp.robot import MujocoRobot, planar_arm, sawyer
from tests.fuzz_verdicts import random_feasible, random_infeasible

FREE = [Level.equality([[1.0]], [0.0])]


def test_by_hand() -> None:
    hard = Level([[2.0], [1.0], [1.0]], [2.0, -np.inf, -5.0], [np.inf, 0.5, 5.0])  # x >= 1, x <= 0.5
    solution = solve(Problem(FREE, hard=hard), "hierarchical_active_set")
    conflict = solution.conflict
    assert conflict is not None
    assert conflict is solution.conflict
    assert sorted(zip(conflict.rows, conflict.sides, strict=True)) == [(0, "lower"), (1, "upper")]
    assert conflict.gap == pytest.approx(0.25)  # halfway between, each is missed by that
    assert set(conflict.remedies) == {"hard row 0", "hard row 1"}
    assert conflict.bounds[conflict.rows.index(0)] == 2.0
    assert conflict.possible == pytest.approx(1.0)  # 2 x of row 0 where row 1 is met, and x of row 1 where row 0 is
    assert "hard row 0" in str(conflict)
    assert "is possible" in str(conflict)


def test_a_row_of_zeros() -> None:
    conflict = conflict_of(Problem(FREE, hard=Level([[0.0], [1.0]], [1.0, 0.0], [2.0, 1.0])), None)
    assert conflict is not None
    assert conflict.names == ("hard row 0 lower",)
    assert conflict.gap == math.inf
    assert conflict.remedies == ("hard row 0",)
    assert (
        str(conflict)
        == "hard row 0 asks for at least 1, and no x moves this row. Moving 'hard row 0' to a level makes the rest feasible; x "
        "may then miss it."
    )


def test_one_contradiction_among_several() -> None:
    apart = Level([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]], [10.0, -np.inf, 1.0, -np.inf], [np.inf, 0.0] * 2)
    conflict = conflict_of(Problem([Level.equality(np.eye(2), [0.0, 0.0])], hard=apart), None)
    assert conflict is not None
    assert set(conflict.rows) == {0, 1}  # the wider of the two, alone
    assert conflict.gap == pytest.approx(5.0)
    assert conflict.remedies == ()
    assert len(conflict.together) == 2
    assert set(conflict.together) & {"hard row 0", "hard row 1"}
    assert set(conflict.together) & {"hard row 2", "hard row 3"}
    assert "No single limit moved to a level makes the rest feasible; " in str(conflict)
    assert str(conflict).endswith(" together do; x may then miss them.")

    twice = Level([[1.0], [1.0], [1.0]], [1.0, -np.inf, -np.inf], [np.inf, 0.0, 0.0])
    conflict = conflict_of(Problem(FREE, hard=twice), None)
    assert conflict is not None
    assert len(conflict.rows) == 2
    assert conflict.remedies == ("hard row 0",)


def least_miss(hard: Level, rows: list[int], sides: list[str]) -> float:
    """The least that x can miss the worst of these one-sided rows by, by linear programming; <= 0 where all are met."""
    lengths = np.linalg.norm(hard.A[rows], axis=1)
    sign = np.array([1.0 if side == "upper" else -1.0 for side in sides])
    bound = np.where(sign > 0.0, hard.upper[rows], -hard.lower[rows]) / lengths
    G = np.column_stack((sign[:, None] * hard.A[rows] / lengths[:, None], -np.ones(len(rows))))
    cost = np.append(np.zeros(hard.n), 1.0)
    found = linprog(cost, G, bound, bounds=[(None, None)] * hard.n + [(-1.0, None)], method="highs")
    assert found.success
    return float(found.x[-1])


def test_the_gap_is_the_least_largest_miss_of_rows_that_all_take_part() -> None:
    rng = np.random.default_rng(5)
    for _ in range(40):
        n, m = int(rng.integers(1, 5)), int(rng.integers(4, 14))
        middle, half = rng.standard_normal(m), rng.uniform(0.0, 0.3, m)
        hard = Level(rng.standard_normal((m, n)), middle - half, middle + half)
        both = least_miss(hard, [*range(m), *range(m)], ["upper"] * m + ["lower"] * m)
        conflict = conflict_of(Problem([Level.equality(np.eye(n), np.zeros(n))], hard=hard), None)
        assert (conflict is None) == (both <= 0.0)
        if conflict is None:
            continue
        rows, sides = list(conflict.rows), list(conflict.sides)
        assert conflict.gap == pytest.approx(least_miss(hard, rows, sides), rel=1e-6)
        for i in range(len(rows)):
            assert len(rows) == 1 or least_miss(hard, rows[:i] + rows[i + 1 :], sides[:i] + sides[i + 1 :]) <= 1e-9
        for row in range(m):
            rest = [i for i in range(m) if i != row]
            helps = least_miss(hard, [*rest, *rest], ["upper"] * (m - 1) + ["lower"] * (m - 1)) <= 0.0
            assert (f"hard row {row}" in conflict.remedies) == helps


def test_where_nothing_contradicts() -> None:
    assert solve(Problem(FREE), "hierarchical_active_set").conflict is None
    assert conflict_of(Problem(FREE), None) is None
    rng = np.random.default_rng(2)
    for _ in range(30):
        assert conflict_of(random_feasible(rng), None) is None


def test_what_is_named_is_infeasible_by_itself() -> None:
    rng = np.random.default_rng(1)
    for _ in range(60):
        problem = random_infeasible(rng)
        conflict = solve(problem, "hierarchical_active_set").conflict
        assert conflict is not None
        hard = problem.hard
        assert hard is not None
        assert conflict.gap > 0.0
        # One-sided rows at the named bounds alone have no common point.
        upper = np.array([side == "upper" for side in conflict.sides])
        rows = list(conflict.rows)
        A = hard.A[rows]
        low, high = np.where(upper, -np.inf, hard.lower[rows]), np.where(upper, hard.upper[rows], np.inf)
        alone = Problem(problem.levels, hard=Level(A, low, high))
        assert solve(alone, "hierarchical_active_set").status is Status.INFEASIBLE
        for remedy in conflict.remedies:
            left = [i for i in range(hard.m) if f"hard row {i}" != remedy]
            rest = Problem(problem.levels, hard=Level(hard.A[left], hard.lower[left], hard.upper[left]))
            assert solve(rest, "hierarchical_active_set").status is Status.SOLVED


def test_limits_of_a_stack_are_named() -> None:
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    too_fast = TwistTask("tool", [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], name="belt")
    stack = Stack([PostureTask(robot.neutral)], [VelocityLimit(0.1), too_fast, LockedJoints(["joint7"])])
    problem = stack.problem(robot, 0.01)
    conflict = solve(problem, "hierarchical_active_set").conflict
    assert conflict is not None
    assert set(conflict.remedies) == {"joint velocity", "belt"}
    assert any(name.startswith("joint velocity: joint") for name in conflict.names)
    assert any(name.startswith("belt: x") for name in conflict.names)
    assert conflict.joint_limits == ("joint velocity",)
    assert conflict.remedies[-1] == "joint velocity"
    assert str(conflict).endswith("Last of all, moving 'joint velocity' does: x may then exceed them.")

    two = Stack(
        [PostureTask(robot.neutral)],
        [
            HalfSpaceLimit("tool", [1.0, 0.0, 0.0], -1.0, return_speed=0.5, name="wall"),
            LockedJoints(all_but=["joint7"], name="brakes"),
        ],
    )
    conflict = solve(two.problem(robot, 0.01), "hierarchical_active_set").conflict
    assert conflict is not None
    assert "wall: tool lower" in conflict.names or "wall: tool upper" in conflict.names
    assert "wall" in conflict.remedies
    assert "brakes" in conflict.remedies


def test_limits_that_share_a_name_are_told_apart() -> None:
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    belt = TwistTask("tool", [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], name="belt")
    stack = Stack([PostureTask(robot.neutral)], [VelocityLimit(0.05), VelocityLimit(50.0), belt])
    conflict = solve(stack.problem(robot, 0.01), "hierarchical_active_set").conflict
    assert conflict is not None
    assert set(conflict.remedies) == {"joint velocity (1)", "belt"}


def test_every_limit_names_its_rows() -> None:
    robot = MujocoRobot.from_arm(sawyer())
    robot.update(robot.neutral)
    limits = [
        JointLimit(velocity=1.0, acceleration=5.0),
        VelocityLimit(1.0),
        TorqueLimit({"joint2": 200.0, "joint4": 200.0}),
        LockedJoints(["joint7"]),
        HalfSpaceLimit("tool", [1.0, 0.0, 0.0], 5.0),
    ]
    problem = Stack([PostureTask(robot.neutral)], limits).problem(robot, 0.01, np.zeros(7))
    assert problem.kept is not None
    joints = [f"joint{i}" for i in range(1, 8)]
    assert [tuple(name[:3]) for name in problem.kept[ROW_NAMES]()] == [
        *(("joint limits", joint, "rad/s") for joint in joints),
        *(("joint velocity", joint, "rad/s") for joint in joints),
        ("joint torque", "joint2", "N m"),
        ("joint torque", "joint4", "N m"),
        ("locked joints", "joint7", "rad/s"),
        ("tool half-space", "tool", "m/s"),
    ]
    other = MujocoRobot.from_arm(planar_arm(3))  # names are those of the robot asked for, whichever it met before
    assert LockedJoints([0]).row_names(other) == ["joint1"]
    assert limits[2].row_names(robot) == ["joint2", "joint4"]  # type: ignore[attr-defined]


def test_as_many_rows_as_joints_are_no_joints() -> None:
    robot = MujocoRobot.from_arm(planar_arm(6))
    robot.update(np.full(6, 0.3))
    problem = Stack([PostureTask(robot.neutral)], [TwistTask("tool", np.zeros(6), name="still")]).problem(robot, 0.01)
    assert problem.kept is not None
    axes = ("x", "y", "z", "rx", "ry", "rz")
    units = ["m/s"] * 3 + ["rad/s"] * 3
    assert [tuple(name[:3]) for name in problem.kept[ROW_NAMES]()] == [
        ("still", axis, unit) for axis, unit in zip(axes, units, strict=True)
    ]


def test_require() -> None:
    solution = solve(Problem(FREE), "null_space")
    assert solution.require() is solution.x
    hard = Level([[1.0], [1.0]], [1.0, -np.inf], [np.inf, 0.0])
    with pytest.raises(NoSolutionError) as told:
        solve(Problem(FREE, hard=hard), "hierarchical_active_set").require()
    assert str(told.value) == (
        "The hard rows contradict each other: no x meets them all. hard row 1 asks for at most 0; within 'hard row 0' at least "
        "1 is possible. In the way: hard row 0 >= 1. Moving 'hard row 1' or 'hard row 0' to a level makes the rest feasible; x "
        "may then miss it."
    )
    solution.status = Status.INACCURATE
    with pytest.raises(NoSolutionError, match="could not confirm"):
        solution.require()
    assert solution.require(inaccurate=True) is solution.x
