"""Every task's Jacobian against finite differences of its error, in every frame, at small and large errors."""

import numpy as np
import pytest

from hqp_rp.control import (
    CenterOfMassTask,
    OrientationTask,
    PointingTask,
    PoseTask,
    PositionTask,
    PostureTask,
    RelativePoseTask,
    TwistTask,
)
from hqp_rp.control._rotations import skew
from tests.control.chain import expm_so3, random_chain, random_rotation

FRAMES = ["world", "tool", "link3"]
AXES = [("x", "y", "z"), ("z",), ("y", "x")]
ANGULAR = [("rx", "ry", "rz"), ("rz",), ("ry", "rx")]
ANGLES = [1e-5, 0.5, 2.0, 3.0]


def derivative(robot, function, v, h=1e-5):
    """d(function)/dt along v at the robot's configuration, by a four-point central difference."""
    q = robot.q.copy()

    def at(s):
        robot.update(q + s * v)
        return np.asarray(function())

    value = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
    robot.update(q)
    return value


def check_exact(robot, task, rng):
    """d(error)/dt = -J v."""
    v = rng.normal(size=robot.nv)
    expected = -task.jacobian(robot) @ v
    np.testing.assert_allclose(derivative(robot, lambda: task.error(robot), v), expected, rtol=1e-7, atol=1e-9)


def check_energy(robot, task, rng):
    """d(|error|^2 / 2)/dt = -error^T J v, for every v."""
    v = rng.normal(size=robot.nv)
    e, J = task.error(robot), task.jacobian(robot)
    change = derivative(robot, lambda: task.error(robot) @ task.error(robot) / 2, v)
    np.testing.assert_allclose(change, -e @ J @ v, rtol=1e-7, atol=1e-9)


@pytest.fixture(params=range(3))
def rng(request):
    return np.random.default_rng(request.param)


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("axes", AXES)
def test_position_is_exact_in_every_frame(rng, frame, axes):
    robot = random_chain(rng)
    check_exact(robot, PositionTask("tool", rng.normal(size=3), axes=axes, expressed_in=frame), rng)


def test_position_in_world_axes_has_the_geometric_jacobian(rng):
    robot = random_chain(rng)
    task = PositionTask("link4", rng.normal(size=3), axes="zx")
    np.testing.assert_array_equal(task.jacobian(robot), robot.jacobian("link4")[[2, 0]])
    np.testing.assert_array_equal(task.error(robot), (task.target - robot.pose("link4")[1])[[2, 0]])


def inverse_right_jacobian(e):
    """J_r(e)^-1 of SO(3): d log(E exp([w]x t))/dt = J_r^-1 w at t = 0, with e = log E."""
    angle = np.linalg.norm(e)
    K = skew(e)
    factor = 1 / 12 if angle < 1e-4 else (1 - angle / 2 / np.tan(angle / 2)) / angle**2
    return np.eye(3) + K / 2 + factor * K @ K


