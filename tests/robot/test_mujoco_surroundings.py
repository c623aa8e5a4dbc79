"""Mocap bodies, and bodies that no actuator moves: where they are, and that no plan moves them."""

import pickle

import mujoco
import numpy as np
import pytest

import hqp_rp
from hqp_rp.control import (
    CenterOfMassTask,
    CollisionLimit,
    JointLimit,
    LockedJoints,
    PositionTask,
    PostureTask,
    RelativePoseTask,
    Stack,
)
from hqp_rp.core.errors import RobotError
from hqp_rp.core.solution import Status
from hqp_rp.robot import MujocoRobot

SCENE = """
<mujoco model="scene">
  <worldbody>
    <body name="one" pos="0 0 0.1"><joint name="j1" axis="0 0 1" range="-170 170"/>
      <geom type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass="1"/>
      <body name="two" pos=".4 0 0"><joint name="j2" axis="0 0 1" range="-150 150"/>
        <geom type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass="1"/>
        <body name="three" pos=".4 0 0"><joint name="j3" axis="0 0 1" range="-150 150"/>
          <geom name="hand" type="sphere" size=".03" mass=".5"/><site name="tool" pos=".1 0 0"/></body></body></body>
    <body name="box" pos=".7 .4 .1"><freejoint name="box"/><geom name="box" type="sphere" size=".05" mass="3"/></body>
    <body name="door" pos="-1 0 0"><joint name="door" axis="0 0 1" range="10 20"/><geom size=".1" mass="1"/></body>
    <body name="post" mocap="true" pos=".6 -.4 .1"><geom name="post" type="sphere" size=".05"/></body>
  </worldbody>
  <actuator><motor joint="j1"/><motor joint="j2"/><motor joint="j3"/></actuator>
</mujoco>
"""
MODEL = mujoco.MjModel.from_xml_string(SCENE)
DT = 0.01


def scene(**settings) -> MujocoRobot:
    q = np.array(MODEL.qpos0)
    q[:3] = (0.2, 0.5, 0.3)
    q[-1] = np.deg2rad(15)
    return MujocoRobot(MODEL, neutral=q, **settings)


def test_trees_without_an_actuator_are_not_the_robots() -> None:
    robot = scene()
    np.testing.assert_array_equal(robot.unactuated, np.arange(3, 10))
    assert robot.joint_names == ("j1", "j2", "j3", "box", "door")
    all_of_it = scene(unactuated=())
    assert all_of_it.unactuated.size == 0
    np.testing.assert_array_equal(scene(unactuated=["door"]).unactuated, [9])
    passive = mujoco.MjModel.from_xml_string(SCENE.split("<actuator>")[0] + "</mujoco>")
    assert MujocoRobot(passive, neutral=robot.neutral).unactuated.size == 0
    np.testing.assert_allclose(robot.center_of_mass(), robot.part_center_of_mass(["one"])[0], atol=1e-14)
    assert not np.allclose(all_of_it.center_of_mass(), robot.center_of_mass())
    assert not robot.center_of_mass_jacobian()[:, 3:].any()


@pytest.mark.parametrize("solver", ["hierarchical_active_set", "qp_cascade", "weighted"])
def test_no_plan_moves_them_and_their_limits_bind_nobody(solver: str) -> None:
    robot = scene()
    q = robot.neutral.copy()
    q[-1] = 1.0  # the door stands open, far outside its range
    robot.update(q)
    levels = [
        RelativePoseTask("tool", "box", (np.eye(3), [0, 0, 0]), axes="xy"),
        [PositionTask("door", [0, 0, 0]), PositionTask("box", [9, 9, 9])],
        PostureTask(robot.neutral),
    ]
    stack = Stack(levels, [JointLimit(velocity=1.0), CollisionLimit([("hand", "box")], margin=0.0)])
    problem = stack.problem(robot, DT)
    assert not problem.matrix[:, 3:].any()
    assert problem.levels[2].m == 3
    solution = hqp_rp.solve(problem, solver)
    assert solution.status is Status.SOLVED
    x = solution.require()
    np.testing.assert_allclose(x[3:], 0.0, atol=1e-12)
    assert np.linalg.norm(x[:3]) > 0.1
    np.testing.assert_array_equal(robot.integrate(q, np.where(np.arange(10) < 3, x, 0.0), DT)[3:], q[3:])


