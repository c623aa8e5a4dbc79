"""Limits on a frame's axis, pose and speed, and on the centre of mass: derivatives, approaches, ways back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hqp_rp
from hqp_rp.control import (
    ConeLimit,
    FrameSpeedLimit,
    Limit,
    OrientationTask,
    PoseLimit,
    PositionTask,
    PostureTask,
    Stack,
    SupportPolygonLimit,
)
from hqp_rp.control._rotations import rotation_log
from hqp_rp.control.support_polygon_limit import convex_hull
from hqp_rp.core.errors import RobotError, SettingError
from tests.control.chain import expm_so3, random_chain, random_rotation

seeds = st.integers(0, 2**32 - 1)


def slope(robot, value, v, h=1e-6):
    """d(value)/dt along v by a central difference."""
    q = robot.q.copy()
    ends = []
    for sign in (1.0, -1.0):
        robot.update(q + sign * h * v)
        ends.append(np.asarray(value()))
    robot.update(q)
    return (ends[0] - ends[1]) / (2 * h)


@given(seed=seeds)
def test_the_cones_row_is_the_derivative_of_the_angle(seed) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(rng)
    v = rng.normal(size=robot.nv)
    limit = ConeLimit("tool", rng.normal(size=3), 1.0, axis=rng.normal(size=3))
    assert isinstance(limit, Limit)
    if not 0.05 < limit.angle(robot) < 3.1:
        return
    assert slope(robot, lambda: limit.angle(robot), v) == pytest.approx(
        -limit.rows(robot, 0.01, None)[0][0] @ v, abs=1e-6
    )


def test_known_rates_of_a_cone() -> None:
    robot = random_chain(np.random.default_rng(2))
    axis = robot.pose("tool")[0][:, 2]
    across = np.cross(axis, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)

    def rate(theta, **values):
        direction = np.cos(theta) * axis + np.sin(theta) * across
        limit = ConeLimit("tool", direction, 0.5, **values)
        assert limit.angle(robot) == pytest.approx(theta, abs=1e-12)
        return limit.rows(robot, 0.01, None)

    assert rate(0.3, gain=5.0)[1][0] == pytest.approx(-1.0)
    assert rate(0.7, gain=5.0, return_speed=0.2)[1][0] == pytest.approx(0.2)
    G, lower, upper = rate(0.0)
    assert not G.any()
    assert (lower[0], upper[0]) == (-np.inf, np.inf)
    G, lower, _ = rate(np.pi)
    assert np.linalg.norm(G) > 0.0
    assert lower[0] > 0.0


@settings(max_examples=10)
@given(seed=st.integers(0, 10**6))
def test_a_frame_stays_within_its_cone_and_comes_back_into_it(seed) -> None:
    rng = np.random.default_rng(seed)
    robot, dt = random_chain(rng), 0.005
    R = robot.pose("tool")[0]
    limit = ConeLimit("tool", R[:, 2], 0.2, gain=10.0)
    turned = OrientationTask("tool", R @ expm_so3(np.array([1.0, 0.3, 0.2])), gain=3.0)
    stack = Stack([limit, turned, PostureTask(robot.q)])
    q = robot.q.copy()
    for _ in range(200):
        robot.update(q)
        q = q + dt * hqp_rp.solve(stack.problem(robot, dt), "hierarchical_active_set").require()
    robot.update(q)
    assert 0.15 < limit.angle(robot) <= 0.2 + 1e-4
    outside = Stack([ConeLimit("tool", R[:, 2], 0.05, gain=10.0), PostureTask(q)])
    last = limit.angle(robot)
    for _ in range(150):
        robot.update(q)
        q = q + dt * hqp_rp.solve(outside.problem(robot, dt), "hierarchical_active_set").require()
        robot.update(q)
        assert limit.angle(robot) <= last + 1e-6
        last = limit.angle(robot)
    assert last <= 0.06


@given(seed=seeds, relative=st.booleans(), offset=st.booleans())
def test_the_rows_of_pose_bounds_are_exact(seed, relative, offset) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(rng)
    v = rng.normal(size=robot.nv)
    values = {"origin": (random_rotation(rng), rng.normal(size=3)), "point": rng.normal(size=3)} if offset else {}
    limit = PoseLimit(
        "tool",
        -1.0,
        1.0,
        axes=["x", "y", "z", "rx", "ry", "rz"],
        relative_to="link2" if relative else "world",
        **values,
    )
    x = limit.coordinates(robot)
    if np.linalg.norm(x[3:]) > 2.8:
        return
    np.testing.assert_allclose(
        slope(robot, lambda: limit.coordinates(robot), v), limit.jacobian(robot) @ v, rtol=1e-5, atol=1e-5
    )


def test_pose_bounds_are_what_they_say() -> None:
    rng = np.random.default_rng(4)
    robot = random_chain(rng)
    (R, p), (R_b, p_b) = robot.pose("tool"), robot.pose("link2")
    limit = PoseLimit("tool", [-1, -2, -3, -1], 4.0, axes=["x", "z", "ry", "rx"], relative_to="link2", gain=2.0)
    x = R_b.T @ (p - p_b)
    turn = rotation_log(R_b.T @ R)
    expected = np.array([x[0], x[2], turn[1], turn[0]])
    np.testing.assert_allclose(limit.coordinates(robot), expected)
    _, lower, upper = limit.rows(robot, 0.01, None)
    low, high = np.array([-1, -2, -3, -1]), np.full(4, 4.0)
    inside = (expected >= low) & (expected <= high)
    np.testing.assert_allclose(lower[inside], -2.0 * (expected - low)[inside])
    np.testing.assert_allclose(upper[inside], 2.0 * (high - expected)[inside])
    assert limit.row_names(robot) == ["tool x", "tool z", "tool ry", "tool rx"]


@given(seed=seeds, lower=st.floats(-2, 2), width=st.floats(0, 1), dt=st.floats(1e-4, 1.0))
def test_pose_bounds_never_cross_wherever_the_frame_is(seed, lower, width, dt) -> None:
    robot = random_chain(np.random.default_rng(seed))
    limit = PoseLimit("tool", lower, lower + width, axes="xyz", deceleration=1.0)
    _, least, greatest = limit.rows(robot, dt, None)
    assert (least <= greatest + 1e-12).all()


def test_a_tool_stays_in_its_box() -> None:
    rng = np.random.default_rng(7)
    robot, dt = random_chain(rng), 0.005
    p = robot.pose("tool")[1]
    box = PoseLimit("tool", p - 0.05, p + 0.05, gain=10.0)
    stack = Stack([PositionTask("tool", p + np.array([0.3, -0.2, 0.0])), PostureTask(robot.q)], [box])
    q = robot.q.copy()
    for _ in range(400):
        robot.update(q)
        q = q + dt * hqp_rp.solve(stack.problem(robot, dt), "hierarchical_active_set").require()
    robot.update(q)
    x = robot.pose("tool")[1] - p
    assert np.abs(x).max() <= 0.05 + 1e-4
    np.testing.assert_allclose(x[:2], [0.05, -0.05], atol=2e-3)


@given(seed=seeds)
def test_a_speed_is_kept_in_every_direction_and_most_of_it_is_allowed(seed) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(rng)
    point = rng.normal(size=3)
    limit = FrameSpeedLimit("tool", linear=0.5, angular=0.8, point=point)
    G, lower, upper = limit.rows(robot, 0.01, None)
    assert G.shape == (12, robot.nv)
    np.testing.assert_array_equal(lower, -upper)
    J = robot.jacobian("tool")
    lever = robot.pose("tool")[0] @ point
    v = rng.normal(size=robot.nv)
    linear = J[:3] @ v + np.cross(J[3:] @ v, lever)
    for rows, speed, most in ((slice(6), linear, 0.5), (slice(6, 12), J[3:] @ v, 0.8)):
        # The largest multiple of v that the rows allow.
        scale = float((upper[rows] / np.abs(G[rows] @ v)).min())
        assert 0.79 * most <= scale * np.linalg.norm(speed) <= most * (1 + 1e-12)


def test_the_dodecahedron_touches_the_ball() -> None:
    """Its corners are where three faces meet: there the bound is reached."""
    robot = random_chain(np.random.default_rng(1))
    from hqp_rp.control.frame_speed_limit import _FACES, _INNER

    corners = [
        np.linalg.solve(np.array([s * _FACES[i], t * _FACES[j], u * _FACES[k]]), np.full(3, _INNER))
        for i, j, k in [(i, j, k) for i in range(6) for j in range(i) for k in range(j)]
        for s in (1, -1) for t in (1, -1) for u in (1, -1)
    ]  # fmt: skip
    inside = [c for c in corners if np.abs(_FACES @ c).max() <= _INNER + 1e-12]
    assert np.linalg.norm(inside, axis=1).max() == pytest.approx(1.0, abs=1e-12)
    assert len(FrameSpeedLimit("tool", 1.0).row_names(robot)) == 6


def test_speeds_along_axes() -> None:
    robot = random_chain(np.random.default_rng(3))
    G, _, upper = FrameSpeedLimit("tool", [1.0, 2.0, np.inf], expressed_in="link2").rows(robot, 0.01, None)
    np.testing.assert_allclose(G, robot.pose("link2")[0].T @ robot.jacobian("tool")[:3])
    np.testing.assert_array_equal(upper, [1.0, 2.0, np.inf])


@given(seed=seeds)
def test_a_hull_holds_every_point_and_turns_left(seed) -> None:
    rng = np.random.default_rng(seed)
    points = rng.integers(-3, 4, size=(12, 2)).astype(float)
    hull = convex_hull(points)
    if hull is None:
        return
    along = np.roll(hull, -1, axis=0) - hull
    cross = along[:, 0] * np.roll(along, -1, axis=0)[:, 1] - along[:, 1] * np.roll(along, -1, axis=0)[:, 0]
    assert (cross > 0).all()
    assert {tuple(corner) for corner in hull} <= {tuple(point) for point in points}
    for corner, edge in zip(hull, along, strict=True):
        assert (edge[0] * (points - corner)[:, 1] - edge[1] * (points - corner)[:, 0] >= -1e-12).all()


@given(seed=seeds)
def test_the_edges_rows_are_the_derivative_of_the_distances(seed) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(rng)
    c = robot.center_of_mass()[:2]
    limit = SupportPolygonLimit(c + rng.normal(size=(6, 2)), gain=1.0, return_speed=np.inf)
    v = rng.normal(size=robot.nv)
    G, lower, _ = limit.rows(robot, 1e-3, None)
    distances = slope(robot, lambda: -limit.rows(robot, 1e-3, None)[1], v)
    np.testing.assert_allclose(distances, G @ v, rtol=1e-6, atol=1e-7)
    assert limit.distance(robot) == pytest.approx((-lower).min())


def test_feet_that_move_carry_the_polygon_along() -> None:
    robot = random_chain(np.random.default_rng(5))
    square = [[0.1, 0.1, 0.0], [-0.1, 0.1, 0.0], [-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.0, 0.0, 0.0]]
    limit = SupportPolygonLimit({"link1": square, "tool": square})
    assert limit.frames == ("link1", "tool")
    placed = [robot.pose(frame)[1] + robot.pose(frame)[0] @ corner for frame in limit.frames for corner in square]
    np.testing.assert_allclose(limit.polygon(robot), convex_hull(np.array(placed)[:, :2]))
    line = SupportPolygonLimit({"tool": [[0, 0, 0], [0, 0, 0], [0, 0, 0]]})
    with pytest.raises(RobotError, match="'support polygon': the points on tool span no area here"):
        line.rows(robot, 0.01, None)


def test_the_centre_of_mass_stays_above_the_polygon() -> None:
    robot, dt = random_chain(np.random.default_rng(11)), 0.005
    c = robot.center_of_mass()
    limit = SupportPolygonLimit(c[:2] + 0.05 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]), margin=0.01, gain=10.0)
    reach = PositionTask("tool", robot.pose("tool")[1] + np.array([0.6, 0.4, 0.0]))
    stack, q = Stack([limit, reach, PostureTask(robot.q)]), robot.q.copy()
    for _ in range(400):
        robot.update(q)
        q = q + dt * hqp_rp.solve(stack.problem(robot, dt), "hierarchical_active_set").require()
        robot.update(q)
        assert limit.distance(robot) >= 0.01 - 1e-3
    assert limit.distance(robot) == pytest.approx(0.01, abs=1e-3)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (
            lambda: ConeLimit("tool", [0, 0, 1], 0.0),
            r"the angle of 'tool cone' is 0.0; it must be in rad, between 0 and pi",
        ),
        (lambda: ConeLimit("tool", [0, 0, 1], 90), r"the angle of 'tool cone' is 90"),
        (lambda: ConeLimit("tool", [0, 0, 0], 1.0), r"the direction of 'tool cone' is the zero vector"),
        (lambda: ConeLimit("tool", [0, 0, 1], 1.0, axis="a"), r"the axis of 'tool cone' is 'a'"),
        (lambda: PoseLimit("tool", 1.0, [0, 2, 2]), r"'tool bounds': along 'x' lower is 1 and upper 0"),
        (
            lambda: PoseLimit("tool", [1, 2], 3.0),
            r"lower of 'tool bounds' is \[1.0, 2.0\]; give one number, or one for each",
        ),
        (lambda: PoseLimit("tool", np.nan, 3.0), r"lower of 'tool bounds' is nan"),
        (lambda: PoseLimit("tool", 0, 1, relative_to="tool"), r"frame and relative_to are both 'tool'"),
        (lambda: PoseLimit("tool", 0, 1, axes="xw"), r"there is no axis 'w'"),
        (lambda: FrameSpeedLimit("tool"), r"'tool speed' bounds nothing; give linear in m/s or angular in rad/s"),
        (lambda: FrameSpeedLimit("tool", np.inf), r"linear of 'tool speed' is inf; it must be > 0 in m/s"),
        (lambda: FrameSpeedLimit("tool", angular=[1, 0, 1]), r"angular of 'tool speed' is \[1.0, 0.0, 1.0\]"),
        (lambda: SupportPolygonLimit([[0, 0], [1, 1], [2, 2]]), r"the points of 'support polygon' span no area"),
        (
            lambda: SupportPolygonLimit([[0, 0, 0, 0]]),
            r"have shape \(1, 4\); they must be finite, in m, of shape \(k, 2\)",
        ),
        (lambda: SupportPolygonLimit({"tool": [[0, 0, 0]]}), r"are fewer than 3"),
        (lambda: SupportPolygonLimit({"": [[0, 0, 0]]}), r"the points' frame is ''"),
    ],
)
def test_bad_settings(build, message) -> None:
    with pytest.raises(SettingError, match=message):
        build()