@pytest.mark.parametrize("angle", ANGLES)
def test_orientation_error_rate_is_the_log_jacobian(rng, angle):
    robot = random_chain(rng)
    axis = rng.normal(size=3)
    r = angle * axis / np.linalg.norm(axis)
    task = OrientationTask("tool", expm_so3(r) @ robot.pose("tool")[0])
    np.testing.assert_allclose(task.error(robot), r, atol=1e-12)
    v = rng.normal(size=robot.nv)
    expected = -inverse_right_jacobian(r) @ task.jacobian(robot) @ v
    np.testing.assert_allclose(derivative(robot, lambda: task.error(robot), v), expected, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("angle", ANGLES)
def test_orientation_energy_is_exact_in_every_frame(rng, frame, angle):
    robot = random_chain(rng)
    axis = rng.normal(size=3)
    target = expm_so3(angle * axis / np.linalg.norm(axis)) @ robot.pose("tool")[0]
    check_energy(robot, OrientationTask("tool", target, expressed_in=frame), rng)


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("axes", ANGULAR)
def test_orientation_rows_are_the_turned_world_rows(rng, frame, axes):
    robot = random_chain(rng)
    target = random_rotation(rng)
    whole = OrientationTask("tool", target, gain=2.0, feedforward=[0.1, 0.2, 0.3])
    task = OrientationTask("tool", target, axes=axes, expressed_in=frame, gain=2.0, feedforward=[0.1, 0.2, 0.3])
    S = np.eye(3) if frame == "world" else robot.pose(frame)[0]
    rows = [("rx", "ry", "rz").index(axis) for axis in axes]
    J, rate = whole.evaluate(robot)
    np.testing.assert_allclose(task.evaluate(robot)[0], (S.T @ J)[rows], atol=1e-14)
    np.testing.assert_allclose(task.evaluate(robot)[1], (S.T @ rate)[rows], atol=1e-14)


def test_orientation_in_its_own_axes_is_the_body_logarithm(rng):
    robot = random_chain(rng)
    R = robot.pose("tool")[0]
    r = np.array([0.4, -1.0, 0.7])
    task = OrientationTask("tool", R @ expm_so3(r), expressed_in="tool")
    np.testing.assert_allclose(task.error(robot), r, atol=1e-13)


@pytest.mark.parametrize("frame", FRAMES)
def test_pose_is_position_over_orientation(rng, frame):
    robot = random_chain(rng)
    R, p = random_rotation(rng), rng.normal(size=3)
    twist = rng.normal(size=6)
    pose = PoseTask("tool", (R, p), expressed_in=frame, gain=3.0, feedforward=twist)
    parts = (
        PositionTask("tool", p, expressed_in=frame, gain=3.0, feedforward=twist[:3]),
        OrientationTask("tool", R, expressed_in=frame, gain=3.0, feedforward=twist[3:]),
    )
    for k in range(2):
        expected = np.concatenate([part.evaluate(robot)[k] for part in parts])
        np.testing.assert_allclose(pose.evaluate(robot)[k], expected, atol=1e-13)
    some = PoseTask("tool", (R, p), axes=("rz", "x", "y"), expressed_in=frame, gain=3.0, feedforward=twist)
    for k in range(2):
        np.testing.assert_array_equal(some.evaluate(robot)[k], pose.evaluate(robot)[k][[5, 0, 1]])


@pytest.mark.parametrize("angle", [*ANGLES, 1e-9, np.pi - 1e-6])
@pytest.mark.parametrize("axis", ["z", "x", (1.0, -2.0, 0.5)])
def test_pointing(rng, angle, axis):
    robot = random_chain(rng)
    local = {"z": (0, 0, 1), "x": (1, 0, 0)}.get(axis, axis)
    a = robot.pose("tool")[0] @ (np.array(local) / np.linalg.norm(local))
    around = np.cross(a, rng.normal(size=3))
    d = expm_so3(angle * around / np.linalg.norm(around)) @ a
    task = PointingTask("tool", 5.0 * d, axis=axis)
    # Where the angle is near 0 or pi its square is smooth, but a difference of cosines would lose half of the digits.
    assert np.linalg.norm(task.error(robot)) == pytest.approx(angle, abs=1e-14)
    if 1e-6 < angle < 3.1:
        check_energy(robot, task, rng)
    J = task.jacobian(robot)
    assert J.shape == (2, robot.nv)
    # Turning by the error about the world axis it stands for takes the axis to the direction.
    w = np.linalg.pinv(robot.jacobian("tool")[3:]) @ (around / np.linalg.norm(around))
    np.testing.assert_allclose(J @ w * angle, task.error(robot), atol=1e-9)


@pytest.mark.parametrize("axis", ["x", "y", "z", (1.0, 1.0, 1.0)])
def test_pointing_backwards_is_a_half_turn(axis):
    robot = random_chain(np.random.default_rng(3))
    local = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}.get(axis, axis)
    d = -robot.pose("tool")[0] @ np.array(local, dtype=float)
    error = PointingTask("tool", d, axis=axis).error(robot)
    assert np.linalg.norm(error) == pytest.approx(np.pi, abs=1e-12)
    aligned = PointingTask("tool", -d, axis=axis).error(robot)
    np.testing.assert_allclose(aligned, 0.0, atol=1e-15)