def test_how_they_move_is_taken_into_account() -> None:
    robot = scene()
    relative = RelativePoseTask("tool", "box", (np.eye(3), [0, 0, 0]), axes="xy", gain=0.0)
    robot.unactuated_velocity = [0.1, -0.2, 0.0, 0.0, 0.0, 0.0, 0.0]
    x = hqp_rp.solve(Stack([relative]).problem(robot), "null_space").require()
    np.testing.assert_allclose((robot.jacobian("tool") @ x)[:2], [0.1, -0.2], atol=1e-12)
    limit = CollisionLimit([("hand", "box")], gain=1.0, margin=0.0)
    J, lower, _ = limit.rows(robot, DT, None)
    problem = Stack([PostureTask(robot.q)], [limit]).problem(robot, DT)
    assert problem.hard is not None
    assert problem.hard.lower[0] == pytest.approx(lower[0] - J[0, 3:] @ robot.unactuated_velocity)
    with pytest.raises(RobotError, match=r"unactuated_velocity has shape \(2,\); it must be \(7,\)"):
        robot.unactuated_velocity = [1, 2]
    with pytest.raises(ValueError, match="read-only"):
        robot.unactuated_velocity[0] = 1.0


def test_a_batch_takes_them_out_too() -> None:
    robot = scene()
    robot.unactuated_velocity = np.arange(7.0)
    stack = Stack([RelativePoseTask("tool", "box", (np.eye(3), [0, 0, 0]), axes="xy"), PostureTask(robot.neutral)])
    A, lower, _, _ = stack.batch(robot, [robot.neutral])
    problem = stack.problem(robot)
    np.testing.assert_array_equal(A[0], problem.matrix)
    np.testing.assert_array_equal(lower[0], problem.lower)


def test_only_these_move_leaves_out_what_nobody_moves() -> None:
    robot = scene()
    assert LockedJoints(all_but=["j1"]).row_names(robot) == ["j2", "j3"]


def test_a_mocap_body_is_where_it_was_put() -> None:
    robot = scene()
    limit = CollisionLimit([("hand", "post")], margin=0.0, gain=1.0)
    hand = robot.pose("three")[1]
    robot.set_mocap("post", hand + np.array([0.2, 0.0, 0.0]))
    np.testing.assert_allclose(limit.distances(robot), [0.12], atol=1e-9)
    np.testing.assert_allclose(robot.pose("post")[1], hand + np.array([0.2, 0.0, 0.0]))
    assert not robot.jacobian("post").any()
    before = limit.rows(robot, DT, None)[1][0]
    robot.set_mocap("post", velocity=[-0.3, 1.0, 0.0, 0.0, 0.0, 5.0])
    # It approaches at 0.3 m/s; its own turning about its centre moves the nearest point across.
    assert limit.rows(robot, DT, None)[1][0] == pytest.approx(before + 0.3, abs=1e-6)
    half_turn = [0.0, 0.0, 0.0, 2.0]
    robot.set_mocap("post", quaternion=half_turn)
    np.testing.assert_allclose(robot.pose("post")[0], np.diag([-1.0, -1.0, 1.0]), atol=1e-12)
    assert limit.rows(robot, DT, None)[1][0] == pytest.approx(before, abs=1e-9)


