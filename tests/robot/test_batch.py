"""Many configurations in one call: the same as one by one, whatever the robot, and the derivative of the pose."""

import copy
import dataclasses

import numpy as np
import pytest

from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.robot import DHArm, MujocoRobot, PinocchioRobot, Robot, frame_batch, planar_arm, sawyer
from hqp_rp.robot.frames import Frames, Point, frames_of
from hqp_rp.robot.named import named_robot
from tests.control.chain import random_chain
from tests.robot.models import ARMS


def draws(robot: Robot | DHArm, count: int, seed: int = 0) -> np.ndarray:
    n = robot.n if isinstance(robot, DHArm) else robot.nv
    steps = np.random.default_rng(seed).uniform(-3.0, 3.0, (count, n))
    return steps if isinstance(robot, DHArm) else np.array([robot.integrate(robot.neutral, v, 1.0) for v in steps])


def check_against_single_calls(robot: Robot, frame: str, q: np.ndarray, found) -> None:
    assert found.rotations.shape == (len(q), 3, 3)
    assert found.origins.shape == (len(q), 3)
    assert found.jacobians.shape == (len(q), 6, robot.nv)
    for i, configuration in enumerate(q):
        robot.update(configuration)
        rotation, origin = robot.pose(frame)
        np.testing.assert_allclose(found.rotations[i], rotation, atol=3e-15)
        np.testing.assert_allclose(found.origins[i], origin, atol=3e-15)
        np.testing.assert_allclose(found.jacobians[i], robot.jacobian(frame), atol=4e-15)


# 1 to 17: no whole eight, one and a remainder, several.
@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 17])
@pytest.mark.parametrize("arm", ARMS, ids=[arm.name for arm in ARMS])
def test_arms_are_computed_as_mujoco_computes_them(arm: DHArm, count: int) -> None:
    q = draws(arm, count)
    robot = MujocoRobot.from_arm(arm)
    for frame in arm.frame_names:
        check_against_single_calls(robot, frame, q, frame_batch(arm, frame, q, threads=1))


@pytest.mark.parametrize("arm", [sawyer(), planar_arm(4)], ids=["sawyer", "planar4"])
def test_the_jacobian_is_the_derivative_of_the_pose(arm: DHArm) -> None:
    q, h = draws(arm, 21, seed=1), 1e-5
    for frame in ("tool", "link3"):
        found = frame_batch(arm, frame, q)
        for k in range(arm.n):
            ahead, behind = (frame_batch(arm, frame, q + s * h * np.eye(arm.n)[k]) for s in (1.0, -1.0))
            linear = (ahead.origins - behind.origins) / (2.0 * h)
            np.testing.assert_allclose(found.jacobians[:, :3, k], linear, atol=1e-9)
            spin = (ahead.rotations - behind.rotations) / (2.0 * h) @ found.rotations.transpose(0, 2, 1)
            angular = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
            np.testing.assert_allclose(found.jacobians[:, 3:, k], angular, atol=1e-9)


def test_the_number_of_threads_and_the_neighbours_change_nothing() -> None:
    arm = sawyer()
    q = draws(arm, 6100)  # enough for several threads
    alone = frame_batch(arm, "tool", q, threads=1)
    for threads in (2, 3, None):
        for one, other in zip(alone, frame_batch(arm, "tool", q, threads=threads), strict=True):
            np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(frame_batch(arm, "tool", q[37:38]).jacobians[0], alone.jacobians[37])
    np.testing.assert_array_equal(arm.jacobian(q[37]), alone.jacobians[37])


@pytest.mark.parametrize("name", ["humanoid", "dual_sawyer", "sawyer"])
def test_every_other_robot_is_moved_and_put_back(name: str) -> None:
    robot = named_robot(name)
    frame = robot.frame_names[-1]
    q = draws(robot, 5)
    robot.update(q[3])
    found = frame_batch(robot, frame, q, threads=1)
    np.testing.assert_array_equal(robot.q, q[3])
    check_against_single_calls(robot, frame, q, found)


def test_robots_of_pinocchio_and_of_a_user() -> None:
    for robot in (PinocchioRobot.from_arm(sawyer()), random_chain(np.random.default_rng(2))):
        q = draws(robot, 4)
        check_against_single_calls(robot, "tool", q, frame_batch(robot, "tool", q))


def test_a_robot_whose_model_was_edited_is_no_longer_its_arm() -> None:
    robot = MujocoRobot.from_arm(sawyer())
    q = draws(robot, 3)
    before = frame_batch(robot, "tool", q)
    robot.model.body_pos[3] += [0.01, 0.0, 0.0]
    for changed in (robot, copy.deepcopy(robot)):
        found = frame_batch(changed, "tool", q)
        assert np.abs(found.origins - before.origins).max() > 0.005
        check_against_single_calls(changed, "tool", q, found)


def test_frames_are_read_into_arrays_of_their_own() -> None:
    """`frames_of` gives what `pose`, `jacobian` and the methods of the centre of mass give, after every update."""
    robots = [named_robot("humanoid"), named_robot("sawyer"), PinocchioRobot.from_arm(sawyer())]
    for robot in robots:
        names = (robot.frame_names[3], Point.CENTER_OF_MASS, robot.frame_names[-1])
        frames = frames_of(robot, names)
        for q in draws(robot, 3):
            robot.update(q)
            frames.read()
            for f in (0, 2):
                rotation, origin = robot.pose(names[f])
                np.testing.assert_array_equal(frames.rotations[f], rotation)
                np.testing.assert_array_equal(frames.origins[f], origin)
                np.testing.assert_array_equal(frames.jacobians[f], robot.jacobian(names[f]))
            np.testing.assert_array_equal(frames.origins[1], robot.center_of_mass())
            np.testing.assert_array_equal(frames.jacobians[1, :3], robot.center_of_mass_jacobian())
            np.testing.assert_array_equal(frames.jacobians[1, 3:], 0.0)


def test_a_robot_that_gives_arrays_of_a_wrong_shape_is_told_so() -> None:
    robot = random_chain(np.random.default_rng(0))
    robot.jacobian = lambda frame: np.zeros((3, 7))  # type: ignore[method-assign]
    with pytest.raises(RobotError, match=r"for the frame 'tool' .* Jacobian \(3, 7\); they must be .* \(6, 7\)"):
        Frames(robot, ("tool",)).read()


def test_misuse() -> None:
    arm = sawyer()
    with pytest.raises(RobotError, match=r"q has shape \(7,\); it must be \(N, 7\)"):
        frame_batch(arm, "tool", np.zeros(7))
    with pytest.raises(RobotError, match=r"q has shape \(2, 6\); it must be \(N, 7\)"):
        frame_batch(MujocoRobot.from_arm(arm), "tool", np.zeros((2, 6)))
    with pytest.raises(RobotError, match=r"q\[1, 2\] is nan"):
        frame_batch(arm, "tool", np.where(np.arange(14).reshape(2, 7) == 9, np.nan, 0.0))
    with pytest.raises(RobotError, match=r"'tol'.*Did you mean 'tool'"):
        frame_batch(dataclasses.replace(arm), "tol", np.zeros((2, 7)))
    with pytest.raises(SettingError, match="threads is 0"):
        frame_batch(arm, "tool", np.zeros((2, 7)), threads=0)
