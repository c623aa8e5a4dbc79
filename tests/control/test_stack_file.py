"""Stack files: the same problem as the stack written in Python, the shipped examples, and every mistake named."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest

from hqp_rp.control import (
    CenterOfMassTask,
    CollisionLimit,
    ConeLimit,
    FrameSpeedLimit,
    HalfSpaceLimit,
    JointLimit,
    LookAtTask,
    OrientationTask,
    PointingTask,
    PoseLimit,
    PoseTask,
    PositionTask,
    PostureTask,
    RelativePoseTask,
    Stack,
    SupportPolygonLimit,
    TorqueLimit,
    TwistTask,
    VelocityLimit,
)
from hqp_rp.control.stack_file import EXAMPLES, load_stack, parse_stack
from hqp_rp.core.errors import FileError, HqpError, RobotError, SettingError, UnknownNameError
from hqp_rp.core.problem import Problem
from hqp_rp.robot.arms import panda_like, sawyer
from hqp_rp.robot.mujoco_robot import MujocoRobot
from hqp_rp.robot.named import named_robot

EVERYTHING = """
dt = 0.01

[[limit]]
type = "joint"
velocity = 2.0
acceleration = 10.0
jerk = 300.0
[[limit]]
type = "torque"
limit = 100.0

[[level]]
name = "first"
[[level.task]]
type = "position"
frame = "tool"
axes = "zx"
target = [0.1, 0.2, 0.3]
expressed_in = "link2"
gain = [2.0, 3.0]
feedforward = [0.1, 0.0, 0.2]
weight = 0.5
[[level.limit]]
type = "half_space"
frame = "tool"
normal = [0, 0, 1]
offset = 0.1
[[level.limit]]
type = "velocity"
limit = { joint2 = 0.5 }

