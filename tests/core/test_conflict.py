"""Why hard rows cannot all be met: the rows, their names, the gap, and what would help."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hqp_rp import Level, NoSolutionError, Problem, Status, solve
from hqp_rp.control import HalfSpaceLimit, LockedJoints, PostureTask, Stack, TwistTask, VelocityLimit
from hqp_rp.core.conflict import conflict_of
from hqp_rp.robot import MujocoRobot, sawyer
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
    assert "hard row 0 lower" in str(conflict)
    assert "they miss each other by 0.25" in str(conflict)


def test_a_row_of_zeros() -> None:
    conflict = conflict_of(Problem(FREE, hard=Level([[0.0], [1.0]], [1.0, 0.0], [2.0, 1.0])), None)
    assert conflict is not None
    assert conflict.names == ("hard row 0 lower",)
    assert conflict.gap == math.inf
    assert conflict.remedies == ("hard row 0",)


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
    assert any(name.startswith("belt: row") for name in conflict.names)
    assert "moving" in str(conflict)

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


def test_require() -> None:
    solution = solve(Problem(FREE), "null_space")
    assert solution.require() is solution.x
    hard = Level([[1.0], [1.0]], [1.0, -np.inf], [np.inf, 0.0])
    with pytest.raises(NoSolutionError, match=r"The hard rows contradict each other.*Hard rows 0, 1"):
        solve(Problem(FREE, hard=hard), "hierarchical_active_set").require()
    solution.status = Status.INACCURATE
    with pytest.raises(NoSolutionError, match="could not confirm"):
        solution.require()
    assert solution.require(inaccurate=True) is solution.x
