"""Nothing that a model file says is dropped in silence: limits, couplings, loops, keyframes, in both libraries."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from hqp_rp import HqpError, RobotError, SettingError, solve
from hqp_rp.control import (
    AccelerationStack,
    JointCoupling,
    JointLimit,
    JointLimitPotential,
    LockedJoints,
    PoseLimit,
    PositionTask,
    PostureTask,
    Stack,
    TorqueLimit,
    VelocityLimit,
)
from hqp_rp.control.stack_file import parse_stack
from hqp_rp.robot import Coupling, DHArm, MujocoRobot, PinocchioRobot, load_robot
from tests.robot.models import URDF

LIBRARIES = pytest.mark.parametrize("library", ["mujoco", "pinocchio"])
LINK = (
    '<link name="{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    "</link>"
)
JOINT = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>'
    '<limit lower="{3}" upper="{4}" velocity="{5}" effort="1"/>{6}</joint>'
)


def urdf(folder: Path, second: tuple[object, object, object, str] = (-1, 1, 2, "")) -> Path:
    path = folder / "arm.urdf"
    links = "".join(LINK.format(name) for name in ("base", "a", "b", "tool"))
    joints = (
        JOINT.format("j1", "base", "a", -1, 1, 2, "")
        + JOINT.format("j2", "a", "b", *second)
        + JOINT.format("j3", "b", "tool", -1, 1, 2, "")
    )
    path.write_text(f'<robot name="arm">{links}{joints}</robot>')
    return path


FLOATING = """
<mujoco><worldbody>
  <body name="pelvis"><freejoint name="root"/><geom size="0.1"/>
    <body name="left" pos="0 0.2 0"><joint name="left_hip" axis="0 1 0" range="-60 60"/><geom size="0.05"/>
      <body name="left_foot" pos="0 0 -0.4"><joint name="left_knee" axis="0 1 0" range="0 90"/><geom size="0.05"/></body></body>
    <body name="right" pos="0 -0.2 0"><joint name="right_hip" axis="0 1 0" range="-60 60"/><geom size="0.05"/></body>
    <body name="head" pos="0 0 0.3"><joint name="neck" type="ball" {ball}/><geom size="0.05"/></body>
  </body></worldbody>
  {more}
  <keyframe><key name="home" qpos="0 0 1 1 0 0 0 0.1 0.2 0.3 1 0 0 0"/></keyframe>
