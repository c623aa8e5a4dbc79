"""Force control: (35)-(42) through stacks and solvers."""

import functools

import numpy as np
import pytest

import hqp_rp
from hqp_rp import control
from hqp_rp.control import Stack, Wrench
from tests.control.chain import random_chain, random_rotation
from tests.control.gantry import Gantry, mass_damper

# A gantry or a chain without dynamics has exactly the velocity it is sent.
ForceReference = functools.partial(control.ForceReference, feedback="commanded")

M_D, B_D = np.array([15.0, 15.0, 15.0, 80.0, 80.0, 80.0]), np.array([150.0, 150.0, 150.0, 280.0, 280.0, 280.0])


@pytest.mark.parametrize("dt", [1e-3, 0.1])
def test_in_free_space_the_robot_is_where_the_law_puts_it(dt):
    """(35) with F_e = 0, against x(t) = F_d / B_d (t - M_d / B_d (1 - exp(-B_d t / M_d)))."""
    robot = Gantry(random_rotation(np.random.default_rng(0)))
    reference = ForceReference("tool", 15.0, 150.0, [30.0, -20.0, 10.0], axes="xyz", expressed_in="tool")
    stack = Stack([reference])
    for _ in range(20):
        reference.advance(robot, Wrench([0, 0, 0]), dt)
        v = hqp_rp.solve(stack.problem(robot), "reverse_priority").x
        robot.update(robot.integrate(robot.q, v, dt))
    moved = robot.rotation.T @ robot.q
    expected = [mass_damper(20 * dt, 15.0, 150.0, f)[0] for f in (30.0, -20.0, 10.0)]
    np.testing.assert_allclose(moved, expected, rtol=1e-12)


@pytest.mark.parametrize("solver", ["reverse_priority", "pseudo_inverse"])
def test_against_a_spring_it_rests_where_the_force_is_the_desired_one(solver):
    """(36)-(37) with M_e = B_e = 0: m x'' + b x' + k x = F_d."""
    m, b, k, dt = 15.0, 400.0, 1e3, 1e-3
    robot = Gantry(spare=2)
    press = ForceReference("tool", m, b, 30.0, axes="x")
    rest = ForceReference("tool", m, b, 0.0, axes=("y", "z"))
    stack = Stack([press, rest])
    for _ in range(3000):
        x = robot.pose("tool")[1][0]
        for reference in (press, rest):
            reference.advance(robot, Wrench([k * x, 0, 0]), dt)
        v = hqp_rp.solve(stack.problem(robot), solver).x
        for reference in (press, rest):
            reference.deliver(robot, v)
        robot.update(robot.integrate(robot.q, v, dt))
    assert k * robot.pose("tool")[1][0] == pytest.approx(30.0, rel=1e-3)
    np.testing.assert_allclose(robot.pose("tool")[1][1:], 0.0, atol=1e-12)


def test_a_robot_that_pushes_too_hard_draws_back():
    reference = ForceReference("tool", 1.0, 1.0, 10.0, axes="x")
    assert reference.advance(Gantry(), Wrench([9.0, 0, 0]), 0.01)[0] > 0.0
    reference.start(Gantry())
    assert reference.advance(Gantry(), Wrench([11.0, 0, 0]), 0.01)[0] < 0.0


@pytest.mark.parametrize("seed", range(4))
def test_two_levels_with_reverse_priority_are_equation_42(seed):
    """q' = J_2^+ r_2 + T_1 (J_1 T_1)^+ (r_1 - J_1 J_2^+ r_2), the closed expression (32) with r_k from (40), (41)."""
    rng = np.random.default_rng(seed)
    robot = random_chain(rng)
    levels = [
        ForceReference("tool", M_D[:1], B_D[:1], 30.0, axes="x"),
        ForceReference("tool", M_D[1:], B_D[1:], rng.normal(size=5), axes=("y", "z", "rx", "ry", "rz")),
    ]
    if seed % 2:  # two levels that conflict: eight rows on seven joints
        levels[0] = ForceReference("link6", M_D[:3], B_D[:3], 30.0, axes="xyz", expressed_in="tool")
    stack = Stack(levels)
    dt = 0.01
    for _ in range(5):
        wrench = Wrench(*rng.normal(size=(2, 3)), point=robot.pose("tool")[1])
        for level in levels:
            level.advance(robot, wrench, dt)
        (J1, r1), (J2, r2) = (level.evaluate(robot) for level in levels)
        J2_inverse = np.linalg.pinv(J2)
        T1 = np.linalg.pinv(np.vstack((J1, J2)), rcond=1e-12)[:, : len(J1)]
        T1[np.abs(T1) < 1e-13] = 0.0
        expected = J2_inverse @ r2 + T1 @ np.linalg.pinv(J1 @ T1, rcond=1e-10) @ (r1 - J1 @ J2_inverse @ r2)
        v = hqp_rp.solve(stack.problem(robot), "reverse_priority").x
        np.testing.assert_allclose(v, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
        robot.update(robot.integrate(robot.q, v, dt))


def test_the_integrals_of_40_and_41_are_the_rates_of_the_levels():
    """With a force that varies, the state is the printed integral, evaluated on its own with a fraction of the step."""
    reference = ForceReference("tool", M_D[:2], B_D[:2], axes=("x", "y"))
    robot, dt, fine = Gantry(), 1e-3, 200
    V = np.zeros(2)
    for k in range(100):
        F_d = np.array([30.0 + 5.0 * np.sin(k * dt / np.pi), 2.0])
        F_e = np.array([20.0 * np.sin(9.0 * k * dt), 1.0])
        reference.force = F_d
        reference.advance(robot, Wrench([*F_e, 0.0]), dt)
        for _ in range(fine):
            V += dt / fine * (-F_e + F_d - B_D[:2] * V) / M_D[:2]
    np.testing.assert_allclose(reference.velocity, V, rtol=1e-4)
