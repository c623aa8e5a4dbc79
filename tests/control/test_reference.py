"""What all references share: start, which velocity is damped, anti-windup, and their place in a stack."""

import numpy as np
import pytest

import hqp_rp
from hqp_rp.control import ForceReference, ImpedanceReference, Stack, TwistTask, Wrench
from hqp_rp.core.errors import SettingError
from tests.control.chain import random_chain
from tests.control.gantry import Gantry, mass_damper

FREE = Wrench([0.0, 0.0, 0.0])
AXES = ("z", "x", "ry")


def references(robot, **settings):
    yield ForceReference("tool", 15.0, 150.0, 30.0, axes=AXES, **settings)
    yield ImpedanceReference("tool", robot.pose("tool"), 15.0, 150.0, 400.0, axes=AXES, **settings)


def test_it_is_a_task_of_a_stack_with_the_rows_of_a_twist():
    robot = random_chain(np.random.default_rng(0))
    reference = ForceReference("tool", 15.0, 150.0, 30.0, axes=AXES, expressed_in="link2", weight=2.0, name="press")
    rate = reference.advance(robot, FREE, 0.01, np.zeros(7))
    twist = TwistTask("tool", rate, axes=AXES, expressed_in="link2", weight=2.0)
    problem = Stack([reference, [twist]]).problem(robot)
    np.testing.assert_array_equal(problem.levels[0].A, problem.levels[1].A)
    np.testing.assert_array_equal(problem.levels[0].lower, problem.levels[1].lower)
    assert problem.names[0] == "press"
    assert reference.axes == AXES
    assert repr(reference) == "ForceReference('press')"


@pytest.mark.parametrize("feedback", ["commanded", "measured"])
def test_bumpless_start(feedback):
    """The first rate is the present motion plus what the law accelerates in half a period: it tends to it with dt."""
    rng = np.random.default_rng(1)
    robot = random_chain(rng)
    v = rng.normal(size=7)
    for reference in references(robot, feedback=feedback):
        for dt in (1e-3, 1e-5):
            reference.start(robot, v)
            before = reference.rate
            np.testing.assert_array_equal(before, reference.jacobian(robot) @ v)
            wrench = Wrench(rng.normal(size=3))
            jump = reference.advance(robot, wrench, dt, v) - before
            desired = 30.0 if isinstance(reference, ForceReference) else 0.0
            net = desired - reference.contact_force(robot, wrench) - 150.0 * before
            np.testing.assert_allclose(jump, 0.5 * dt * net / 15.0, rtol=10.0 * dt)
        # Without net force there is no jump at all.
        reference = ForceReference("tool", 15.0, 150.0, 0.0, axes=AXES, feedback=feedback)
        reference.start(robot, v)
        steady = reference.rate
        reference.force = reference.law.damping @ steady
        np.testing.assert_allclose(reference.advance(robot, FREE, 0.01, v), steady, rtol=1e-13)


def test_without_start_the_robot_is_taken_to_be_at_rest():
    robot = random_chain(np.random.default_rng(2))
    for reference in references(robot, feedback="commanded"):
        fresh = reference.advance(robot, FREE, 0.01)
        reference.advance(robot, FREE, 0.01)
        reference.start(robot)
        np.testing.assert_array_equal(reference.rate, 0.0)
        np.testing.assert_array_equal(reference.advance(robot, FREE, 0.01), fresh)


def test_both_readings_of_the_damped_velocity_agree_where_the_robot_has_the_commanded_velocity():
    rng = np.random.default_rng(3)
    robot = Gantry()
    wrenches = [Wrench(5.0 * rng.normal(size=3)) for _ in range(50)]
    for make in (
        lambda feedback: ForceReference("tool", 2.0, 9.0, 3.0, axes="xyz", feedback=feedback),
        lambda feedback: ImpedanceReference("tool", np.ones(3), 2.0, 9.0, 40.0, axes="xyz", feedback=feedback),
    ):
        commanded, measured = make("commanded"), make("measured")
        q = np.zeros(3)
        for wrench in wrenches:
            robot.update(q)
            v = commanded.velocity
            a, b = commanded.advance(robot, wrench, 0.01), measured.advance(robot, wrench, 0.01, v)
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-14)
            q = q + 0.01 * a


