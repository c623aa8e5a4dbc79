"""Singularities found by search against those that geometry knows, and against finite motions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hqp_rp.control import JointLimit, OrientationTask, PositionTask, PostureTask, Stack
from hqp_rp.control._rotations import rotation_log
from hqp_rp.control.singularities import SingularConfiguration, refine_singularity, search_singularities
from hqp_rp.core.diagnostics import Singularity, spectra
from hqp_rp.core.errors import SettingError
from hqp_rp.robot.arms import planar_arm, sawyer
from hqp_rp.robot.dh import DHArm
from hqp_rp.robot.mujoco_robot import MujocoRobot
from hqp_rp.robot.pinocchio_robot import PinocchioRobot

BOTH_KINEMATIC = (Singularity.KINEMATIC, Singularity.BOTH)


def planar_stack(link: str = "link2") -> Stack:
    return Stack(
        [
            PositionTask("tool", np.zeros(3), axes="xy", name="tool"),
            OrientationTask(link, np.eye(3), axes=("rz",), name="turn"),
            PostureTask(np.zeros(4)),
        ]
    )


def pose_stack() -> Stack:
    return Stack([PositionTask("tool", np.zeros(3)), OrientationTask("tool", np.eye(3))])


def parallel(first: float, second: float) -> bool:
    return bool(abs(np.sin(first - second)) < 1e-7)


@pytest.mark.parametrize(("link", "aligned"), [("link2", (0, 2, 3)), ("link3", (0, 1, 3)), ("link4", (0, 1, 2))])
def test_a_planar_link_is_stuck_where_the_other_links_are_parallel(link: str, aligned: tuple[int, ...]) -> None:
    robot = MujocoRobot.from_arm(planar_arm(4, (0.5, 0.4, 0.3, 0.35)))
    found = search_singularities(robot, planar_stack(link), starts=24)
    assert len(found) > 5
    other = ({0, 1, 2, 3} - set(aligned)).pop()
    for place in found:
        angles = np.cumsum(place.q)
        assert all(parallel(angles[aligned[0]], angles[i]) for i in aligned[1:])
        assert not parallel(angles[aligned[0]], angles[other])
        assert (place.level, place.name, place.kind) == (1, "turn", Singularity.ALGORITHMIC)
        assert place.own_sigma == pytest.approx(1.0)
        assert place.earlier_sigma >= 0.02
        np.testing.assert_allclose(np.abs(place.task_direction), [1.0])


def test_on_the_planar_arm_an_edge_is_where_the_other_links_are_stretched() -> None:
    """Three equal links in line: stretched they end the turn; one of them folded back, the turn goes on past a saddle."""
    found = search_singularities(MujocoRobot.from_arm(planar_arm(4)), planar_stack(), starts=60)
    kinds = set()
    for place in found:
        angles = np.cumsum(place.q)
        stretched = bool(np.cos(angles[2] - angles[0]) > 0.0 and np.cos(angles[3] - angles[0]) > 0.0)
        assert place.is_edge == stretched
        kinds.add(stretched)
    assert kinds == {True, False}


@pytest.mark.parametrize("arm", [planar_arm(4), sawyer()], ids=lambda arm: arm.name)
def test_what_is_found_is_singular_by_the_librarys_own_judgement(arm: DHArm) -> None:
    robot = MujocoRobot.from_arm(arm)
    stack = planar_stack() if arm.n == 4 else pose_stack()
    found = search_singularities(robot, stack, level=1, starts=12)
    assert found
    for place in found:
        robot.update(place.q)
        problem = stack.problem(robot)
        first, second = spectra(problem)[:2]
        assert first.singularity is Singularity.NONE
        assert second.singularity is Singularity.ALGORITHMIC
        assert second.rank == problem.levels[1].m - 1
        A, B = (level.A for level in problem.levels[:2])
        # u^T B lies in the rows of A; v moves neither A nor u^T B.
        u, v = place.task_direction, place.joint_direction
        assert np.linalg.norm(u) == pytest.approx(1.0)
        assert np.linalg.norm(v) == pytest.approx(1.0)
        combination = np.linalg.lstsq(A.T, B.T @ u, rcond=None)[0]
        np.testing.assert_allclose(A.T @ combination, B.T @ u, atol=1e-11)
        np.testing.assert_allclose(A @ v, 0.0, atol=1e-11)
        np.testing.assert_allclose(B @ v, 0.0, atol=1e-11)
        assert (place.q >= robot.lower).all()
        assert (place.q <= robot.upper).all()


def second_order(robot: MujocoRobot, place: SingularConfiguration, motion: np.ndarray, reach: float) -> float:
    """2 / reach^2 times the turn about u after `reach` along `motion`, everything else brought back to where it was."""
    u = place.task_direction if place.task_direction.size == 3 else np.array([0.0, 0.0, place.task_direction[0]])
    frame = "tool" if robot.nv == 7 else "link2"
    robot.update(place.q)
    position, rotation = robot.pose("tool")[1], robot.pose(frame)[0]
    q = place.q + reach * motion
    others = np.linalg.svd(u[None])[2][1:]
    for _ in range(6):
        robot.update(q)
        turn = rotation_log(robot.pose(frame)[0] @ rotation.T)
        rows, error = robot.jacobian("tool")[:3], robot.pose("tool")[1] - position
        if robot.nv == 7:
            rows, error = np.vstack([rows, others @ robot.jacobian(frame)[3:]]), np.concatenate([error, others @ turn])
        q = q - np.linalg.pinv(rows, rcond=1e-9) @ error
    robot.update(q)
    return float(2.0 / reach**2 * u @ rotation_log(robot.pose(frame)[0] @ rotation.T))


@pytest.mark.parametrize("arm", [planar_arm(4), sawyer()], ids=lambda arm: arm.name)
def test_the_curvature_is_that_of_finite_motions(arm: DHArm) -> None:
    robot = MujocoRobot.from_arm(arm)
    stack = planar_stack() if arm.n == 4 else pose_stack()
    for place in search_singularities(robot, stack, level=1, starts=10, clearance=0.1):
        robot.update(place.q)
        problem = stack.problem(robot)
        rows = np.vstack([level.A for level in problem.levels[:2]])
        still = np.linalg.svd(rows)[2][np.linalg.matrix_rank(rows, tol=1e-9) :]
        assert place.curvature.shape == (len(still),) == (2,)
        angles = np.linspace(0.0, np.pi, 60)
        # The mean of both senses cancels the third order.
        turns = [
            np.mean([second_order(robot, place, sign * motion, 1e-3) for sign in (1.0, -1.0)])
            for motion in np.outer(np.cos(angles), still[0]) + np.outer(np.sin(angles), still[1])
        ]
        scale = np.abs(place.curvature).max()
        np.testing.assert_allclose([min(turns), max(turns)], place.curvature, atol=0.01 * scale)
        assert place.curvature.sum() <= 0.0


def test_sigma_grows_along_the_approach_as_stated() -> None:
    robot, stack = MujocoRobot.from_arm(sawyer()), pose_stack()
    for place in search_singularities(robot, stack, level=1, starts=10):
        norms = []
        for s in (-1e-4, 1e-4):
            robot.update(place.q + s * place.approach)
            problem = stack.problem(robot)
            norms.append(spectra(problem)[1].sigma_min / np.linalg.norm(problem.levels[1].A, 2))
        np.testing.assert_allclose(norms, 1e-4 * place.approach_rate, rtol=5e-3)
        assert np.linalg.norm(place.approach) == pytest.approx(1.0)


def test_kinematic_singularities_are_told_apart() -> None:
    robot = MujocoRobot.from_arm(planar_arm(4))
    found = search_singularities(robot, planar_stack(), starts=20, kinds=BOTH_KINEMATIC)
    assert found
    for place in found:
        assert (place.level, place.kind) == (0, Singularity.KINEMATIC)
        assert place.own_sigma < 1e-12
        assert place.earlier_sigma == np.inf
        np.testing.assert_allclose(np.sin(place.q[1:]), 0.0, atol=1e-7)


def test_a_level_of_more_rows_than_freedom() -> None:
    """Tool held, joint 3 of a 3-joint arm moves on a circle: it stands still where links 1 and 2 are parallel."""
    robot = MujocoRobot.from_arm(planar_arm(3))
    stack = Stack([PositionTask("tool", np.zeros(3), axes="xy"), PositionTask("link3", np.zeros(3), axes="xy")])
    found = search_singularities(robot, stack, level=1, starts=20, kinds=BOTH_KINEMATIC)
    assert found
    for place in found:
        assert place.kind is Singularity.BOTH
        assert abs(np.sin(place.q[1])) < 1e-7
        assert place.curvature.size == 0
        assert not place.is_edge
    assert not search_singularities(robot, stack, level=1, starts=20)


def test_levels_that_cannot_lose_rank_give_nothing() -> None:
    robot = MujocoRobot.from_arm(planar_arm(4))
    everything = (Singularity.ALGORITHMIC, *BOTH_KINEMATIC)
    assert search_singularities(robot, planar_stack(), level=2, starts=4, kinds=everything) == []
    below = Stack([PostureTask(np.zeros(4)), PositionTask("tool", np.zeros(3))])
    assert search_singularities(robot, below, level=1, starts=4, kinds=everything) == []


def test_both_robot_libraries_find_the_same() -> None:
    arm = planar_arm(4)
    first, second = (
        search_singularities(kind.from_arm(arm), planar_stack(), level=1, starts=10)
        for kind in (MujocoRobot, PinocchioRobot)
    )
    assert len(first) == len(second) > 0
    for a, b in zip(first, second, strict=True):
        np.testing.assert_allclose(a.q, b.q, atol=1e-6)


def test_the_search_is_reproducible_and_grows_with_its_starts() -> None:
    robot = MujocoRobot.from_arm(planar_arm(4))
    before = np.array([0.1, 0.2, 0.3, 0.4])
    robot.update(before)
    few, many, other = (
        [place.q for place in search_singularities(robot, planar_stack(), level=1, starts=starts, seed=seed)]
        for starts, seed in ((6, 0), (12, 0), (6, 1))
    )
    assert len(few) < len(many)
    np.testing.assert_array_equal(few, many[: len(few)])
    assert not np.array_equal(few, other)
    np.testing.assert_array_equal(robot.q, before)


def test_separation_and_clearance_thin_out_what_is_returned() -> None:
    robot = MujocoRobot.from_arm(planar_arm(4))
    wide = search_singularities(robot, planar_stack(), level=1, starts=30, separation=1.0)
    for i, place in enumerate(wide):
        assert all(np.abs(place.q - other.q).max() >= 1.0 for other in wide[:i])
    clear = search_singularities(robot, planar_stack(), level=1, starts=30, clearance=0.3)
    assert 0 < len(clear) < len(search_singularities(robot, planar_stack(), level=1, starts=30))
    assert all(place.earlier_sigma >= 0.3 for place in clear)


def test_joint_limits_are_kept() -> None:
    robot = MujocoRobot.from_arm(planar_arm(4, joint_limit=1.3))
    found = search_singularities(robot, planar_stack(), level=1, starts=40)
    assert found
    assert all(np.abs(place.q).max() <= 1.3 for place in found)
    # Links 1, 3 and 4 can be in line with their senses alike only.
    assert all(place.is_edge for place in found)


def test_refining_goes_to_the_near_singularity() -> None:
    robot = MujocoRobot.from_arm(planar_arm(4))
    singular = np.array([0.2, 1.2, -1.2, 0.0])
    place = refine_singularity(robot, planar_stack(), singular + np.array([0.02, -0.03, 0.01, 0.02]), 1)
    assert place is not None
    assert np.abs(place.q - singular).max() < 0.1
    assert place.sigma < 1e-13
    exact = refine_singularity(robot, planar_stack(), singular, 1, iterations=0)
    assert exact is not None
    np.testing.assert_array_equal(exact.q, singular)
    assert refine_singularity(robot, planar_stack(), singular + 0.1, 1, iterations=0) is None


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"level": 3}, "level is 3; it must be an index of the stack's levels, 0 to 2"),
        ({"level": "turn"}, "level is 'turn'"),
        ({"starts": 0}, "starts is 0; it must be an integer of at least 1"),
        ({"seed": -1}, "seed is -1"),
        ({"tolerance": 0.0}, r"tolerance is 0.0; it must be a number in \(0, 1\)"),
        ({"clearance": -0.1}, "clearance is -0.1"),
        ({"separation": -0.1}, "separation is -0.1"),
        ({"kinds": ()}, r"kinds is \(\); it must be Singularity members"),
        ({"kinds": (Singularity.NONE,)}, "other than NONE"),
        ({"kinds": "algorithmic"}, "kinds is"),
    ],
)
def test_misuse_is_named(arguments: dict[str, Any], text: str) -> None:
    with pytest.raises(SettingError, match=text):
        search_singularities(MujocoRobot.from_arm(planar_arm(4)), planar_stack(), **arguments)


def test_limits_in_the_stack_are_refused() -> None:
    stack = Stack([PositionTask("tool", np.zeros(3)), JointLimit()])
    with pytest.raises(SettingError, match="holds limits"):
        search_singularities(MujocoRobot.from_arm(planar_arm(4)), stack, dt=0.01)
