"""The loop around references: what it sends while all is well, limits, and misuse."""

import numpy as np
import pytest

import hqp_rp
from hqp_rp import SettingError
from hqp_rp.control import (
    ForceReference,
    InteractionController,
    JointLimit,
    Mode,
    PostureTask,
    Stack,
    VelocityLimit,
    WrenchSensor,
)
from hqp_rp.control.interaction_controller import _shortened
from tests.control.chain import random_chain
from tests.control.interaction import DT, Failing, living, make, press, robot_with_speed_limit, run


def test_it_is_the_loop_written_by_hand():
    robot, twin = (random_chain(np.random.default_rng(1)) for _ in range(2))
    controller = make(robot)
    by_hand = press(twin)
    stack = Stack(list(by_hand))
    sensor = WrenchSensor("tool", measures="on_environment", expressed_in="world")
    v0 = np.random.default_rng(2).normal(size=7)
    controller.start(robot, v0)
    for reference in by_hand:
        reference.start(twin, v0)
    for k in range(40):
        command = controller.step(robot, living(k, 3.0), DT)
        wrench = sensor.read(twin, living(k, 3.0), DT)
        for reference in by_hand:
            reference.advance(twin, wrench, DT)
        v = hqp_rp.solve(stack.problem(twin), "reverse_priority").x
        for reference in by_hand:
            reference.deliver(twin, v)
        np.testing.assert_array_equal(command.v, v)
        assert command.mode is Mode.RUNNING
        assert command.scale == 1.0
        assert command.solution.problem is command.problem
        assert command.solve_time > 0.0
        robot.update(robot.integrate(robot.q, v, DT))
        twin.update(robot.q)


def test_the_first_command_continues_the_motion():
    robot = random_chain(np.random.default_rng(3))
    v = np.linalg.pinv(robot.jacobian("tool")) @ np.random.default_rng(4).normal(size=6)
    jumps = []
    for dt in (1e-3, 1e-4):
        controller = make(robot)
        controller.start(robot, v)
        jumps.append(np.linalg.norm(controller.step(robot, living(0), dt).v - v))
    assert jumps[0] < 0.05 * np.linalg.norm(v)
    assert jumps[1] == pytest.approx(0.1 * jumps[0], rel=0.02)


def test_another_robot_needs_a_start_of_its_own():
    controller = make(robot := random_chain(np.random.default_rng(0)))
    run(controller, robot, 2)
    other = random_chain(np.random.default_rng(1))
    with pytest.raises(SettingError, match="was started with another robot; call start"):
        controller.step(other, living(0), DT)
    controller.start(other)
    assert controller.step(other, living(0), DT).mode is Mode.RUNNING


def test_scaling_keeps_the_direction_and_tells_the_references():
    robot = robot_with_speed_limit(0.02)
    controller = make(robot, scale_into=[VelocityLimit()])
    commands = run(controller, robot, 300)
    shortened = [c for c in commands if c.scale < 1.0]
    assert len(shortened) > 50
    for command in shortened:
        assert np.abs(command.v).max() == pytest.approx(0.02, rel=1e-9)
        np.testing.assert_allclose(command.v, command.scale * command.solution.x, rtol=1e-12)
    push = controller.references[0]
    # The state stays near what is delivered: at most recovery * (F_d / M_d) ahead of it.
    assert push.velocity[0] - (push.jacobian(robot) @ commands[-1].v)[0] < 0.05 * 30.0 / 15.0 * 1.05


@pytest.mark.parametrize(
    ("x", "lower", "upper", "scale"),
    [
        ([3.0, 1.0], [-1.0, -1.0], [1.0, 1.0], 1.0 / 3.0),
        ([-3.0, 4.0], [-1.0, -1.0], [9.0, 8.0], 1.0 / 3.0),
        ([0.5, 0.5], [-1.0, -1.0], [1.0, 1.0], 1.0),
        ([1.0, 3.0], [2.0, -1.0], [5.0, 1.5], 0.5),  # the first row forbids 0: shortening cannot meet it
        ([1.0, 1.0], [0.5, -9.0], [0.5, 9.0], 1.0),  # nor an equality
        ([1.0, 1e-9], [-9.0, -9.0], [9.0, 0.0], 1.0),  # rounding at a bound of 0
        ([1.0, 1e-3], [-9.0, -9.0], [9.0, 0.0], 0.0),
        ([7.0, -2.0], [-np.inf, -np.inf], [np.inf, 1.0], 1.0),
    ],
)
def test_by_what_factor_an_answer_is_shortened(x, lower, upper, scale):
    s = _shortened(np.array(x), np.eye(2), np.array(lower), np.array(upper))
    assert s == pytest.approx(scale, rel=1e-15)