def test_damping_the_measured_velocity_is_the_printed_integral():
    """(40): V = integral of M_d^-1 (F_d - F_e - B_d X') dt with a measured X' that has nothing to do with V."""
    robot = Gantry()
    reference = ForceReference("tool", 15.0, 150.0, 30.0, axes="x", recovery=None)
    integral, dt = 0.0, 1e-5
    for k in range(2000):
        t = k * dt
        v, f = 0.1 * np.sin(40.0 * t), 10.0 * np.cos(30.0 * t)
        reference.advance(robot, Wrench([f, 0, 0]), dt, [v, 0, 0])
        integral += dt * (30.0 - f - 150.0 * v) / 15.0
    assert reference.velocity[0] == pytest.approx(integral, rel=2e-4)


@pytest.mark.parametrize(("feedback", "share"), [("measured", 1.0), ("commanded", 1.0 / (1.0 + 150.0 * 1e-3))])
def test_a_robot_that_sags_under_load_reaches_the_force_only_where_the_measured_velocity_is_damped(feedback, share):
    """Its velocity is the command less 1e-3 m/s for each N: at rest V = 1e-3 F_e, and B_d V is missing if V is damped."""
    robot, dt = Gantry(), 1e-3
    reference = ForceReference("tool", 15.0, 150.0, 30.0, axes="x", feedback=feedback)
    v = np.zeros(3)
    for _ in range(6000):
        force = 1e3 * robot.pose("tool")[1][0]
        rate = reference.advance(robot, Wrench([force, 0, 0]), dt, v)
        v = np.array([rate[0], 0, 0])
        reference.deliver(robot, v)
        v = v - [1e-3 * force, 0, 0]
        robot.update(robot.integrate(robot.q, v, dt))
    assert 1e3 * robot.pose("tool")[1][0] == pytest.approx(30.0 * share, rel=1e-4)
    assert reference.velocity[0] == pytest.approx(1e-3 * 30.0 * share, rel=1e-3)


def test_a_solver_that_always_delivers_less_leaves_the_force_error_of_the_docstring():
    """A sagging robot again, sent 0.9 rate: at rest 0.9 rate = 1e-3 F_e and F_d - F_e = M_d 0.1 rate / recovery."""
    robot, dt, recovery = Gantry(), 1e-3, 0.1
    reference = ForceReference("tool", 15.0, 150.0, 30.0, axes="x", recovery=recovery)
    v = np.zeros(3)
    for _ in range(8000):
        force = 1e3 * robot.pose("tool")[1][0]
        sent = 0.9 * np.array([reference.advance(robot, Wrench([force, 0, 0]), dt, v)[0], 0, 0])
        reference.deliver(robot, sent)
        v = sent - [1e-3 * force, 0, 0]
        robot.update(robot.integrate(robot.q, v, dt))
    missing = 30.0 - 1e3 * robot.pose("tool")[1][0]
    assert missing > 0.3
    assert missing == pytest.approx(15.0 * 0.1 * reference.rate[0] / recovery, rel=0.01)


def blocked_run(feedback, recovery, blocked, after, dt=1e-3):
    """The second level wants to push along x, which the first holds still during `blocked` s, then along the free x."""
    robot = Gantry(spare=2)
    push = ForceReference("tool", 15.0, 150.0, 30.0, axes="x", feedback=feedback, recovery=recovery)
    wall = TwistTask("tool", np.zeros(3), axes="xyz")
    v = np.zeros(5)
    peak = 0.0
    rates = []
    for k in range(round((blocked + after) / dt)):
        if k < round(blocked / dt):
            stack = Stack([wall, push])
        else:
            stack = Stack([push, TwistTask("tool", axes="yz")])
            push.force = -30.0
        push.advance(robot, FREE, dt, v)
        v = hqp_rp.solve(stack.problem(robot), "null_space").x
        push.deliver(robot, v)
        if k < round(blocked / dt):
            assert abs(robot.J[0] @ v) < 1e-12
            peak = max(peak, abs(push.velocity[0]))
        else:
            rates.append(push.rate[0])
        robot.update(robot.integrate(robot.q, v, dt))
    return peak, np.array(rates)