def test_pointing_ignores_spin(rng):
    """Turning about the pointing axis is in the null space of the task."""
    robot = random_chain(rng)
    task = PointingTask("tool", rng.normal(size=3), axis="y")
    J = robot.jacobian("tool")[3:]
    spin = np.linalg.pinv(J) @ robot.pose("tool")[0][:, 1]
    np.testing.assert_allclose(task.jacobian(robot) @ spin, 0.0, atol=1e-12)


def test_posture_is_exact(rng):
    robot = random_chain(rng)
    check_exact(robot, PostureTask(rng.normal(size=7)), rng)
    check_exact(robot, PostureTask(rng.normal(size=7), joints=["joint6", 1]), rng)


@pytest.mark.parametrize("axes", AXES)
def test_center_of_mass_is_exact(rng, axes):
    check_exact(random_chain(rng), CenterOfMassTask(rng.normal(size=3), axes=axes), rng)


@pytest.mark.parametrize("axes", ["xyz", "zx"])
def test_relative_position_is_exact(rng, axes):
    robot = random_chain(rng)
    check_exact(robot, RelativePoseTask("tool", "link2", (random_rotation(rng), rng.normal(size=3)), axes=axes), rng)
    check_exact(robot, RelativePoseTask("link2", "tool", (random_rotation(rng), rng.normal(size=3)), axes=axes), rng)


def test_relative_orientation_energy_is_exact(rng):
    robot = random_chain(rng)
    R_a, R_b = robot.pose("link2")[0], robot.pose("tool")[0]
    r = np.array([0.3, -1.2, 0.9])
    task = RelativePoseTask("tool", "link2", (expm_so3(r) @ R_a.T @ R_b, np.zeros(3)), axes=("rx", "ry", "rz"))
    np.testing.assert_allclose(task.error(robot), r, atol=1e-12)
    check_energy(robot, task, rng)


def test_relative_rate_is_zero_when_both_frames_move_together(rng):
    """Joints before the reference do not change what it sees."""
    robot = random_chain(rng)
    task = RelativePoseTask("tool", "link3", (np.eye(3), np.zeros(3)))
    np.testing.assert_allclose(task.jacobian(robot)[:, :3], 0.0, atol=1e-14)
    assert np.abs(task.jacobian(robot)[:, 3:]).max() > 0.1


