"""The half-space: its derivative, the approach, the way back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hqp_rp
from hqp_rp.control import HalfSpaceLimit, JointLimit, Limit, PositionTask, PostureTask, Stack
from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.solution import Status
from hqp_rp.robot import MujocoRobot, PinocchioRobot, Robot, sawyer
from tests.control.chain import random_chain

seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds, at_origin=st.booleans())
def test_the_row_is_the_derivative_of_the_distance(seed: int, at_origin: bool) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(rng)
    q, v, h = robot.q.copy(), rng.normal(size=robot.nv), 1e-6
    normal = rng.normal(size=3)
    limit = HalfSpaceLimit("tool", normal, rng.normal(), point=None if at_origin else rng.normal(size=3))
    assert isinstance(limit, Limit)
    slope = limit.rows(robot, 0.01, None)[0][0] @ v
    ends = []
    for sign in (1.0, -1.0):
        robot.update(q + sign * h * v)
        ends.append(limit.distance(robot))
    assert slope == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-7)


@pytest.mark.parametrize("robot", [MujocoRobot.from_arm(sawyer()), PinocchioRobot.from_arm(sawyer())], ids=type)
def test_a_wall_and_a_position_along_its_normal_are_the_same_row_to_the_last_bit(robot: Robot) -> None:
    """Exactly dependent rows stay so, whoever makes them: solvers and the exact truth need not tell them apart."""
    rng = np.random.default_rng(3)
    stack = Stack([HalfSpaceLimit("tool", [0.0, 1.0, 0.0], 0.5), PositionTask("tool", np.zeros(3))])
    for _ in range(20):
        robot.update(robot.neutral + rng.normal(size=robot.nv))
        matrix = stack.problem(robot, 0.01).matrix
        np.testing.assert_array_equal(matrix[0], -matrix[2])


def test_the_distance_is_in_metres_whatever_the_length_of_the_normal() -> None:
    robot = random_chain(np.random.default_rng(1))
    p = robot.pose("tool")[1]
    for scale in (1.0, 7.0):
        limit = HalfSpaceLimit("tool", [0.0, 0.0, scale], scale * (p[2] + 0.3), margin=0.1, gain=2.0)
        assert limit.distance(robot) == pytest.approx(0.3)
        G, lower, upper = limit.rows(robot, 0.01, None)
        np.testing.assert_allclose(G[0], -robot.jacobian("tool")[2])
        assert (lower[0], upper[0]) == (pytest.approx(-2.0 * 0.2), np.inf)


def rate(distance: float, dt: float = 0.1, **values) -> float:
    robot = random_chain(np.random.default_rng(1))
    return float(
        HalfSpaceLimit("tool", [1, 0, 0], robot.pose("tool")[1][0] + distance, **values).rows(robot, dt, None)[1][0]
    )


def test_known_rates() -> None:
    assert rate(0.4, gain=5.0) == pytest.approx(-2.0)
    assert rate(0.4, gain=50.0) == pytest.approx(-4.0)
    assert rate(-0.01, gain=5.0) == pytest.approx(0.05)
    assert rate(-0.4, gain=5.0, return_speed=0.2) == pytest.approx(0.2)
    assert rate(0.06, gain=10.0, deceleration=1.0) == pytest.approx(-0.3)


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), inside=st.booleans(), hard=st.booleans())
def test_in_closed_loop_the_plane_is_not_passed_and_the_way_back_is_bounded_and_monotone(seed, inside, hard) -> None:
    rng = np.random.default_rng(seed)
    robot, dt = random_chain(rng), 0.01
    p = robot.pose("tool")[1]
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    start = 0.05 if inside else -0.05
    limit = HalfSpaceLimit("tool", normal, normal @ p + start, gain=10.0, return_speed=0.2)
    push = PositionTask("tool", p + 0.5 * normal, gain=2.0)
    stack = Stack([push], [limit]) if hard else Stack([limit, push, PostureTask(robot.q)])
    q, distance = robot.q.copy(), start
    for _ in range(25):
        robot.update(q)
        solution = hqp_rp.solve(stack.problem(robot, dt), "qp_cascade")
        assert solution.status is Status.SOLVED
        assert solution.x is not None
        q = q + dt * solution.x
        robot.update(q)
        new = limit.distance(robot)
        curvature = 5.0 * (dt * np.linalg.norm(solution.x)) ** 2  # levers of at most a few metres
        assert new >= min(distance, 0.0) - curvature
        assert new - distance <= max(0.2 * dt, 0.0) + curvature
        distance = new
    assert distance > (-1e-3 if inside else -0.05 + 0.2 * 25 * dt * 0.4)


def test_it_stands_with_joint_limits_and_names_its_frame() -> None:
    robot = random_chain(np.random.default_rng(3))
    task = PositionTask("tool", robot.pose("tool")[1])
    wall = HalfSpaceLimit("tol", [1, 0, 0], 10.0)
    assert wall.name == "tol half-space"
    with pytest.raises(RobotError, match=r"limits: 'tol half-space': .*tol"):
        Stack([task], [wall]).problem(robot, 0.01)
    problem = Stack([task], [JointLimit(), HalfSpaceLimit("tool", [1, 0, 0], 10.0)]).problem(robot, 0.01)
    assert problem.hard is not None
    assert problem.hard.m == robot.nv + 1


@pytest.mark.parametrize(
    ("arguments", "values", "message"),
    [
        (
            ("tool", [0, 0, 0], 1.0),
            {},
            r"the normal of 'tool half-space' is \[0.0, 0.0, 0.0\]; it must have a direction",
        ),
        (("tool", [0, 1], 1.0), {}, r"the normal of 'tool half-space' has shape \(2,\)"),
        (("tool", [0, 0, 1], np.nan), {}, r"the offset of 'tool half-space' is nan; it must be a finite number"),
        (("tool", [0, 0, 1], [1.0]), {}, r"the offset of 'tool half-space' is \[1.0\]"),
        (("tool", [0, 0, 1], 1.0), {"point": [1, 2]}, r"the point of 'tool half-space' has shape \(2,\)"),
        (("tool", [0, 0, 1], 1.0), {"gain": -1.0}, r"the gain of 'tool half-space' is -1.0"),
        (("tool", [0, 0, 1], 1.0), {"margin": np.inf}, r"the margin of 'tool half-space' is inf"),
        (("", [0, 0, 1], 1.0), {}, r"frame is ''; it must be the name of a frame"),
    ],
)
def test_bad_settings(arguments, values, message) -> None:
    with pytest.raises(SettingError, match=message):
        HalfSpaceLimit(*arguments, **values)
