"""What tasks are given is checked once, and each mistake has one error that says what to do."""

import numpy as np
import pytest

from hqp_rp.control import (
    CenterOfMassTask,
    FeedbackTask,
    OrientationTask,
    PointingTask,
    PoseTask,
    PositionTask,
    PostureTask,
    RelativePoseTask,
    Task,
    TwistTask,
)
from hqp_rp.core.errors import HqpError, RobotError, SettingError
from tests.control.chain import random_chain, random_rotation

I3, O3 = np.eye(3), np.zeros(3)

TASKS = [
    PositionTask("tool", O3),
    OrientationTask("tool", I3),
    PoseTask("tool", (I3, O3)),
    PointingTask("tool", (0, 0, 1)),
    CenterOfMassTask(O3),
    RelativePoseTask("tool", "link1", (I3, O3)),
    PostureTask(np.zeros(7)),
]


@pytest.mark.parametrize("task", [*TASKS, TwistTask("tool")], ids=lambda task: task.name)
def test_is_a_task(task):
    robot = random_chain(np.random.default_rng(0))
    assert isinstance(task, Task)
    J, rate = task.evaluate(robot)
    assert J.shape == (len(rate), 7)
    assert J.dtype == rate.dtype == np.float64
    assert repr(task.name) in repr(task)


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_weight_gain_and_feedforward(task):
    assert isinstance(task, FeedbackTask)
    robot = random_chain(np.random.default_rng(0))
    e, J = task.error(robot), task.jacobian(robot)
    m = len(e)
    gain, weight = np.linspace(0.0, 2.0, m), np.linspace(0.5, 3.0, m)
    try:
        for g, w in ((gain, weight), (2.0, 3.0), (gain, 0.5), (1.0, 1.0)):
            task.gain, task.weight = g, w
            rows, rate = task.evaluate(robot)
            np.testing.assert_allclose(rows, np.broadcast_to(w, m)[:, None] * J, rtol=1e-15)
            np.testing.assert_allclose(rate, np.broadcast_to(w, m) * g * e, rtol=1e-15)
        n = 3 if m == 2 else m
        task.feedforward = np.arange(n)
        moving = task.evaluate(robot)[1] - e
        if m != 2:  # pointing has its rows in the frame's own axes
            np.testing.assert_allclose(moving, np.arange(n), atol=1e-13)
        assert np.linalg.norm(moving) > 0.1
        task.feedforward = None
        np.testing.assert_array_equal(task.evaluate(robot)[1], e)
    finally:
        task.gain = task.weight = 1.0
        task.feedforward = None


def test_targets_may_be_set_at_every_step_and_are_copied():
    robot = random_chain(np.random.default_rng(0))
    target = np.array([1.0, 2.0, 3.0])
    task = PositionTask("tool", target)
    target[:] = 0.0
    np.testing.assert_array_equal(task.target, [1.0, 2.0, 3.0])
    task.target = [4, 5, 6]
    np.testing.assert_allclose(task.error(robot), np.array([4, 5, 6]) - robot.pose("tool")[1])
    with pytest.raises(ValueError, match=r"read-only"):
        task.target[0] = 1.0


def test_every_way_to_give_a_pose():
    rng = np.random.default_rng(1)
    robot = random_chain(rng)
    R, p = robot.pose("tool")
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    w = np.sqrt(1 + np.trace(R)) / 2
    quaternion = [w, *(np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4 * w))]
    for target in (robot.pose("tool"), T, (quaternion, p), [R.tolist(), p.tolist()]):
        np.testing.assert_allclose(PoseTask("tool", target).error(robot), 0.0, atol=1e-14)
    np.testing.assert_allclose(OrientationTask("tool", quaternion).error(robot), 0.0, atol=1e-14)
    np.testing.assert_allclose(OrientationTask("tool", -np.array(quaternion)).error(robot), 0.0, atol=1e-14)