@pytest.mark.parametrize("frame", FRAMES)
def test_twist_is_the_velocity_of_the_frame(rng, frame):
    robot = random_chain(rng)
    task = TwistTask("tool", expressed_in=frame, axes=("rx", "z", "x"), velocity=[0.1, 0.2, 0.3])
    v = rng.normal(size=7)
    R = robot.pose("tool")[0]
    linear = derivative(robot, lambda: robot.pose("tool")[1], v)
    turning = derivative(robot, lambda: robot.pose("tool")[0], v) @ R.T
    angular = np.array([turning[2, 1], turning[0, 2], turning[1, 0]])
    S = np.eye(3) if frame == "world" else robot.pose(frame)[0]
    J, rate = task.evaluate(robot)
    expected = np.array([(S.T @ angular)[0], (S.T @ linear)[2], (S.T @ linear)[0]])
    np.testing.assert_allclose(J @ v, expected, rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(rate, [0.1, 0.2, 0.3])


def test_feedforward_tracks_a_moving_target_in_moving_axes(rng):
    """With the target's velocity fed forward, the error changes by -J v + (what is fed forward), in any axes."""
    robot = random_chain(rng)
    v, moving = rng.normal(size=7), rng.normal(size=3)
    task = PositionTask("tool", rng.normal(size=3), expressed_in="tool", gain=0.0, feedforward=moving)
    J, rate = task.evaluate(robot)
    start, q, h = task.target.copy(), robot.q.copy(), 1e-6
    errors = []
    for sign in (1, -1):
        robot.update(q + sign * h * v)
        task.target = start + sign * h * moving
        errors.append(task.error(robot))
    np.testing.assert_allclose((errors[0] - errors[1]) / (2 * h), rate - J @ v, rtol=1e-6, atol=1e-7)


def test_one_moving_axis_converges_while_the_others_are_free():
    """The exact Jacobian is what makes a component along the tool's own axis decay as exp(-gain t)."""
    rng = np.random.default_rng(5)
    robot = random_chain(rng)
    task = PositionTask("tool", rng.normal(size=3), axes="z", expressed_in="tool", gain=2.0)
    e0, dt, steps = task.error(robot)[0], 1e-3, 500
    wander = 0.5 * rng.normal(size=7)
    for _ in range(steps):
        J, rate = task.evaluate(robot)
        v = wander + np.linalg.pinv(J) @ (rate - J @ wander)
        robot.update(robot.q + dt * v)
    assert task.error(robot)[0] == pytest.approx(e0 * np.exp(-2.0 * steps * dt), abs=2e-3 * abs(e0))


def test_a_full_orientation_task_decays_exactly_from_a_large_error():
    rng = np.random.default_rng(6)
    robot = random_chain(rng)
    r = 2.8 * np.array([0.6, 0.0, 0.8])
    task = OrientationTask("tool", expm_so3(r) @ robot.pose("tool")[0], gain=2.0)
    dt, steps = 1e-3, 500
    for _ in range(steps):
        J, rate = task.evaluate(robot)
        robot.update(robot.q + dt * np.linalg.pinv(J) @ rate)
    np.testing.assert_allclose(task.error(robot), r * np.exp(-2.0 * steps * dt), atol=5e-3)


@pytest.mark.parametrize("frame", FRAMES)
def test_a_point_of_the_frame_is_a_frame_there(rng, frame):
    robot = random_chain(rng)
    point, target = rng.normal(size=3), rng.normal(size=3)
    check_exact(robot, PositionTask("tool", target, point=point, expressed_in=frame), rng)
    R, p = robot.pose("tool")
    np.testing.assert_allclose(
        PositionTask("tool", target, point=point).error(robot), target - p - R @ point, atol=1e-14
    )
    pose = PoseTask("tool", (random_rotation(rng), target), axes=["rx", "z", "x"], point=point, expressed_in=frame)
    both = PositionTask("tool", target, axes="zx", point=point, expressed_in=frame)
    np.testing.assert_array_equal(pose.jacobian(robot)[1:], both.jacobian(robot))
    np.testing.assert_array_equal(pose.error(robot)[1:], both.error(robot))


def test_a_point_seen_from_another_frame_is_exact(rng):
    robot = random_chain(rng)
    pose = random_rotation(rng), rng.normal(size=3)
    check_exact(robot, RelativePoseTask("tool", "link2", pose, axes="xyz", point=rng.normal(size=3)), rng)


@pytest.mark.parametrize("frame", FRAMES)
def test_a_twist_of_a_point_is_its_velocity(rng, frame):
    robot = random_chain(rng)
    point, v = rng.normal(size=3), rng.normal(size=robot.nv)
    task = TwistTask(
        "tool", [0, 0, 0, 0], axes=["x", "rz", "y", "z"], point=point, expressed_in=frame, weight=[1, 2, 3, 4]
    )

    def place():
        R, p = robot.pose("tool")
        return p + R @ point

    R = np.eye(3) if frame == "world" else robot.pose(frame)[0]
    moved = np.delete(task.jacobian(robot) @ v, 1)
    np.testing.assert_allclose(moved, R.T @ derivative(robot, place, v), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(
        task.evaluate(robot)[0], np.array([[1], [2], [3], [4]]) * task.jacobian(robot), rtol=1e-12, atol=1e-14
    )