@pytest.mark.parametrize("feedback", ["commanded", "measured"])
def test_anti_windup(feedback):
    """Blocked, the state stays within recovery * (acceleration); free again, the robot turns back at once."""
    acceleration, recovery = 30.0 / 15.0, 0.02
    peak, rates = blocked_run(feedback, recovery, 2.0, 0.3)
    assert peak <= 1.05 * recovery * acceleration
    wound, late = blocked_run(feedback, None, 2.0, 0.3)
    # Without: B_d^-1 F_d = 0.2 m/s where the law damps itself; where nothing does, 2000 times one period's increment.
    unbounded = 2000 * 0.2 * -np.expm1(-1e-3 * 150.0 / 15.0)
    assert wound == pytest.approx({"commanded": 0.2, "measured": unbounded}[feedback], rel=1e-6)
    back = [int(np.argmax(r < 0.0)) if (r < 0.0).any() else len(r) for r in (rates, late)]
    assert back[0] <= 25
    assert back[1] > 2 * back[0]


def test_a_shortfall_is_forgotten_at_a_new_start_and_recovery_of_zero_takes_it_all():
    robot = Gantry()
    reference = ForceReference("tool", 1.0, 0.0, 1.0, axes="x", feedback="commanded", recovery=0.0)
    reference.advance(robot, FREE, 0.1)
    reference.deliver(robot, np.zeros(3))
    rate = reference.advance(robot, FREE, 0.1)
    # V = 0.1 at the end of the first period, less the missed mean 0.05; then 0.05 more on average.
    assert rate[0] == pytest.approx(0.1, rel=1e-12)
    # A shortfall counts once: nobody says that this period was not delivered.
    assert reference.advance(robot, FREE, 0.1)[0] == pytest.approx(0.2, rel=1e-12)
    reference.deliver(robot, np.ones(3))
    reference.start(robot)
    assert reference.advance(robot, FREE, 0.1)[0] == pytest.approx(0.05, rel=1e-12)


def test_what_is_delivered_in_full_changes_nothing():
    robot = Gantry()
    reference = ForceReference("tool", 15.0, 150.0, [30.0, 0.0, -10.0], axes="xyz", feedback="commanded")
    for _ in range(30):
        reference.deliver(robot, reference.advance(robot, FREE, 0.01))
    expected = [mass_damper(0.3, 15.0, 150.0, f)[1] for f in (30.0, 0.0, -10.0)]
    np.testing.assert_allclose(reference.velocity, expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("expressed_in", ["world", "tool", "link2"])
def test_the_contact_force_along_the_axes_does_the_work_of_the_wrench(expressed_in):
    rng = np.random.default_rng(4)
    robot = random_chain(rng)
    reference = ForceReference("tool", 1.0, 1.0, expressed_in=expressed_in)
    wrench = Wrench(*rng.normal(size=(3, 3)))
    v = rng.normal(size=7)
    power = reference.contact_force(robot, wrench) @ (reference.jacobian(robot) @ v)
    assert power == pytest.approx(wrench.about(robot.pose("tool")[1]) @ (robot.jacobian("tool") @ v), rel=1e-12)


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"feedback": "own"}, "the feedback of 'tool force' is 'own'; it must be 'commanded' or 'measured'"),
        ({"recovery": -1.0}, "the recovery of 'tool force' is -1.0; it must be a finite number > 0"),
        ({"axes": ("x", "w")}, "there is no axis 'w'"),
        ({"force": [1.0, 2.0]}, r"the force of 'tool force' has shape \(2,\); it must be 6 numbers in N and N m"),
        ({"force": np.nan}, "the force of 'tool force'"),
    ],
)
def test_settings_out_of_range(settings, text):
    with pytest.raises(SettingError, match=text):
        ForceReference("tool", 1.0, 1.0, **settings)


def test_values_out_of_range_at_a_step_leave_the_state_as_it_was():
    robot = Gantry()
    reference = ForceReference("tool", 1.0, 1.0, 1.0, axes="xyz")
    reference.advance(robot, FREE, 0.1, np.zeros(3))
    before = reference.velocity
    for arguments, text in (
        ((np.zeros(6), 0.1, np.zeros(3)), "wrench is a ndarray; give a Wrench"),
        ((FREE, 0.0, np.zeros(3)), "dt is 0.0"),
        ((FREE, 0.1, None), r"so it needs v, .* choose feedback='commanded'"),
        ((FREE, 0.1, [np.nan, 0, 0]), "the velocity given to 'tool force'"),
        ((FREE, 0.1, [0.0]), r"the velocity given to 'tool force' has shape \(1,\)"),
    ):
        with pytest.raises(SettingError, match=text):
            reference.advance(robot, *arguments)
    np.testing.assert_array_equal(reference.velocity, before)
