"""The catalogue of singularities against those that geometry knows, and paths at the sigma that was asked for."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

import hqp_rp
from hqp_rp.control import JointLimit, OrientationTask, PositionTask, Stack, VelocityLimit
from hqp_rp.control.catalogue import approach_path
from hqp_rp.control.stack_file import load_stack
from hqp_rp.core.diagnostics import Singularity, spectra
from hqp_rp.core.errors import SettingError
from hqp_rp.robot.arms import planar_arm, sawyer
from hqp_rp.robot.mujoco_robot import MujocoRobot
from hqp_rp.robot.named import named_robot

SIGMAS = 10.0 ** -np.arange(1.0, 13.0)


def planar() -> tuple[MujocoRobot, Stack]:
    robot = MujocoRobot.from_arm(planar_arm(3, (0.5, 0.4, 0.3)))
    return robot, Stack(
        [
            PositionTask("tool", np.zeros(3), axes="xy", name="tool"),
            OrientationTask("link2", np.eye(3), axes=("rz",), name="turn"),
        ]
    )


def own_sigma(robot: MujocoRobot, stack: Stack, level: int, q: np.ndarray) -> float:
    robot.update(q)
    problem = stack.problem(robot)
    return spectra(problem)[level].sigma_min / float(np.linalg.norm(problem.levels[level].A, 2))


def test_the_planar_arm_against_closed_form() -> None:
    """Three links, tool held, link 2 to turn. The tool's Jacobian loses rank where sin q2 = sin q3 = 0 (stretched or
    folded). Beside it the turn is lost where links 1 and 3 are parallel, sin(q2 + q3) = 0, and link 2 is not."""
    robot, stack = planar()
    catalogue = hqp_rp.find_singularities(robot, stack, starts=60)
    assert {(place.level, place.kind) for place in catalogue} == {
        (0, Singularity.KINEMATIC),
        (1, Singularity.ALGORITHMIC),
    }
    for place in catalogue.of(kind=Singularity.KINEMATIC):
        np.testing.assert_allclose(np.sin(place.q[1:]), 0.0, atol=1e-9)
    for place in catalogue.of(level=1):
        assert abs(np.sin(place.q[1] + place.q[2])) < 1e-9
        assert abs(np.sin(place.q[1])) > 0.01
    # Both kinematic forms of the closed form that the limits allow, and both senses of links 1 and 3.
    assert {tuple(np.round(np.cos(place.q[1:])).astype(int)) for place in catalogue.of(level=0)} == set(
        itertools.product((-1, 1), repeat=2)
    )
    assert {int(np.round(np.cos(place.q[1] + place.q[2]))) for place in catalogue.of(level=1)} == {-1, 1}


def test_the_lost_directions_on_the_planar_arm_against_closed_form() -> None:
    """Stretched along the angle t, the tool cannot move along (cos t, sin t). At q2 + q3 = 0 the joint motion that keeps
    the tool at rest, (det23, -det13, det12) of the Jacobian's columns, has no part that turns link 2: v1 + v2 = 0."""
    robot, stack = planar()
    catalogue = hqp_rp.find_singularities(robot, stack, starts=40)
    for place in catalogue.of(level=0):
        along = np.array([np.cos(place.q[0]), np.sin(place.q[0])])
        assert abs(abs(along @ place.task_direction) - 1.0) < 1e-9
    for place in catalogue.of(level=1):
        robot.update(place.q)
        J = robot.jacobian("tool")[:2]
        columns = [np.linalg.det(J[:, pair]) for pair in ([1, 2], [0, 2], [0, 1])]
        motion = np.array([columns[0], -columns[1], columns[2]]) / np.linalg.norm(columns)
        assert abs(abs(motion @ place.joint_direction) - 1.0) < 1e-9
        assert abs(motion[0] + motion[1]) < 1e-9


def test_an_approach_has_the_sigma_that_was_asked_for() -> None:
    robot, stack = (
        MujocoRobot.from_arm(sawyer()),
        Stack([PositionTask("tool", np.zeros(3)), OrientationTask("tool", np.eye(3))]),
    )
    before = robot.q.copy()
    catalogue = hqp_rp.find_singularities(robot, stack, starts=4)
    np.testing.assert_array_equal(robot.q, before)
    assert catalogue.of(0) and catalogue.of(1)  # noqa: PT018
    for place in catalogue:
        robot.update(before)
        path = catalogue.approach(place, SIGMAS)
        np.testing.assert_array_equal(robot.q, before)
        assert len(path) >= 10  # the largest sigma may lie beyond the limits or the line's own maximum
        np.testing.assert_allclose(path.sigma, SIGMAS[-len(path) :], rtol=0.011)
        np.testing.assert_allclose(path.q, place.q + path.reach[:, None] * path.direction, atol=1e-14)
        assert (np.diff(np.abs(path.reach)) < 0.0).all()
        assert (np.abs(path.q) <= np.pi).all()
        measured = [own_sigma(robot, stack, place.level, q) for q in path.q]
        np.testing.assert_allclose(measured, path.sigma, rtol=1e-2, atol=1e-15)