def test_targets_of_other_libraries_are_taken_as_they_are():
    import mink
    import pinocchio as pin
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(2)
    R, p = random_rotation(rng), rng.normal(size=3)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    for rotation in (Rotation.from_matrix(R), mink.SO3.from_matrix(R), pin.Quaternion(R)):
        np.testing.assert_allclose(OrientationTask("tool", rotation).target, R, atol=1e-14)
        np.testing.assert_allclose(PoseTask("tool", (rotation, p)).target[0], R, atol=1e-14)
    for pose in (mink.SE3.from_matrix(T), pin.SE3(R, p)):
        task = RelativePoseTask("tool", "link1", pose)
        np.testing.assert_allclose(task.target[0], R, atol=1e-14)
        np.testing.assert_allclose(task.target[1], p, atol=1e-15)
    with pytest.raises(SettingError, match=r"the target of 'tool orientation' has shape \(2, 3, 3\)"):
        OrientationTask("tool", Rotation.from_matrix([R, R]))
    with pytest.raises(SettingError, match=r"the target of 'tool pose' has shape \(3, 3\); give a pair"):
        PoseTask("tool", Rotation.from_matrix(R))


def test_rotation_in_single_precision_is_made_orthonormal():
    R = random_rotation(np.random.default_rng(2))
    task = OrientationTask("tool", R.astype(np.float32))
    np.testing.assert_allclose(task.target @ task.target.T, I3, atol=1e-15)
    np.testing.assert_allclose(task.target, R, atol=1e-7)


BAD = [
    (
        lambda: PositionTask("tool", [1, 2]),
        r"the target of 'tool position' has shape \(2,\); it must be 3 numbers in m",
    ),
    (
        lambda: PositionTask("tool", [1, np.nan, 2]),
        r"the target of 'tool position'\[1\] is nan; every entry must be finite",
    ),
    (lambda: PositionTask("tool", "home"), "it must hold real numbers"),
    (lambda: PositionTask("tool", [[1, 2], [3]]), "is ragged"),
    (lambda: PositionTask("", O3), "frame is ''; it must be the name of a frame"),
    (lambda: PositionTask("tool", O3, expressed_in=3), "expressed_in is 3; it must be the name of a frame"),
    (lambda: PositionTask("tool", O3, gain=-1), "the gain of 'tool position' is -1.0; it must be finite and >= 0"),
    (
        lambda: PositionTask("tool", O3, gain=[1, 2]),
        r"has shape \(2,\); give one number, or one for each of the 3 rows",
    ),
    (lambda: PositionTask("tool", O3, gain=np.inf), "is inf; it must be finite"),
    (lambda: PositionTask("tool", O3, weight=0), "the weight of 'tool position' is 0.0; it must be finite and > 0"),
    (lambda: PositionTask("tool", O3, axes="xw"), "there is no axis 'w'; valid: x, y, z"),
    (lambda: PositionTask("tool", O3, axes="xx"), "names an axis twice"),
    (lambda: PositionTask("tool", O3, axes=()), "chooses no axis; valid: x, y, z"),
    (lambda: PositionTask("tool", O3, feedforward=[1]), "must be 3 numbers in m/s"),
    (lambda: OrientationTask("tool", 2 * I3), "is not a rotation: R\\^T R is 3 away from the identity"),
    (lambda: OrientationTask("tool", np.diag([1, 1, -1])), "is a reflection"),
    (lambda: OrientationTask("tool", np.eye(4)), r"has shape \(4, 4\); give a rotation matrix \(3, 3\) or a unit"),
    (lambda: OrientationTask("tool", [1, 1, 0, 0]), r"is a quaternion of norm 1.41421356; .* order \(w, x, y, z\)"),
    (lambda: OrientationTask("tool", [np.nan] * 4), "every entry must be finite"),
    (lambda: OrientationTask("tool", I3, axes="z"), "there is no axis 'z'; valid: rx, ry, rz"),
    (lambda: OrientationTask("tool", I3, feedforward=[1]), "must be 3 numbers in rad/s"),
    (lambda: PoseTask("tool", np.eye(3)), r"the target of 'tool pose' has shape \(3, 3\); give a pair \(rotation, pos"),
    (lambda: PoseTask("tool", np.ones((4, 4))), r"a homogeneous matrix ends in \[0, 0, 0, 1\]"),
    (lambda: PoseTask("tool", (I3, [1])), "the position of the target of 'tool pose' has shape"),
    (lambda: PoseTask("tool", (I3, O3), feedforward=O3), "must be 6 numbers in m/s and rad/s"),
    (lambda: TwistTask("tool", [1.0]), "the velocity of 'tool twist' has shape"),
    (lambda: TwistTask("tool", [1.0], axes="x", weight=-1), "the weight of 'tool twist' is -1.0"),
    (lambda: PointingTask("tool", O3), "the direction of 'tool pointing' is the zero vector"),
    (lambda: PointingTask("tool", [1, 0, 0], axis="w"), "is 'w'; give 'x', 'y', 'z' or a vector"),
    (lambda: PointingTask("tool", [1, 0, 0], axis=O3), "the axis of 'tool pointing' is the zero vector"),
    (lambda: CenterOfMassTask(I3), r"the target of 'centre of mass' has shape \(3, 3\)"),
    (lambda: CenterOfMassTask(O3, bodies=[]), "bodies names none; give names of frames"),
    (lambda: CenterOfMassTask(O3, bodies=[3]), "each of bodies is 3; it must be the name of a frame"),
    (lambda: PositionTask("tool", O3, point=[1]), r"the point of 'tool position' has shape \(1,\)"),
    (lambda: OrientationTask("tool", I3, point=O3), "'tool orientation' turns its frame alone, where a point changes"),
    (lambda: PoseTask("tool", (I3, O3), axes=["rz"], point=O3), "turns its frame alone"),
    (lambda: RelativePoseTask("tool", "tool", (I3, O3)), "frame and reference are both 'tool'"),
    (lambda: PostureTask(np.eye(2)), r"has shape \(2, 2\); it must be \(nq,\)"),
    (lambda: PostureTask([0.0, np.inf]), r"the target of 'posture'\[1\] is inf"),
    (lambda: PostureTask(np.zeros(7), joints="joint1"), "joints is 'joint1'; give a sequence"),
    (lambda: PostureTask(np.zeros(7), joints=[]), r"joints is \[\]; give a sequence"),
    (lambda: PostureTask(np.zeros(7), joints=[1], feedforward=[1, 2]), "it must be 1 finite numbers"),
]


