"""Impedance control: (43)-(47) through stacks and solvers, in position and in orientation, and its energy."""

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hqp_rp
from hqp_rp import control
from hqp_rp.control import Stack, Wrench
from hqp_rp.control._rotations import rotation_log
from hqp_rp.core.errors import SettingError
from tests.control.chain import expm_so3, random_chain, random_rotation
from tests.control.gantry import Gantry, mass_spring_damper

# A gantry or a chain without dynamics has exactly the velocity it is sent.
ImpedanceReference = functools.partial(control.ImpedanceReference, feedback="commanded")

FREE = Wrench([0.0, 0.0, 0.0])


def follow(robot, stack, references, dt, wrench=FREE, solver="reverse_priority"):
    for reference in references:
        reference.advance(robot, wrench, dt)
    v = hqp_rp.solve(stack.problem(robot), solver).x
    robot.update(robot.integrate(robot.q, v, dt))
    return v


@pytest.mark.parametrize("damping", [40.0, 200.0, 900.0])
@pytest.mark.parametrize("dt", [1e-3, 0.05])
def test_the_robot_makes_the_free_response(damping, dt):
    """Released from rest at a distance: position after any number of periods is that of the law, for any dt."""
    robot = Gantry(random_rotation(np.random.default_rng(0)), spare=1)
    robot.update([0.1, -0.2, 0.05, 0.0])
    x0 = robot.rotation.T @ robot.pose("tool")[1]
    reference = ImpedanceReference("tool", np.zeros(3), 10.0, damping, 1000.0, axes="xyz", expressed_in="tool")
    stack = Stack([reference])
    for _ in range(25):
        follow(robot, stack, [reference], dt)
    expected = [mass_spring_damper(25 * dt, 10.0, damping, 1000.0, x, 0.0)[0] for x in x0]
    np.testing.assert_allclose(reference.deviation(robot), expected, rtol=1e-9, atol=1e-13)


def test_a_constant_force_moves_it_by_the_compliance():
    robot = Gantry()
    K = np.array([[400.0, 100.0, 0.0], [100.0, 300.0, 0.0], [0.0, 0.0, 50.0]])
    reference = ImpedanceReference("tool", np.zeros(3), 1.0, 60.0, K, axes="xyz")
    stack = Stack([reference])
    push = np.array([5.0, -3.0, 1.0])  # the environment pushes the robot this way: F_e is the opposite
    for _ in range(2000):
        follow(robot, stack, [reference], 0.02, Wrench(-push))
    np.testing.assert_allclose(robot.pose("tool")[1], np.linalg.solve(K, push), rtol=1e-9)


def test_it_follows_a_parabola_without_error():
    """X_d'' is held between steps, so a target of constant acceleration is met to rounding error, from its own motion."""
    robot = Gantry()
    a, u, dt = np.array([0.3, -1.0, 2.0]), np.array([0.1, 0.4, -0.2]), 0.02
    reference = ImpedanceReference("tool", np.zeros(3), 10.0, 50.0, 300.0, axes="xyz")
    reference.start(robot, u)
    stack = Stack([reference])
    for k in range(100):
        t = k * dt
        reference.target = u * t + 0.5 * a * t * t
        reference.target_velocity = [*(u + a * t), 0, 0, 0]
        reference.target_acceleration = [*a, 0, 0, 0]
        np.testing.assert_allclose(robot.pose("tool")[1], reference.target[1], atol=1e-12)
        follow(robot, stack, [reference], dt)


def test_a_turning_target_is_followed_and_an_error_decays():
    """In orientation the period's mean angular velocity turns about one axis: the error left is of first order in dt."""
    omega = np.array([0.3, -0.2, 0.4])
    left = []
    for dt in (0.02, 0.01, 0.005):
        robot = random_chain(np.random.default_rng(3))
        R0 = robot.pose("tool")[0]
        reference = ImpedanceReference("tool", robot.pose("tool"), 1.0, 20.0, 100.0, axes=("rx", "ry", "rz"))
        reference.target_velocity = [0, 0, 0, *omega]
        reference.start(robot, np.linalg.pinv(robot.jacobian("tool")[3:]) @ omega)
        stack = Stack([reference])
        for k in range(round(1.0 / dt)):
            reference.target = (expm_so3(k * dt * omega) @ R0, [0, 0, 0])
            follow(robot, stack, [reference], dt)
        left.append(np.linalg.norm(rotation_log(robot.pose("tool")[0] @ (expm_so3(omega) @ R0).T)))
    assert left[0] < 0.01
    assert left[0] > 1.6 * left[1] > 1.6 * 1.6 * left[2]