</mujoco>
"""


def floating(folder: Path, ball: str = "", more: str = "", **named: Any) -> MujocoRobot:
    path = folder / "biped.xml"
    path.write_text(FLOATING.format(ball=ball, more=more))
    robot = load_robot(path, **named)
    assert isinstance(robot, MujocoRobot)
    return robot


def test_names_beside_a_free_joint(tmp_path: Path) -> None:
    robot = floating(tmp_path)
    assert robot.joint_widths == (6, 1, 1, 1, 3)
    posture = PostureTask(robot.neutral, joints=["left_knee", "right_hip"])
    J, _ = posture.evaluate(robot)
    np.testing.assert_array_equal(np.flatnonzero(J.any(axis=0)), [7, 8])
    J, _ = PostureTask(robot.neutral, joints=["left_*"], gain=2.0).evaluate(robot)
    np.testing.assert_array_equal(np.flatnonzero(J.any(axis=0)), [6, 7])
    upper = VelocityLimit({"*_hip": 2.0, "left_hip": 1.0, "left_knee": 3.0}).rows(robot, 0.01, None)[2]
    assert upper[6:9].tolist() == [1.0, 3.0, 2.0]
    assert np.isinf(upper[:6]).all()
    with pytest.raises(
        RobotError,
        match=r"joint 'root' has 6 velocities, so its name has no single index; give velocity indices 0 to 5",
    ):
        VelocityLimit({"root": 1.0}).rows(robot, 0.01, None)
    with pytest.raises(RobotError, match=r"no hinge or slide matches 'arm_\*'; the joints are root, left_hip"):
        PostureTask(robot.neutral, joints=["arm_*"]).evaluate(robot)
    with pytest.raises(RobotError, match="a joint is given twice"):
        PostureTask(robot.neutral, joints=["left_*", "left_hip"]).evaluate(robot)
    for joint in (1.5, None, True):
        with pytest.raises(
            RobotError, match=rf"{joint} is no joint; give a name, a pattern such as 'left_\*', or a velocity"
        ):
            PostureTask(robot.neutral, joints=[joint]).evaluate(robot)  # type: ignore[list-item]
    torque = TorqueLimit({"left_*": 5.0, "left_hip": 7.0})
    np.testing.assert_allclose(np.subtract(*torque.rows(robot, 0.01, np.zeros(robot.nv))[:0:-1]), [14.0, 10.0])
    box = JointLimit(velocity={"*": 3.0}, acceleration={"*_knee": 10.0}).rows(robot, 0.1, np.zeros(robot.nv))
    np.testing.assert_allclose(box[2][[0, 7, 8]], [np.inf, 1.0, 3.0])


def test_locked_joints(tmp_path: Path) -> None:
    robot = floating(tmp_path)
    tasks = [PositionTask("left_foot", robot.pose("left_foot")[1] + [0.1, 0.0, 0.1])]
    for limit, still in (
        (LockedJoints(["left_*"]), [6, 7]),
        (LockedJoints(all_but=["left_hip", "left_knee"]), [*range(6), 8, 9, 10, 11]),
        (LockedJoints([0, 1, "right_hip"]), [0, 1, 8]),
        (LockedJoints(["left_*", "*_hip", 7]), [6, 7, 8]),
    ):
        x = solve(Stack(tasks, [limit]).problem(robot, 0.01), "hierarchical_active_set").x
        assert x is not None
        np.testing.assert_allclose(x[still], 0.0, atol=1e-15)
        assert np.abs(x).max() > 0.01
    for named in ({}, {"joints": [0], "all_but": [1]}, {"joints": "left_hip"}, {"joints": []}):
        with pytest.raises(SettingError, match="give"):
            LockedJoints(**named)  # type: ignore[arg-type]
    file = 'dt = 0.01\n[[level]]\n[[level.task]]\ntype = "posture"\n[[limit]]\ntype = "locked"\njoints = ["*_hip"]\n'
    assert parse_stack(file).stack(robot).problem(robot, 0.01).hard_rows == 2
    with pytest.raises(RobotError, match=r"no hinge or slide matches 'arm_\*'; the joints are root"):
        parse_stack(file.replace("*_hip", "arm_*")).stack(robot)
    names = ["left_*"]
    limit = LockedJoints(names)
    names.append("right_hip")
    assert len(limit.rows(robot, 0.01, None)[0]) == 2


@LIBRARIES
def test_names_of_joints_in_the_velocity_limit_of_a_robot(tmp_path: Path, library: str) -> None:
    path = urdf(tmp_path)
    robot = load_robot(path, library, floating_base=True, velocity_limit={"j[12]": 1.0, "j2": 3.0, "root_joint": 4.0})
    np.testing.assert_array_equal(robot.velocity_limit, [4.0] * 6 + [1.0, 3.0, np.inf])
    with pytest.raises(RobotError, match=r"velocity_limit: There is no joint named 'k\*'. Valid: j1, j2, j3"):
        load_robot(path, library, velocity_limit={"k*": 1.0})


@LIBRARIES
@pytest.mark.parametrize("value", [0.4, 0])
def test_equal_limits_lock_a_joint(tmp_path: Path, library: str, value: float) -> None:
    with pytest.warns(UserWarning, match="joint 'j2' at 0, outside its limits") if value else _nothing():
        robot = load_robot(urdf(tmp_path, (value, value, 2, "")), library)
    for loaded in (robot, pickle.loads(pickle.dumps(robot))):
        np.testing.assert_allclose(loaded.lower, [-1.0, value, -1.0])
        np.testing.assert_allclose(loaded.upper, [1.0, value, 1.0])
    robot.update(np.array([0.0, value, 0.0]))
    stack = Stack([PositionTask("tool", [0.0, 2.0, 0.0])], [JointLimit()])
    x = solve(stack.problem(robot, 0.01, np.zeros(3)), "hierarchical_active_set").x
    assert x is not None
    assert abs(x[1]) < 1e-12


def test_a_joint_locked_at_0_in_a_compiled_model(tmp_path: Path) -> None:
    source = MujocoRobot.from_file(urdf(tmp_path, (0, 0, 2, "")))
    robot = PinocchioRobot.from_mujoco(source.model)
    np.testing.assert_array_equal(robot.lower, source.lower)
    np.testing.assert_array_equal(robot.upper, [1.0, 0.0, 1.0])


@LIBRARIES
@pytest.mark.parametrize(("stated", "limits"), [('lower="-0.5"', (-0.5, 0.0)), ('upper="0.5"', (0.0, 0.5))])
def test_one_limit_of_two(tmp_path: Path, library: str, stated: str, limits: tuple[float, float]) -> None:
    path = urdf(tmp_path)
    text = path.read_text().replace('lower="-1" upper="1"', "@").replace("@", 'lower="-1" upper="1"', 1)
    path.write_text(text.replace("@", stated, 1).replace("@", 'lower="-1" upper="1"'))
    robot = load_robot(path, library)
    assert (robot.lower[1], robot.upper[1]) == limits
    path.write_text(path.read_text().replace(stated, 'lower="0"'))
    with pytest.warns(
        UserWarning, match="'j2' state one of lower and upper, as 0, and not the other; taken for joints"
    ):
        robot = load_robot(path, library)
    assert np.isinf([robot.lower[1], robot.upper[1]]).all()
    path.write_text(path.read_text().replace('lower="0"', 'lower="0.4"'))
    with pytest.raises(
        RobotError, match=r"^The URDF .*'j2' has lower 0.4 > upper 0 \(0 where it states none\); mend the"
    ):
        load_robot(path, library)


@LIBRARIES
@pytest.mark.filterwarnings("ignore:MuJoCo. XML contains a .NaN.")  # before it is refused
def test_limits_that_make_no_sense(tmp_path: Path, library: str) -> None:
    with pytest.raises(RobotError, match="joint 'j2' has lower 1 > upper -1"):
        load_robot(urdf(tmp_path, (1, -1, 2, "")), library)
    with pytest.raises(RobotError, match="joint 'j2' has the velocity limit -2; it must be >= 0"):
        load_robot(urdf(tmp_path, (-1, 1, -2, "")), library)
    with pytest.warns(UserWarning, match="joint 'j2' has the velocity limit 0, so it may not move"):
        load_robot(urdf(tmp_path, (-1, 1, 0, "")), library)
    for given in (None, 1.0):
        with pytest.raises(RobotError, match="joint 'j2' has the velocity limit -2"):
            load_robot(urdf(tmp_path, (-1, 1, -2, "")), library, velocity_limit=given)
    with pytest.raises(RobotError, match="joint 'j2' has the upper limit 'nan'; it must be a number"):
        load_robot(urdf(tmp_path, (-1, "nan", 2, "")), library)
    path = urdf(tmp_path, (-1, 1, 0, ""))
    np.testing.assert_array_equal(load_robot(path, library, velocity_limit=1.0).velocity_limit, [1.0] * 3)
    path.write_text(path.read_text().replace('velocity="2"', 'velocity="0"'))
    with pytest.warns(
        UserWarning, match="joints 'j1', 'j2', 'j3' have the velocity limit 0, so they may not move"
    ) as told:
        load_robot(path, library)
    assert len(told) == 1


@LIBRARIES
def test_a_joint_that_follows_another(tmp_path: Path, library: str) -> None:
    robot = load_robot(urdf(tmp_path, (-1, 1, 2, '<mimic joint="j1" multiplier="-2" offset="0.1"/>')), library)
    (coupling,) = robot.couplings  # type: ignore[attr-defined]
    assert (coupling.joint, coupling.source, coupling.coefficients[:2]) == ("j2", "j1", (0.1, -2.0))
    robot.update(np.array([0.2, -0.1, 0.3]))
    task = PositionTask("tool", robot.pose("tool")[1] + [0.0, 0.3, 0.0], axes="xy")
    stack = Stack([task], [JointCoupling(gain=5.0), VelocityLimit()])
    x = solve(stack.problem(robot, 0.01), "hierarchical_active_set").x
    assert x is not None
    assert x[1] + 2.0 * x[0] == pytest.approx(-5.0 * (-0.1 - 0.1 + 0.4), abs=1e-12)
    for _ in range(400):
        x = solve(stack.problem(robot, 0.01), "hierarchical_active_set").x
        robot.update(robot.integrate(robot.q, x, 0.01))  # type: ignore[arg-type]
    assert robot.q[1] == pytest.approx(0.1 - 2.0 * robot.q[0], abs=1e-6)
    with pytest.warns(
        UserWarning, match=r"joints 'j2' follow others, which this stack does not hold; add JointCoupling\(\)"
    ):
        Stack([task]).problem(robot)
    with pytest.warns(UserWarning, match="joints 'j2' follow others"):
        Stack([task], [LockedJoints(["j2"])]).problem(robot, 0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Stack([task], [LockedJoints(["j1", "j2"])]).problem(robot, 0.01)  # neither moves: nothing is left to hold


@LIBRARIES
def test_a_joint_that_follows_a_fixed_one_or_none(tmp_path: Path, library: str) -> None:
    mimic = '<mimic joint="j1" multiplier="2" offset="0.5"/>'
    path = urdf(tmp_path, (-1, 1, 2, mimic))
    path.write_text(path.read_text().replace('name="j1" type="revolute"', 'name="j1" type="fixed"'))
    robot = load_robot(path, library)
    G, lower, upper = JointCoupling(gain=2.0).rows(robot, 0.01, None)
    assert G.tolist() == [[1.0, 0.0]]
    assert lower.tolist() == upper.tolist() == [1.0]  # j2 goes to 0.5
    path.write_text(
        urdf(tmp_path, (-1, 1, 2, mimic)).read_text().replace('name="j2" type="revolute"', 'name="j2" type="fixed"')
    )
    assert load_robot(path, library).couplings == ()  # type: ignore[attr-defined]
    for absent in ("jx", "j2"):
        path = urdf(tmp_path, (-1, 1, 2, f'<mimic joint="{absent}"/>'))
        if absent == "j2" and library == "mujoco":
            continue  # MuJoCo does not compile it
        with pytest.warns(
            UserWarning, match=f"joint 'j2' mimics '{absent}', which is no other hinge or slide of the file, so"
        ):
            assert load_robot(path, library).couplings == ()  # type: ignore[attr-defined]


@LIBRARIES
def test_continuous_joints_that_follow(tmp_path: Path, library: str) -> None:
    path = urdf(tmp_path, (-1, 1, 2, '<mimic joint="j1" multiplier="2"/>'))
    path.write_text(path.read_text().replace('type="revolute"', 'type="continuous"', 2))
    robot = load_robot(path, library)
    robot.update(robot.integrate(robot.neutral, np.array([0.2, 0.4, 0.3]), 1.0))
    G, lower, _ = JointCoupling().rows(robot, 0.01, None)
    assert G.tolist() == [[-2.0, 1.0, 0.0]]
    assert lower[0] == pytest.approx(0.0, abs=1e-15)
    if library == "pinocchio":
        curve = JointCoupling([Coupling("j2", "j1", (0.0, 1.0, 1.0))])
        with pytest.raises(
            RobotError, match="'j2' follows 'j1' by a curve, but the position of the latter is no coordinate"
        ):
            curve.rows(robot, 0.01, None)


def test_couplings_of_ones_own(tmp_path: Path) -> None:
    mimic = '<mimic joint="j1" multiplier="2"/>'
    path = urdf(tmp_path, (-1, 1, 2, mimic))
    path.write_text(path.read_text().replace('effort="1"/></joint></robot>', f'effort="1"/>{mimic}</joint></robot>'))
    robot = load_robot(path)
    first, second = robot.couplings  # type: ignore[attr-defined]
    with pytest.warns(UserWarning, match="the joints 'j3' follow others"):
        Stack([PostureTask(robot.neutral)], [JointCoupling([first])]).problem(robot, 0.01)
    Stack([PostureTask(robot.neutral)], [JointCoupling([first]), JointCoupling([second])]).problem(robot, 0.01)
    robot.update(np.array([0.0, 0.1, 0.0]))
    _, lower, _ = JointCoupling([first], gain=1e3).rows(robot, 0.1, None)
    assert lower == pytest.approx(-1.0)  # in one step there, not beyond
    file = 'dt = 0.01\n[[level]]\n[[level.task]]\ntype = "posture"\n[[limit]]\ntype = "coupling"\n'
    follows = '{{joint = "{}", source = "j1", coefficients = [0, 2]}}'
    file += f"couplings = [{follows.format('j2')}, {follows.format('j3')}]"
    assert parse_stack(file).stack(robot).problem(robot, 0.01).hard_rows == 2
    for couplings, message in (
        ([("j2", "j1")], "the couplings of 'joint coupling' are .* give Couplings, or mappings of joint, source"),
        ((), "give Couplings, or mappings"),
        ([{"joint": "j2"}], "it must have joint and coefficients, and may have source, own, reference"),
        ([{"joint": "j2", "source": "j2", "coefficients": [1.0]}], "both must be names of joints, two different ones"),
        ([{"joint": "j2", "source": "j1", "coefficients": [np.nan]}], "give finite numbers, such as coefficients"),
    ):
        with pytest.raises(SettingError, match=message):
            JointCoupling(couplings)  # type: ignore[arg-type]


def test_the_rows_of_a_coupling_are_a_derivative(tmp_path: Path) -> None:
    more = '<equality><joint joint1="left_knee" joint2="left_hip" polycoef="0.1 0.5 -0.3 0.2 0"/></equality>'
    robot = floating(tmp_path, more=more)
    q = np.array(robot.neutral)
    q[7:10] = 0.3, 0.7, -0.2
    robot.update(q)
    G, lower, _ = JointCoupling(gain=1.0).rows(robot, 0.01, None)
    rng, step = np.random.default_rng(0), 1e-6
    for _ in range(3):
        v = rng.standard_normal(robot.nv)
        residuals = []
        for sign in (1, -1):
            robot.update(robot.integrate(q, sign * v, step))
            residuals.append(-JointCoupling(gain=1.0).rows(robot, 0.01, None)[1][0])
        robot.update(q)
        assert G[0] @ v == pytest.approx((residuals[0] - residuals[1]) / (2 * step), abs=1e-8)
    assert lower[0] == pytest.approx(-(0.7 - (0.1 + 0.15 - 0.3 * 0.09 + 0.2 * 0.027)))
    with pytest.raises(RobotError, match="couples no joints"):
        JointCoupling().rows(floating(tmp_path), 0.01, None)
    with pytest.raises(SettingError, match="gain of 'joint coupling' is -1"):
        JointCoupling(gain=-1.0)


def test_a_loop_is_said(tmp_path: Path) -> None:
    more = '<equality><connect name="loop" body1="left_foot" body2="right" anchor="0 0 0"/></equality>'
    robot = floating(tmp_path, more=more)
    assert robot.loops == ("loop",)
    with pytest.warns(UserWarning, match=r"the equality constraints 'loop' \(loops\), which no stack holds"):
        Stack([PostureTask(robot.neutral)]).problem(robot)
    more = """<equality><connect body1="left_foot" body2="right" anchor="0 0 0"/><weld body1="head" active="false"/>
        <joint joint1="left_knee" joint2="left_hip"/></equality>"""
    robot = floating(tmp_path, more=more)
    with pytest.warns(
        UserWarning, match=r"'left_knee' follow others.* constraints 'connect of left_foot and right'"
    ) as told:
        Stack([PostureTask(robot.neutral)]).problem(robot)
    assert len(told) == 1
    with pytest.warns(
        UserWarning, match=r"^The robot's model has the equality constraints 'connect of left_foot and right'"
    ):
        Stack([PostureTask(robot.neutral)], [JointCoupling()]).problem(robot, 0.01)


def test_a_ball_joint_with_a_range(tmp_path: Path) -> None:
    robot = floating(tmp_path, ball='limited="true" range="0 30"')
    assert robot.limited_balls == ("neck",)
    with pytest.raises(RobotError, match="the ball joint 'neck' has a range, which no box on velocities holds"):
        JointLimit().rows(robot, 0.01, np.zeros(robot.nv))
    JointLimit(position=False, velocity=1.0).rows(robot, 0.01, np.zeros(robot.nv))
    with pytest.warns(UserWarning, match="the ball joint 'neck' has a range, which the potential leaves out"):
        JointLimitPotential().velocity(robot)


def test_keyframes(tmp_path: Path) -> None:
    robot = floating(tmp_path, neutral="home")
    np.testing.assert_allclose(robot.neutral[7:10], [0.1, 0.2, 0.3])
    other = load_robot(tmp_path / "biped.xml", "pinocchio", neutral="home")
    np.testing.assert_allclose(other.neutral[7:10], [0.1, 0.2, 0.3])
    with pytest.raises(RobotError, match="has no keyframe 'stand'; it has home"):
        floating(tmp_path, neutral="stand")
    with pytest.raises(RobotError, match="has no keyframe ''; it has home"):
        floating(tmp_path, neutral="")
    with pytest.raises(RobotError, match="neutral is 'home', but a URDF has no keyframes, nor has the Pinocchio model"):
        PinocchioRobot(PinocchioRobot.from_file(urdf(tmp_path)).model, neutral="home")
    with pytest.raises(RobotError, match="a URDF has no keyframes"):
        load_robot(urdf(tmp_path), "pinocchio", neutral="home")


def test_a_neutral_outside_the_limits_is_said(tmp_path: Path) -> None:
    robot = floating(tmp_path)
    q = np.array(robot.neutral)
    q[8] = -0.3
    with pytest.warns(
        UserWarning, match=r"joint 'left_knee' at -0.3, outside its limits \[0, 1.5708\]; give another with neutral="
    ):
        MujocoRobot(robot.model, neutral=q)
    path = urdf(tmp_path)
    other = PinocchioRobot.from_file(path)
    for make in (
        lambda: PinocchioRobot(other.model, neutral=[0.0, 2.0, 0.0]),
        lambda: PinocchioRobot.from_file(path, neutral=[0.0, 2.0, 0.0]),
    ):
        with pytest.warns(UserWarning, match="joint 'j2' at 2, outside its limits") as told:
            made = make()
        assert len(told) == 1
        assert pickle.loads(pickle.dumps(made)).neutral.tolist() == [0.0, 2.0, 0.0]  # said once, not again


@LIBRARIES
def test_integrating_no_answer(tmp_path: Path, library: str) -> None:
    robot = load_robot(urdf(tmp_path), library)
    with pytest.raises(HqpError, match="v is None: the solve gave no x"):
        robot.integrate(robot.q, None, 0.01)  # type: ignore[arg-type]


def _nothing() -> Any:
    import contextlib

    return contextlib.nullcontext()


def hinges(ranges: str, count: int = 3, angle: str = "") -> mujoco.MjModel:
    body = "".join(
        f'<body pos="0 0 .1"><joint name="j{i}" axis="0 1 0" {ranges}/><geom size=".02"/>' for i in range(count)
    )
    return mujoco.MjModel.from_xml_string(f"<mujoco>{angle}<worldbody>{body}{'</body>' * count}</worldbody></mujoco>")


def test_ranges_in_the_wrong_unit_are_said() -> None:
    radian = '<compiler angle="radian"/>'
    for made in (lambda model: MujocoRobot(model), PinocchioRobot.from_mujoco):
        with pytest.warns(
            UserWarning,
            match=r"'j0' of .* has the range \[-170, 170\] rad, 54.1 turns, as do 2 more: are these degrees",
        ):
            made(hinges('range="-170 170"', angle=radian))
        with pytest.warns(
            UserWarning, match=r"Every limited hinge of .* stays within 0.0506 rad, .*radians read as degrees"
        ):
            made(hinges('range="-2.9 2.9"'))
        made(hinges('range="-170 170"'))
        made(hinges('range="-12 12"', angle=radian))
        made(hinges('range="-2.9 2.9"', count=2))  # two fingers may move that little
        made(hinges(""))


def test_a_urdf_in_degrees_is_said(tmp_path) -> None:
    path = tmp_path / "degrees.urdf"
    path.write_text(URDF.replace('lower="-1" upper="2"', 'lower="-90" upper="120"'))
    for library in ("mujoco", "pinocchio"):
        with pytest.warns(
            UserWarning, match=r"Joint 'shoulder' of .* has the range \[-90, 120\] rad, 33.4 turns: are these"
        ):
            load_robot(path, library)


def test_angles_that_look_like_degrees_are_said_wherever_they_are_given() -> None:
    for made in (lambda model: MujocoRobot(model, velocity_limit=1.0), PinocchioRobot.from_mujoco):
        robot = made(hinges('range="-170 170"'))
        robot.update(robot.neutral)
        with pytest.warns(
            UserWarning, match=r"the target of 'posture' has j1 = 90 rad, 14\.3 turns, and 1 more .* np\.radians"
        ) as told:
            Stack([PostureTask([0.5, 90.0, -45.0])]).problem(robot)
        assert len(told) == 1
        Stack([PostureTask([0.5, 2.0, 5.0])]).problem(robot)  # out of reach, and no more than a turn
        endless = made(hinges(""))
        Stack([PostureTask([9.0, 0.0, 0.0])]).problem(endless)
        with pytest.warns(UserWarning, match="j0 = 30 rad"):
            Stack([PostureTask([30.0, 0.0, 0.0])]).problem(endless)
    with pytest.warns(UserWarning, match=r"'tool bounds' has lower rz = -90 rad, 14\.3 turns, and 1 more like it"):
        PoseLimit("tool", [-9.0, -90.0], [9.0, 90.0], axes=["x", "rz"])
    PoseLimit("tool", [-np.inf], [np.inf], axes=["rz"])
    with pytest.warns(UserWarning, match=r"arm 'mine' has alpha\[0\] = 90 rad"):
        DHArm(
            name="mine",
            d=0.1,
            a=(0.2, 0.2),
            alpha=(90.0, 0.0),
            lower=-1.0,
            upper=1.0,
            velocity_limit=1.0,
            mass=1.0,
            radius=0.05,
        )


def test_joint_limits_of_a_model_without_speeds_are_said_once() -> None:
    robot = MujocoRobot(hinges('range="-170 170"'))
    posture = PostureTask(robot.neutral)
    words = r"'joint limits' bounds no speed of 'j0', 'j1' and 'j2': .* Give JointLimit\(velocity=\.\.\.\)"
    for stack in (Stack([posture], [JointLimit()]), Stack([JointLimit(), posture])):
        with pytest.warns(UserWarning, match=words) as told:
            stack.problem(robot, 0.01)
        assert len(told) == 1
        assert told[0].filename == __file__
        stack.problem(robot, 0.01)
    own = VelocityLimit(1.0)
    for limits in ([JointLimit(velocity=1.0)], [JointLimit(velocity=np.inf)], [JointLimit(), own]):
        Stack([posture], limits).problem(robot, 0.01)
    Stack([posture], [JointLimit(acceleration=5.0)]).problem(robot, 0.01, np.zeros(3))
    Stack([posture], [JointLimit()]).problem(MujocoRobot(hinges('range="-170 170"'), velocity_limit=2.0), 0.01)


def test_only_what_bounds_speeds_silences_the_warning_about_speeds() -> None:
    """Beside JointLimit(): limits of mink and pink on positions and on velocities, on all joints and on some, and locks."""
    import mink
    import pink

    model = hinges('range="-170 170"')
    robot, other = MujocoRobot(model), PinocchioRobot.from_mujoco(model)
    posture = PostureTask(robot.neutral)

    def told(robot: Any, *limits: Any) -> list[str]:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            Stack([posture], [JointLimit(), *limits]).problem(robot, 0.01, np.zeros(3))
        return [str(one.message).partition(":")[0] for one in caught]

    everything = ["'joint limits' bounds no speed of 'j0', 'j1' and 'j2'"]
    some = ["'joint limits' bounds no speed of 'j1' and 'j2'"]
    assert told(robot, mink.ConfigurationLimit(model)) == everything
    assert told(robot, mink.VelocityLimit(model, {"j0": 1.0})) == some
    assert told(robot, mink.VelocityLimit(model, {"j0": 1.0, "j1": 1.0, "j2": 1.0})) == []
    assert told(robot, mink.ConfigurationLimit(model), VelocityLimit(1.0)) == []

    limited = PinocchioRobot.from_mujoco(model).model
    limited.velocityLimit = np.array([1.0, 0.0, 0.0])  # 0 is none in pink
    assert told(other, pink.limits.ConfigurationLimit(other.model)) == everything
    assert told(other, pink.limits.VelocityLimit(limited)) == some
    assert told(other, pink.limits.AccelerationLimit(other.model, np.full(3, 5.0))) == []

    assert told(robot, JointLimit(position=False, velocity={"j0": 1.0})) == some
    assert told(robot, VelocityLimit({"j0": 1.0})) == some
    assert told(robot, LockedJoints(["j0"])) == some


def test_brakes_of_some_joints_only_beside_a_torque_limit_are_said_when_the_robot_is_met() -> None:
    robot = MujocoRobot(hinges('range="-170 170"'))
    posture, v = PostureTask(robot.neutral), np.zeros(3)
    for kind in (Stack, AccelerationStack):
        for braked in ({"acceleration": {"j0": 3.0}}, {"jerk": {"j0": 30.0}}, {"acceleration": [3.0, np.inf, np.inf]}):
            stack = kind([posture], [JointLimit(velocity=1.0, **braked), TorqueLimit({"j0": 5.0, "j1": 5.0})])
            with pytest.warns(UserWarning, match="'joint limits' asks 'j1' to stop at a position limit") as told:
                stack.problem(robot, 0.01, v, v)
            assert [one.filename for one in told] == [__file__]
            stack.problem(robot, 0.01, v, v)
        # Nothing to say of: brakes where torques are limited, and a torque limit that is soft.
        kind([posture], [JointLimit(velocity=1.0, acceleration={"j0": 3.0}), TorqueLimit({"j0": 5.0})]).problem(
            robot, 0.01, v
        )
        kind([posture, TorqueLimit(5.0)], [JointLimit(velocity=1.0, acceleration={"j0": 3.0})]).problem(robot, 0.01, v)
    # Said once, when the stack is made, where it is known then.
    with pytest.warns(UserWarning, match="asks joints to stop") as told:
        stack = Stack([posture], [JointLimit(velocity=1.0), TorqueLimit(5.0)])
    assert len(told) == 1
    stack.problem(robot, 0.01, v)
