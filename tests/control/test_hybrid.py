"""Hybrid impedance control: (48)-(53), the selection matrix, and N levels."""

import functools

import numpy as np
import pytest

import hqp_rp
from hqp_rp import control
from hqp_rp.control import PostureTask, Stack, Wrench
from hqp_rp.core.errors import SettingError
from tests import reference as exact
from tests.control.chain import random_chain, random_rotation
from tests.control.gantry import Gantry

# A gantry or a chain without dynamics has exactly the velocity it is sent.
ForceReference = functools.partial(control.ForceReference, feedback="commanded")
HybridReference = functools.partial(control.HybridReference, feedback="commanded")
ImpedanceReference = functools.partial(control.ImpedanceReference, feedback="commanded")

M_D, B_D, K_D = 15.0, 150.0, 400.0


def test_selecting_nothing_is_force_control_and_selecting_all_is_impedance_control():
    rng = np.random.default_rng(0)
    robot = random_chain(rng)
    target = (random_rotation(rng), rng.normal(size=3))
    force = rng.normal(size=6)
    pairs = [
        (HybridReference("tool", target, M_D, B_D, K_D, np.zeros(6), force), ForceReference("tool", M_D, B_D, force)),
        (
            HybridReference("tool", target, M_D, B_D, K_D, np.ones(6), force),
            ImpedanceReference("tool", target, M_D, B_D, K_D),
        ),
    ]
    pairs[1][0].target_velocity = pairs[1][1].target_velocity = rng.normal(size=6)
    pairs[1][0].target_acceleration = pairs[1][1].target_acceleration = rng.normal(size=6)
    for hybrid, other in pairs:
        for _ in range(5):
            wrench = Wrench(*rng.normal(size=(3, 3)))
            np.testing.assert_allclose(
                hybrid.advance(robot, wrench, 0.01), other.advance(robot, wrench, 0.01), rtol=1e-12, atol=1e-14
            )


def test_each_axis_obeys_48():
    """One fine step from rest: X'' = X_d'' + M_d^-1 ((I - S) F_d - F_e - B_d D' - K_d S D), by hand."""
    rng = np.random.default_rng(1)
    robot = random_chain(rng)
    S = np.diag([0.0, 1.0, 1.0, 0.0, 1.0, 1.0])
    target = (robot.pose("tool")[0], robot.pose("tool")[1] + 0.1)
    velocity, acceleration, force, f_e = rng.normal(size=(4, 6))
    v = rng.normal(size=7)
    hybrid = HybridReference("tool", target, M_D, B_D, K_D, np.diag(S), force)
    hybrid.target_velocity, hybrid.target_acceleration = velocity, acceleration
    hybrid.start(robot, v)
    dt = 1e-7
    hybrid.advance(robot, Wrench(f_e[:3], f_e[3:], robot.pose("tool")[1]), dt)
    X1, D = robot.jacobian("tool") @ v, hybrid.deviation(robot)
    X2 = acceleration + ((np.eye(6) - S) @ force - f_e - B_D * (X1 - velocity) - K_D * S @ D) / M_D
    np.testing.assert_allclose((hybrid.velocity - X1) / dt, X2, rtol=1e-5, atol=1e-6)