[[level]]
task = { type = "orientation", frame = "tool", target = [0.0, 1.0, 0.0, 0.0] }
[[level]]
[[level.task]]
type = "pose"
frame = "link4"
target = { position = [0.1, 0.2, 0.3], rotation = [1, 0, 0, 0] }
[[level.task]]
type = "pointing"
frame = "tool"
direction = [0, 1, 0]
axis = "x"
[[level]]
[[level.task]]
type = "relative_pose"
frame = "tool"
reference = "link3"
axes = ["x", "rz"]
target = [[1, 0, 0, 0.1], [0, 1, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]
[[level.task]]
type = "twist"
frame = "link5"
velocity = [0.1]
axes = ["rx"]
[[level]]
[[level.task]]
type = "center_of_mass"
target = [0.1, 0.2, 0.3]
[[level.limit]]
type = "collision"
pairs = [["link7", "link1"]]
[[level]]
[[level.task]]
type = "posture"
joints = ["joint1", "joint7"]
target = [0, 0, 0, 0, 0, 0, 1]
"""


def same(first: Problem, second: Problem) -> None:
    assert first.names == second.names
    for name in ("matrix", "lower", "upper", "offsets"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert (first.hard is None) == (second.hard is None)
    if first.hard is not None and second.hard is not None:
        np.testing.assert_array_equal(first.hard.A, second.hard.A)
        np.testing.assert_array_equal(first.hard.upper, second.hard.upper)


def test_a_file_says_what_python_says() -> None:
    robot = MujocoRobot.from_arm(sawyer())
    pose = np.eye(4)
    pose[:3, 3] = (0.1, 0.2, 0.3)
    written = Stack(
        [
            [
                PositionTask(
                    "tool",
                    [0.1, 0.2, 0.3],
                    axes="zx",
                    expressed_in="link2",
                    gain=[2.0, 3.0],
                    feedforward=[0.1, 0, 0.2],
                    weight=0.5,
                ),
                HalfSpaceLimit("tool", [0, 0, 1], 0.1),
                VelocityLimit({"joint2": 0.5}),
            ],
            OrientationTask("tool", [0.0, 1.0, 0.0, 0.0]),
            [PoseTask("link4", pose), PointingTask("tool", [0, 1, 0], axis="x")],
            [
                RelativePoseTask("tool", "link3", pose, axes=["x", "rz"]),
                TwistTask("link5", [0.1], axes=["rx"]),
            ],
            [CenterOfMassTask([0.1, 0.2, 0.3]), CollisionLimit([("link7", "link1")])],
            PostureTask([0, 0, 0, 0, 0, 0, 1], joints=["joint1", "joint7"]),
        ],
        limits=[JointLimit(velocity=2.0, acceleration=10.0, jerk=300.0), TorqueLimit(100.0)],
    )
    file = parse_stack(EVERYTHING)
    assert file.has_limits
    read = file.stack(robot)
    assert read.names == ("first", *written.names[1:])
    rng = np.random.default_rng(0)
    for _ in range(3):
        robot.update(rng.uniform(robot.lower, robot.upper))
        v, a = rng.uniform(-0.1, 0.1, 7), rng.uniform(-1.0, 1.0, 7)
        first, second = read.problem(robot, 0.01, v, a), written.problem(robot, 0.01, v, a)
        same(first, Problem.from_stacked(*second.stacked, names=first.names, hard=second.hard, check=False))


def test_a_target_that_is_left_out_is_the_neutral_one() -> None:
    """There every task is met: its rate is zero, wherever the robot was before."""
    robot = named_robot("dual_sawyer")
    before = robot.neutral + 0.3
    robot.update(before)
    types = (
        ("position", 'frame = "left_tool"'),
        ("orientation", 'frame = "left_tool"'),
        ("pose", 'frame = "right_tool"'),
        ("relative_pose", 'frame = "right_tool"\nreference = "left_tool"'),
        ("relative_pose", 'frame = "right_tool"\nreference = "world"'),
        ("center_of_mass", ""),
        ("posture", ""),
    )
    text = "".join(f'[[level]]\n[[level.task]]\ntype = "{kind}"\n{rest}\n' for kind, rest in types)
    stack = parse_stack(text).stack(robot)
    np.testing.assert_array_equal(robot.q, before)
    assert np.abs(stack.problem(robot).lower).max() > 0.1
    robot.update(robot.neutral)
    np.testing.assert_allclose(stack.problem(robot).lower, 0.0, atol=1e-12)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_the_librarys_own_stacks_fit_their_robots(path: pathlib.Path) -> None:
    robot = named_robot(path.stem.removesuffix("_limits"))
    file = load_stack(path.stem)
    assert file.text == load_stack(path).text == path.read_text()
    problem = file.stack(robot).problem(robot, file.dt)
    assert problem.p >= 3
    assert problem.is_equality == (not file.has_limits)


def test_robots_by_name() -> None:
    assert named_robot("planar3").nv == 3
    dual, arm = named_robot("dual_sawyer"), sawyer()
    q = np.linspace(-1.0, 1.0, 14)
    dual.update(q)
    for side, part, y in (("left", slice(0, 7), 0.3), ("right", slice(7, 14), -0.3)):
        R, p = arm.pose(q[part])
        rotation, position = dual.pose(f"{side}_tool")
        np.testing.assert_allclose(rotation, R, atol=1e-12)
        np.testing.assert_allclose(position, p + np.array([0.0, y, 0.0]), atol=1e-12)
        np.testing.assert_allclose(dual.jacobian(f"{side}_tool")[:, part], arm.jacobian(q[part]), atol=1e-12)
    np.testing.assert_array_equal(dual.velocity_limit[:7], arm.velocity_limit)
    panda = named_robot("panda_like")
    np.testing.assert_array_equal(panda.velocity_limit, panda_like().velocity_limit)
    panda.update(panda.neutral)
    np.testing.assert_allclose(panda.pose("tool")[1], panda_like().pose(panda.neutral[None], "tool")[1][0], atol=1e-12)
    assert load_stack("sawyer").stack(panda).problem(panda).n == 7
    humanoid = named_robot("humanoid")
    assert humanoid.nv == 35
    humanoid.update(humanoid.neutral)
    left, right = (humanoid.pose(f"{side}_sole") for side in ("left", "right"))
    for rotation, position in (left, right):
        np.testing.assert_allclose(rotation, np.eye(3), atol=1e-9)
        assert abs(position[2]) < 1e-5
    # Mirror images: the centre of mass is in the middle, above the soles.
    com = humanoid.center_of_mass()
    assert abs(com[1]) < 1e-9
    assert abs(com[0] - left[1][0]) < 0.1
    lower, upper = humanoid.lower[6:], humanoid.upper[6:]
    neutral = humanoid.neutral[7:]
    assert ((lower <= neutral) & (neutral <= upper)).all()


@pytest.mark.parametrize(
    ("name", "error", "text"),
    [
        ("sawyr", UnknownNameError, "no robot or model file named 'sawyr'. Did you mean 'sawyer'"),
        ("planar0", UnknownNameError, "planar0"),
        ("models/none.xml", RobotError, "'models/none.xml' does not exist"),
    ],
)
def test_robots_that_there_are_not(name: str, error: type[HqpError], text: str) -> None:
    with pytest.raises(error, match=text):
        named_robot(name)


LEVEL = "[[level]]\n[[level.task]]\n"


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("[[level]\n", FileError, r"s.toml: not valid TOML: .* line 1"),
        ("", SettingError, "s.toml: there is no level"),
        ("levels = 1", SettingError, "s.toml: There is no setting of a stack named 'levels'. Did you mean 'level'"),
        ("[[level]]\ntasks = 1", SettingError, "level 1: There is no setting of a level named 'tasks'"),
        ("[[level]]\nname = 'a'", SettingError, "level 1 is empty"),
        ("[[level]]\nname = 3", SettingError, "level 1: name is 3"),
        ("[[level]]\ntask = 3", SettingError, r"write tables, such as \[\[level.task\]\]"),
        ("level = 3", SettingError, r"write tables, such as \[\[level\]\]"),
        (LEVEL + "frame = 'tool'", SettingError, "level 1, task 1 has no type; give one of center_of_mass"),
        (LEVEL + "type = 'positon'", UnknownNameError, "level 1, task 1: .* Did you mean 'position'"),
        (LEVEL + "type = 'position'", SettingError, r"task 1 \(position\) has no frame"),
        (LEVEL + "type = 'position'\nframe = 'tol'", RobotError, "level 1, task 1 .*'tol'. Did you mean 'tool'"),
        (LEVEL + "type = 'position'\nframe = 3", RobotError, "no frame .* named 3"),
        (LEVEL + "type = 'position'\nframe = 'tool'\ngian = 1", SettingError, "'gian'. Did you mean 'gain'"),
        (LEVEL + "type = 'position'\nframe = 'tool'\ngain = -1", SettingError, r"s.toml: level 1, task 1 .*gain"),
        (LEVEL + "type = 'position'\nframe = 'tool'\naxes = 'xw'", SettingError, "no axis 'w'"),
        (LEVEL + "type = 'posture'\njoints = ['jint1']", RobotError, "'jint1'. Did you mean 'joint1'"),
        (LEVEL + "type = 'posture'\ntarget = [0.0]", RobotError, "s.toml: .*nq = 7"),
        (LEVEL + "type = 'pose'\nframe = 'tool'\ntarget = {}", SettingError, "target has the keys none"),
        ("[[limit]]\ntype = 'joint'\n" + LEVEL + "type = 'posture'", SettingError, "write dt = 0.01"),
        ("dt = 0\n" + LEVEL + "type = 'posture'", SettingError, "dt is 0"),
        (
            "dt = 1\n[[limit]]\ntype = 'joints'\n" + LEVEL + "type = 'posture'",
            UnknownNameError,
            "hard limit 1: .*'joints'",
        ),
    ],
)
def test_mistakes_are_named(text: str, error: type[HqpError], words: str) -> None:
    with pytest.raises(error, match=words):
        parse_stack(text, "s.toml").stack(MujocoRobot.from_arm(sawyer()))


def test_files_that_cannot_be_read(tmp_path: pathlib.Path) -> None:
    with pytest.raises(FileError, match=r"sawyr: there is no such stack file; .* one of dual_sawyer, humanoid"):
        load_stack("sawyr")
    with pytest.raises(FileError, match=r"none.toml: there is no such stack file"):
        load_stack(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match="cannot be read"):
        load_stack(tmp_path / "bytes.toml")


def test_points_parts_and_limits_on_frames() -> None:
    robot = MujocoRobot.from_arm(sawyer())
    text = """
    dt = 0.01
    [[limit]]
    type = "cone"
    frame = "tool"
    direction = [0, 0, -1]
    angle = 1.0
    [[limit]]
    type = "pose"
    frame = "tool"
    lower = [-inf, -1.0]
    upper = [0.8, 1.0]
    axes = ["x", "rz"]
    relative_to = "link2"
    origin = { position = [0.1, 0.2, 0.3], rotation = [1, 0, 0, 0] }
    [[limit]]
    type = "frame_speed"
    frame = "tool"
    linear = 0.25
    [[level]]
    [[level.task]]
    type = "look_at"
    frame = "tool"
    target = [1, 0, 0]
    point = [0, 0, 0.1]
    [[level.limit]]
    type = "support_polygon"
    points = { link1 = [[1, 1, 0], [-1, 1, 0], [-1, -1, 1]] }
    [[level]]
    [[level.task]]
    type = "position"
    frame = "tool"
    point = [0, 0, 0.2]
    [[level]]
    [[level.task]]
    type = "center_of_mass"
    bodies = ["link5"]
    """
    polygon = SupportPolygonLimit({"link1": [[1, 1, 0], [-1, 1, 0], [-1, -1, 1]]})
    tool = robot.pose("tool")[1] + robot.pose("tool")[0] @ [0, 0, 0.2]
    origin = ([1, 0, 0, 0], [0.1, 0.2, 0.3])
    written = Stack(
        [
            [LookAtTask("tool", [1, 0, 0], point=[0, 0, 0.1]), polygon],
            PositionTask("tool", tool, point=[0, 0, 0.2]),
            CenterOfMassTask(robot.part_center_of_mass(["link5"])[0], bodies=["link5"]),
        ],
        [
            ConeLimit("tool", [0, 0, -1], 1.0),
            PoseLimit("tool", [-np.inf, -1.0], [0.8, 1.0], axes=["x", "rz"], relative_to="link2", origin=origin),
            FrameSpeedLimit("tool", 0.25),
        ],
    )
    same(parse_stack(text).stack(robot).problem(robot, 0.01), written.problem(robot, 0.01))
    looking = "[[level]]\n[[level.task]]\ntype = 'look_at'\nframe = 'tool'"
    with pytest.raises(SettingError, match="there is no target; give the place to look at"):
        parse_stack(looking).stack(robot)


def test_a_metric_is_the_inertia_or_weights_by_joint():
    task = '[[level]]\n[[level.task]]\ntype = "position"\nframe = "tool"\n'
    robot = named_robot("sawyer")
    for line, expected in (
        ('metric = "inertia"\n', robot.mass_matrix()),
        ('metric = { joint1 = 10.0, "joint[23]" = 4.0 }\n', np.diag([10.0, 4.0, 4.0, 1.0, 1.0, 1.0, 1.0])),
    ):
        stack = parse_stack(line + task).stack(robot)
        np.testing.assert_allclose(stack.problem(robot).metric, expected)
    assert parse_stack(task).stack(robot).problem(robot).metric is None
    for line, words in (
        ('metric = "mass"\n', 'give "inertia"'),
        ("metric = { joint1 = 0.0 }\n", "must be a number > 0"),
    ):
        with pytest.raises(SettingError, match=words):
            parse_stack(line + task)