@pytest.mark.parametrize(("build", "message"), BAD, ids=[message[:40] for _, message in BAD])
def test_bad_input(build, message):
    with pytest.raises(SettingError, match=message) as caught:
        build()
    assert isinstance(caught.value, HqpError)


def test_posture_meets_robots():
    robot = random_chain(np.random.default_rng(0))
    with pytest.raises(RobotError, match=r"the target has shape \(6,\), the robot has nq = 7"):
        PostureTask(np.zeros(6)).evaluate(robot)
    with pytest.raises(RobotError, match=r"no joint named 'joint9'"):
        PostureTask(np.zeros(7), joints=["joint9"]).evaluate(robot)
    with pytest.raises(RobotError, match=r"no velocity index 7; valid: 0 to 6"):
        PostureTask(np.zeros(7), joints=[7]).evaluate(robot)
    with pytest.raises(RobotError, match=r"a joint is given twice"):
        PostureTask(np.zeros(7), joints=["joint1", 0]).evaluate(robot)
    with pytest.raises(RobotError, match=r"gain has shape \(2,\); on this robot the task has 7 rows"):
        PostureTask(np.zeros(7), gain=[1, 2]).evaluate(robot)
    task = PostureTask(np.zeros(7))
    task.evaluate(robot)
    with pytest.raises(SettingError, match=r"the robot has nq = 7"):
        task.target = np.zeros(3)
    with pytest.raises(SettingError, match=r"it must be 7 finite numbers"):
        task.feedforward = np.zeros(3)


def test_posture_of_a_robot_with_quaternions():
    """The error lives in velocity space, where the name of a free joint has no single index."""
    mujoco = pytest.importorskip("mujoco")
    from hqp_rp.robot import MujocoRobot

    robot = MujocoRobot(
        mujoco.MjModel.from_xml_string(
            """<mujoco><worldbody><body><freejoint name="base"/><geom size=".1"/><body><joint name="arm"/>
            <geom size=".1"/></body></body></worldbody></mujoco>"""
        )
    )
    rng = np.random.default_rng(0)
    v = rng.normal(size=7)
    target = robot.integrate(robot.neutral, v, 1.0)
    task = PostureTask(target)
    J, rate = task.evaluate(robot)
    np.testing.assert_array_equal(J, np.eye(7))
    np.testing.assert_allclose(rate, v, atol=1e-12)
    np.testing.assert_allclose(PostureTask(target, joints=[6, 0]).evaluate(robot)[1], v[[6, 0]], atol=1e-12)
    np.testing.assert_allclose(PostureTask(target, joints=["arm"]).evaluate(robot)[1], v[[6]], atol=1e-12)
    with pytest.raises(RobotError, match=r"'base' has 6 velocities.*give velocity indices 0 to 5"):
        PostureTask(target, joints=["base"]).evaluate(robot)