def test_pressing_on_a_wall_while_moving_along_it():
    robot = Gantry(spare=2)
    dt, k = 2e-3, 2e3
    hybrid = HybridReference("tool", np.zeros(3), 15.0, 600.0, 3000.0, [0, 1, 1], [30.0, 0, 0], axes="xyz")
    stack = Stack([hybrid])
    for i in range(2500):
        t = i * dt
        hybrid.target = [0.0, 0.1 * np.sin(t), 0.1 * np.cos(t) - 0.1]
        hybrid.target_velocity = [0, 0.1 * np.cos(t), -0.1 * np.sin(t), 0, 0, 0]
        hybrid.target_acceleration = [0, -0.1 * np.sin(t), -0.1 * np.cos(t), 0, 0, 0]
        hybrid.advance(robot, Wrench([max(0.0, k * (robot.pose("tool")[1][0] - 0.01)), 0, 0]), dt)
        v = hqp_rp.solve(stack.problem(robot), "null_space").x
        robot.update(robot.integrate(robot.q, v, dt))
    x = robot.pose("tool")[1]
    assert k * (x[0] - 0.01) == pytest.approx(30.0, rel=1e-3)
    np.testing.assert_allclose(x[1:], [0.1 * np.sin(5.0), 0.1 * np.cos(5.0) - 0.1], atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_two_levels_with_reverse_priority_are_equation_52(seed):
    rng = np.random.default_rng(seed)
    robot = random_chain(rng)
    target = (robot.pose("tool")[0], robot.pose("tool")[1] + 0.1)
    levels = [
        HybridReference("tool", target, M_D, B_D, K_D, [0, 1], [30.0, 0.0], axes=("x", "rz")),
        HybridReference("tool", target, M_D, B_D, K_D, [1, 0, 1], 5.0, axes=("y", "z", "rx"), expressed_in="tool"),
    ]
    for level in levels:
        for _ in range(3):
            level.advance(robot, Wrench(*rng.normal(size=(3, 3))), 0.01)
    (J1, r1), (J2, r2) = (level.evaluate(robot) for level in levels)
    T1 = np.linalg.pinv(np.vstack((J1, J2)))[:, :2]
    second = np.linalg.pinv(J2) @ r2
    expected = second + T1 @ np.linalg.pinv(J1 @ T1) @ (r1 - J1 @ second)
    v = hqp_rp.solve(Stack(levels).problem(robot), "reverse_priority").x
    np.testing.assert_allclose(v, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("with_posture", [False, True])
def test_three_and_four_levels_of_all_kinds_are_the_recursion_29(with_posture):
    """What (53) stands for: q'_k = q'_{k+1} + T_k (J_k T_k)^+ (r_k - J_k q'_{k+1}), in exact arithmetic."""
    rng = np.random.default_rng(7)
    robot = random_chain(rng)
    target = (robot.pose("tool")[0], robot.pose("tool")[1] + 0.1)
    references = [
        HybridReference("tool", target, M_D, B_D, K_D, [0, 1], [30.0, 0.0], axes=("x", "y")),
        ForceReference("tool", M_D, B_D, 4.0, axes="z", expressed_in="link3"),
        ImpedanceReference("tool", target, M_D, B_D, K_D, axes=("rx", "rz")),
    ]
    for level in references:
        for _ in range(3):
            level.advance(robot, Wrench(*rng.normal(size=(3, 3))), 0.01)
    stack = Stack([*references, PostureTask(robot.neutral)] if with_posture else references)
    problem = stack.problem(robot)
    expected = exact.reverse_priority(problem)
    v = hqp_rp.solve(problem, "reverse_priority").x
    np.testing.assert_allclose(v, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_a_change_of_selection_does_not_let_the_rate_jump():
    robot, dt = Gantry(), 1e-4
    hybrid = HybridReference("tool", [0.2, 0, 0], M_D, B_D, K_D, [1, 1, 1], [30.0, 0, 0], axes="xyz")
    for _ in range(3000):
        before = hybrid.advance(robot, Wrench([0, 0, 0]), dt)
    hybrid.selection = [0, 1, 1]
    after = hybrid.advance(robot, Wrench([0, 0, 0]), dt)
    largest_acceleration = (30.0 + B_D * np.abs(before).max() + K_D * 0.2) / M_D
    assert np.abs(after - before).max() < 2.0 * dt * largest_acceleration


def test_an_oblique_surface_by_a_projector():
    n = np.array([1.0, 2.0, 2.0]) / 3.0
    S = np.eye(3) - np.outer(n, n)
    hybrid = HybridReference("tool", np.ones(3), 1.0, 10.0, 50.0, S, 9.0 * n, axes="xyz")
    robot = Gantry()
    stack = Stack([hybrid])
    for _ in range(3000):
        depth = n @ robot.pose("tool")[1]
        hybrid.advance(robot, Wrench(100.0 * depth * n), 0.005)
        robot.update(robot.integrate(robot.q, hqp_rp.solve(stack.problem(robot), "pseudo_inverse").x, 0.005))
    x = robot.pose("tool")[1]
    np.testing.assert_allclose(x, S @ np.ones(3) + 0.09 * n, atol=1e-6)


@pytest.mark.parametrize(
    ("S", "text"),
    [
        ([0.5, 1, 1], "it must be an orthogonal projector, S = S.T = S.2: 1 where position is controlled"),
        ([[1, 1, 0], [0, 0, 0], [0, 0, 1]], "it must be an orthogonal projector"),
        ([np.nan, 1, 1], "it must be an orthogonal projector"),
        ([1, 0], r"has shape \(2,\); give 3 numbers 0 \(force\) or 1 \(position\)"),
    ],
)
def test_a_selection_that_is_no_projector(S, text):
    with pytest.raises(SettingError, match=text.replace("S.T", r"S\^T").replace("S.2", r"S\^2")):
        HybridReference("tool", np.zeros(3), 1, 1, 1, S, axes="xyz")


def test_a_stiffness_that_couples_position_with_force_is_refused_because_its_spring_has_no_energy():
    K = np.array([[10.0, 9.0], [9.0, 10.0]])
    with pytest.raises(SettingError, match="K_d couples position-controlled with force-controlled directions by 9"):
        HybridReference("tool", np.zeros(3), 1, 1, K, [1, 0], axes="xy")
    spring = K @ np.diag([1.0, 0.0])  # the K_d S of (48)
    assert np.abs(spring - spring.T).max() == 9.0
    HybridReference("tool", np.zeros(3), 1, 1, K, [1, 1], axes="xy")