def test_an_approach_along_another_line() -> None:
    robot, stack = planar()
    place = hqp_rp.find_singularities(robot, stack, level=1, starts=6)[0]
    direction = np.array([0.0, 1.0, 0.5])
    path = approach_path(robot, stack, place, [1e-3, 1e-6], direction=direction)
    np.testing.assert_allclose(path.direction, direction / np.linalg.norm(direction))
    np.testing.assert_allclose(path.sigma, [1e-3, 1e-6], rtol=0.011)
    # q2 + q3 stays what it is along q1, and so does the singularity.
    with pytest.raises(SettingError, match=r"grows by .* per rad only"):
        approach_path(robot, stack, place, [1e-3], direction=[1.0, 0.0, 0.0])


def test_the_humanoid_has_its_singularities() -> None:
    """At a singularity a force u on the level's frames is held by the earlier tasks alone, without torque in any joint:
    A_k^T u = A_e^T lambda. An elbow is straight at its limit, where it passes forces without torque."""
    robot, file = named_robot("humanoid"), load_stack("humanoid")
    stack = file.stack(robot)
    catalogue = hqp_rp.find_singularities(robot, stack, starts=6)
    hands, gaze = (stack.names.index(name) for name in ("hands", "gaze"))
    assert catalogue.of(hands, Singularity.ALGORITHMIC)
    assert catalogue.of(gaze, Singularity.ALGORITHMIC)
    elbows = [24, 31]
    np.testing.assert_array_equal(robot.upper[elbows], 0.0)
    straight = whole = 0
    for place in catalogue:
        straight += bool((np.abs(place.q[np.array(elbows) + 1]) < 1e-9).any())
        robot.update(place.q)
        problem = stack.problem(robot)
        A = problem.levels[place.level].A
        torque = A.T @ place.task_direction / np.linalg.norm(A, 2)
        if place.level:
            earlier = np.vstack([level.A for level in problem.levels[: place.level]])
            torque -= earlier.T @ np.linalg.lstsq(earlier.T, torque)[0]
        assert np.linalg.norm(torque) < 1e-12
        alone = np.linalg.svd(A, compute_uv=False)
        assert (alone[-1] / alone[0] > 0.02) == (place.kind is Singularity.ALGORITHMIC)
        positions = place.q[7:]
        assert (positions >= robot.lower[6:]).all()
        assert (positions <= robot.upper[6:]).all()
        path = catalogue.approach(place, [1e-3, 1e-8])
        assert len(path) >= 1  # the larger one may lie beyond a limit
        whole += len(path) == 2
        measured = [own_sigma(robot, stack, place.level, q) for q in path.q]
        np.testing.assert_allclose(measured, [1e-3, 1e-8][-len(path) :], rtol=0.02)
    assert straight
    assert whole > len(catalogue) / 2


def test_limits_are_left_out_and_levels_keep_their_numbers() -> None:
    robot, stack = planar()
    limited = Stack([[VelocityLimit()], *stack.levels], limits=[JointLimit()])
    plain, with_limits = (hqp_rp.find_singularities(robot, s, starts=6) for s in (stack, limited))
    assert [place.level + 1 for place in plain] == [place.level for place in with_limits]
    np.testing.assert_array_equal([place.q for place in plain], [place.q for place in with_limits])
    assert len(with_limits.approach(with_limits[-1], [1e-4])) == 1
    assert hqp_rp.find_singularities(robot, limited, level=2, starts=6).of(2)
    with pytest.raises(SettingError, match=r"level 0 .* holds limits only"):
        hqp_rp.find_singularities(robot, limited, level=0)
    with pytest.raises(SettingError, match="holds no task"):
        hqp_rp.find_singularities(robot, Stack([VelocityLimit()]))


def test_the_joint_limits_hold_along_a_path() -> None:
    """Singular at its own limit, q3 = 0: only one way is left."""
    arm = planar_arm(3, (0.5, 0.4, 0.3))
    robot = MujocoRobot.from_arm(dataclasses.replace(arm, upper=(3.0, 3.0, 0.0), neutral=(0.3, 0.3, -0.3)))
    stack = Stack([PositionTask("tool", np.zeros(3), axes="xy")])
    for place in hqp_rp.find_singularities(robot, stack, starts=10):
        path = approach_path(robot, stack, place, [1e-2, 1e-8], direction=[0.0, 0.0, 1.0])
        assert len(path) == 2
        assert (path.q[:, 2] <= 0.0).all()


@pytest.mark.parametrize("sigmas", [[], [0.0], [1.0], [np.nan], [-1e-3]])
def test_sigma_outside_its_range(sigmas: list[float]) -> None:
    robot, stack = planar()
    place = hqp_rp.find_singularities(robot, stack, level=1, starts=6)[0]
    with pytest.raises(SettingError, match=r"each in \(0, 1\)"):
        approach_path(robot, stack, place, sigmas)
    with pytest.raises(SettingError, match="direction is zero"):
        approach_path(robot, stack, place, [0.1], direction=np.zeros(3))


def test_the_catalogue_is_a_sequence() -> None:
    robot, stack = planar()
    catalogue = hqp_rp.find_singularities(robot, stack, starts=10)
    assert list(catalogue) == list(catalogue[:]) == [catalogue[i] for i in range(len(catalogue))]
    assert "turn: " in repr(catalogue)
    assert "algorithmic" in repr(catalogue)
    with pytest.raises(SettingError, match="level is 5"):
        hqp_rp.find_singularities(robot, stack, level=5)