def test_the_deviation_is_actual_minus_desired_in_the_chosen_axes():
    rng = np.random.default_rng(4)
    robot = random_chain(rng)
    R, p = robot.pose("tool")
    r, d = 0.5 * rng.normal(size=3), rng.normal(size=3)
    target = (expm_so3(r).T @ R, p - d)
    for frame in ("world", "tool", "link3"):
        reference = ImpedanceReference("tool", target, 1, 1, 1, axes=("z", "rx", "x"), expressed_in=frame)
        R_f = np.eye(3) if frame == "world" else robot.pose(frame)[0]
        expected = np.array([(R_f.T @ d)[2], (R_f.T @ r)[0], (R_f.T @ d)[0]])
        np.testing.assert_allclose(reference.deviation(robot), expected, atol=1e-12)


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    dt=st.floats(-4.0, 0.0).map(lambda x: 10.0**x),
    feedback=st.sampled_from(["commanded", "measured"]),
)
def test_the_free_motion_of_a_robot_never_gains_energy(seed, dt, feedback):
    """Through stack and solver, full matrices, two levels, from a moving start, in any axes."""
    rng = np.random.default_rng(seed)
    robot = Gantry(random_rotation(rng), spare=2)
    robot.update(rng.normal(size=5))
    A, B, K = rng.normal(size=(3, 2, 2))
    first = ImpedanceReference(
        "tool", rng.normal(size=3), A @ A.T + 0.1 * np.eye(2), B @ B.T, 100 * K @ K.T, axes="xz", expressed_in="tool",
        feedback=feedback,
    )  # fmt: skip
    second = ImpedanceReference("tool", np.zeros(3), 3.0, 1.0, 50.0, axes="y", expressed_in="tool", feedback=feedback)
    references, stack = (first, second), Stack([first, second])
    v = rng.normal(size=5)
    for reference in references:
        reference.start(robot, v)
    start = energy = sum(reference.energy(robot) for reference in references)
    for _ in range(15):
        state = np.concatenate([reference.velocity for reference in references])
        v = np.linalg.lstsq(np.vstack([r.jacobian(robot) for r in references]), state, rcond=None)[0]
        for reference in references:
            reference.advance(robot, FREE, dt, v)
        v = hqp_rp.solve(stack.problem(robot), "reverse_priority").x
        for reference in references:
            reference.deliver(robot, v)
        robot.update(robot.integrate(robot.q, v, dt))
        now = sum(reference.energy(robot) for reference in references)
        assert now <= energy + 1e-9 * start
        energy = now


@pytest.mark.parametrize("seed", range(3))
def test_a_large_rotation_never_gains_energy(seed):
    """One rotational stiffness: the energy falls for angles up to pi, undamped it stays, up to the first order in dt."""
    gains = []
    for dt in (2e-3, 1e-3):
        rng = np.random.default_rng(seed)
        robot = random_chain(rng)
        target = (expm_so3(2.5 * random_rotation(rng)[0]) @ robot.pose("tool")[0], np.zeros(3))
        reference = ImpedanceReference("tool", target, 2.0, 0.0, 30.0, axes=("rx", "ry", "rz"))
        damped = ImpedanceReference("tool", target, 2.0, 6.0, 30.0, axes=("rx", "ry", "rz"))
        robot.update(robot.q)
        q = robot.q
        for case in (reference, damped):
            robot.update(q)
            stack = Stack([case])
            energies = [case.energy(robot)]
            for _ in range(round(0.5 / dt)):
                follow(robot, stack, [case], dt)
                energies.append(case.energy(robot))
            if case is damped:
                assert (np.diff(energies) < 1e-3 * dt * energies[0]).all()
                assert energies[-1] < 0.5 * energies[0]
            else:
                gains.append(abs(energies[-1] / energies[0] - 1.0))
    assert gains[0] < 0.05
    assert gains[1] < 0.65 * gains[0] + 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_two_levels_with_reverse_priority_are_equation_47_read_with_J1_J2_inverse(seed):
    """q' = J_2^+ r_2 + T_1 (J_1 T_1)^+ (r_1 - J_1 J_2^+ r_2); as printed, r_1 - r_2, the first level is missed."""
    rng = np.random.default_rng(seed)
    robot = random_chain(rng)
    target = (random_rotation(rng), robot.pose("tool")[1] + 0.1 * rng.normal(size=3))
    levels = [
        ImpedanceReference("tool", target, 15.0, 150.0, 500.0, axes="xyz"),
        ImpedanceReference("tool", target, 80.0, 280.0, 100.0, axes=("rx", "ry", "rz"), expressed_in="link2"),
    ]
    for level in levels:
        level.target_velocity, level.target_acceleration = rng.normal(size=(2, 6))
        for _ in range(4):
            level.advance(robot, Wrench(*rng.normal(size=(3, 3))), 0.01)
    (J1, r1), (J2, r2) = (level.evaluate(robot) for level in levels)
    T1 = np.linalg.pinv(np.vstack((J1, J2)))[:, :3]
    first, second = T1 @ np.linalg.pinv(J1 @ T1), np.linalg.pinv(J2) @ r2
    v = hqp_rp.solve(Stack(levels).problem(robot), "reverse_priority").x
    expected = second + first @ (r1 - J1 @ second)
    np.testing.assert_allclose(v, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    np.testing.assert_allclose(J1 @ v, r1, atol=1e-11)
    printed = second + first @ (r1 - r2)
    assert np.linalg.norm(J1 @ printed - r1) > 1e-3


def test_a_target_may_be_a_pose_a_matrix_or_a_position():
    R, p = random_rotation(np.random.default_rng(5)), np.array([1.0, 2.0, 3.0])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    for target in ((R, p), T):
        np.testing.assert_allclose(ImpedanceReference("tool", target, 1, 1, 1).target[0], R, atol=1e-15)
    np.testing.assert_array_equal(ImpedanceReference("tool", p, 1, 1, 1, axes="xy").target[1], p)
    with pytest.raises(SettingError, match=r"is a position, and \['rz'\] are chosen too; give a pose"):
        ImpedanceReference("tool", p, 1, 1, 1, axes=("x", "rz"))
    with pytest.raises(SettingError, match=r"the target_velocity of 'tool impedance' has shape \(3,\)"):
        ImpedanceReference("tool", p, 1, 1, 1, axes="xy", target_velocity=p)
    with pytest.raises(SettingError, match="K_d of 'tool impedance' must be positive semidefinite"):
        ImpedanceReference("tool", p, 1, 1, [1, -1], axes="xy")