def test_what_is_shortened_is_within_its_limits_to_the_last_bit():
    rng = np.random.default_rng(6)
    for _ in range(500):
        x, bound = 10.0 * rng.normal(size=5), rng.uniform(0.1, 1.0, 5)
        assert (np.abs(_shortened(x, np.eye(5), -bound, bound) * x) <= bound).all()


def test_an_answer_beyond_a_hard_limit_is_shortened_to_it():
    robot = robot_with_speed_limit(1.0)
    controller = make(robot, Failing(at=20, how="too fast"), limits=[VelocityLimit()])
    commands = run(controller, robot, 30)
    assert max(np.abs(c.v).max() for c in commands) == pytest.approx(1.0, rel=1e-9)
    assert max(np.abs(c.v).max() for c in commands) <= 1.0
    assert commands[-1].scale < 1.0


def test_limits_on_accelerations_get_the_last_command():
    robot = robot_with_speed_limit(2.0)
    limits = [JointLimit(position=False, acceleration=0.5)]
    commands = run(make(robot, "qp_cascade", limits=limits), robot, 20)
    assert all(c.mode is Mode.RUNNING for c in commands)
    v = np.array([np.zeros(7), *(c.v for c in commands)])
    assert np.abs(np.diff(v, axis=0)).max() <= 0.5 * DT * (1 + 1e-6)


def test_limits_on_jerks_get_the_change_of_the_last_commands():
    robot = robot_with_speed_limit(2.0)
    limits = [JointLimit(position=False, acceleration=0.5, jerk=20.0)]
    commands = run(make(robot, "qp_cascade", limits=limits), robot, 20)
    assert all(c.mode is Mode.RUNNING for c in commands)
    v = np.array([np.zeros(7), np.zeros(7), *(c.v for c in commands)])
    assert np.abs(np.diff(v, n=2, axis=0)).max() <= 20.0 * DT**2 + 1e-6 * DT


def test_a_free_vector_reaches_the_solver():
    robot = random_chain(np.random.default_rng(0))
    levels = [ForceReference("tool", 15.0, 150.0, 30.0, axes="x", feedback="commanded")]
    z = np.random.default_rng(5).normal(size=7)
    command = make(robot, levels=levels).step(robot, living(0), DT, secondary=z)
    np.testing.assert_array_equal(command.v, hqp_rp.solve(command.problem, "reverse_priority", secondary=z).x)
    assert np.linalg.norm(command.v) > 1.0


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"stack": "tasks"}, "stack is a str; give a Stack"),
        ({"sensor": None}, "sensor is a NoneType; give a WrenchSensor"),
        ({"stack": Stack([PostureTask(np.zeros(7))])}, "holds no force, impedance or hybrid reference"),
        ({"stop_time": 0.0}, "stop_time is 0.0; it must be a finite number > 0"),
        ({"scale_into": [3]}, "scale_into holds 3, which is no Limit"),
    ],
)
def test_what_it_does_not_take(change, text):
    robot = random_chain(np.random.default_rng(0))
    values = {
        "stack": Stack(list(press(robot))),
        "sensor": WrenchSensor("tool", measures="on_robot"),
        "solver": "null_space",
    } | change
    with pytest.raises(SettingError, match=text):
        InteractionController(values.pop("stack"), values.pop("sensor"), values.pop("solver"), **values)
    with pytest.raises(hqp_rp.UnknownNameError, match="There is no solver named"):
        make(robot, "null space")


def test_an_unknown_frame_is_an_error_at_the_start():
    robot = random_chain(np.random.default_rng(0))
    controller = make(robot, levels=[ForceReference("hand", 1, 1, axes="x")])
    with pytest.raises(hqp_rp.HqpError, match=r"'hand force': .*hand"):
        controller.start(robot)