def test_a_robot_gives_way_to_what_approaches() -> None:
    robot = scene()
    limit = CollisionLimit([("hand", "post")], margin=0.02, gain=10.0)
    stack = Stack([PostureTask(robot.q, gain=5.0)], [limit])
    place, speed = robot.pose("three")[1] + np.array([0.3, 0.0, 0.0]), np.array([-0.3, 0.0, 0.0])
    q = robot.q.copy()
    for _ in range(100):
        robot.update(q)
        robot.set_mocap("post", place, velocity=[*speed, 0, 0, 0])
        q = robot.integrate(q, hqp_rp.solve(stack.problem(robot, DT), "hierarchical_active_set").require(), DT)
        place = place + DT * speed
    robot.update(q)
    robot.set_mocap("post", place)
    assert limit.distances(robot)[0] >= 0.02 - 2e-3
    assert np.abs(q[:3] - robot.neutral[:3]).max() > 0.1


def test_a_state_of_the_simulation_is_followed() -> None:
    robot = scene()
    data = mujoco.MjData(MODEL)
    rng = np.random.default_rng(1)
    data.qpos[:3], data.qvel[:] = rng.normal(size=3), rng.normal(size=10)
    data.mocap_pos[0] = (1, 2, 3)
    robot.set_mocap("post", velocity=np.ones(6))
    robot.follow(data)
    np.testing.assert_array_equal(robot.q, data.qpos)
    np.testing.assert_array_equal(robot.unactuated_velocity, data.qvel[3:])
    np.testing.assert_array_equal(robot.pose("post")[1], [1, 2, 3])
    assert robot.mocap_twist(MODEL.geom("post").id) is None
    other = mujoco.MjData(
        mujoco.MjModel.from_xml_string("<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>")
    )
    for wrong in (other, None, MODEL):
        with pytest.raises(RobotError, match="data is no state of the MuJoCo model 'scene'"):
            robot.follow(wrong)


def test_a_copy_keeps_the_surroundings() -> None:
    robot = scene(unactuated=["box"])
    robot.set_mocap("post", [1, 2, 3], velocity=[1, 0, 0, 0, 0, 0])
    robot.unactuated_velocity = np.arange(6.0)
    copy = pickle.loads(pickle.dumps(robot))
    np.testing.assert_array_equal(copy.unactuated, robot.unactuated)
    np.testing.assert_array_equal(copy.unactuated_velocity, np.arange(6.0))
    np.testing.assert_array_equal(copy.pose("post")[1], [1, 2, 3])
    np.testing.assert_array_equal(copy.mocap_twist(MODEL.geom("post").id), robot.mocap_twist(MODEL.geom("post").id))
    np.testing.assert_array_equal(copy.center_of_mass(), robot.center_of_mass())


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (lambda robot: robot.set_mocap("pst", [0, 0, 0]), "There is no mocap body named 'pst'. Did you mean 'post'"),
        (lambda robot: robot.set_mocap("one", [0, 0, 0]), "There is no mocap body named 'one'"),
        (lambda robot: robot.set_mocap("post", [0, 0]), r"the position of the mocap body 'post' has shape \(2,\)"),
        (lambda robot: robot.set_mocap("post", [0, 0, np.nan]), "is nan; every entry must be finite"),
        (
            lambda robot: robot.set_mocap("post", quaternion=[0, 0, 0, 0]),
            "the quaternion of the mocap body 'post' is zero",
        ),
        (lambda robot: robot.set_mocap("post", velocity=[1, 2, 3]), r"the velocity of the mocap body 'post' has shape"),
        (lambda robot: scene(unactuated=["dor"]), "unactuated: .*'dor'"),
        (lambda robot: scene(unactuated=["j1", "box", "door"]), "leaves the MuJoCo model 'scene' no joint to move"),
    ],
)
def test_bad_input(act, message) -> None:
    robot = scene()
    with pytest.raises(RobotError, match=message):
        act(robot)
    np.testing.assert_allclose(robot.pose("post")[1], [0.6, -0.4, 0.1])


def test_a_task_on_parts_of_the_robot_does_not_see_the_box() -> None:
    robot = scene()
    task = CenterOfMassTask(robot.center_of_mass())
    np.testing.assert_allclose(task.error(robot), 0.0, atol=1e-15)
