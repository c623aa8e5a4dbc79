"""What an interaction controller does when a reading, a motion, a row or a solve fails: hold, stop, stay stopped."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hqp_rp
from hqp_rp.control import ForceReference, JointLimit, Mode, PostureTask, VelocityLimit
from tests.control.chain import random_chain
from tests.control.gantry import Gantry
from tests.control.interaction import DT, Failing, living, make, press, robot_with_speed_limit, run


def check_stop(commands, good, reason, stop_time=0.1):
    """`good` commands, then the straight ramp to exactly zero within stop_time, then zeros; all finite, with a reason."""
    assert all(c.mode is Mode.RUNNING and not c.reason for c in commands[:good])
    last = commands[good - 1].v
    assert last.any()
    steps = round(stop_time / DT)
    for i, command in enumerate(commands[good:]):
        expected = max(0.0, 1.0 - (i + 1) / steps) * last
        np.testing.assert_allclose(command.v, expected, atol=1e-12 * np.abs(last).max())
        assert reason in command.reason
        assert command.mode is (Mode.HOLDING if i + 1 < steps else Mode.STOPPED)
        assert i + 1 < steps or not command.v.any()


@pytest.mark.parametrize(
    ("bad", "reason", "grace"),
    [
        (lambda k: None, "No force reading came for more than 0.01 s", 10),
        (lambda k: np.full(6, np.nan), "No force reading was finite for more than 0.01 s", 10),
        (lambda k: np.array([0, np.inf, 0, 0, 0, 0]), "No force reading was finite", 10),
        (lambda k: living(49), "has not changed by a single bit for 0.1 s", 99),
    ],
    ids=["missing", "nan", "infinite", "frozen"],
)
@pytest.mark.parametrize("solver", ["reverse_priority", "damped_least_squares"])
def test_a_reading_that_fails_leads_to_hold_and_stop(bad, reason, grace, solver):
    robot = random_chain(np.random.default_rng(0))
    controller = make(robot, solver)
    commands = run(controller, robot, 400, lambda k: living(k) if k < 50 else bad(k))
    check_stop(commands, 50 + grace, reason)


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("no x", "The solver failed: The computation overflowed or produced NaN: there is no answer. It overflowed."),
        ("nan", "The solver failed"),
        ("iterations", "The solver failed: The iteration limit was reached"),
        ("infeasible", "The solver failed: The hard rows contradict each other"),
    ],
)
def test_a_solve_that_fails_leads_to_hold_and_stop(how, reason):
    robot = random_chain(np.random.default_rng(0))
    commands = run(make(robot, Failing(at=60, how=how), stop_time=0.05), robot, 200)
    check_stop(commands, 60, reason, 0.05)


def test_the_ramp_ends_in_time_where_the_periods_do_not_add_up_in_binary():
    robot = random_chain(np.random.default_rng(0))
    controller = make(robot, Failing(at=1), stop_time=1.0)
    commands = [controller.step(robot, living(k), 0.1) for k in range(11)]  # ten times 0.1 is less than 1
    assert commands[-2].mode is Mode.HOLDING
    assert commands[-1].mode is Mode.STOPPED
    assert not commands[-1].v.any()


def test_an_inaccurate_answer_is_used_or_not_as_asked():
    robot = random_chain(np.random.default_rng(0))
    commands = run(make(robot, Failing(at=5, how="inaccurate")), robot, 20)
    assert all(c.mode is Mode.RUNNING for c in commands)
    commands = run(make(robot, Failing(at=5, how="inaccurate"), accept_inaccurate=False), robot, 20)
    assert [c.mode is Mode.RUNNING for c in commands] == [True] * 5 + [False] * 15


def test_a_solver_that_refuses_the_stack_is_refused_itself():
    robot = robot_with_speed_limit()
    with pytest.raises(
        hqp_rp.SettingError, match=r"reverse_priority is a closed form without hard rows; .* It was given Stack"
    ):
        make(robot, "reverse_priority", limits=[VelocityLimit()])


def test_a_measured_motion_that_is_not_finite_leads_to_hold():
    robot = random_chain(np.random.default_rng(0))
    controller = make(robot, levels=press(robot, feedback="measured"))
    v = np.zeros(7)
    commands = []
    for k in range(200):
        commands.append(controller.step(robot, living(k), DT, v if k < 40 else np.full(7, np.nan)))
        v = commands[-1].v
        robot.update(robot.integrate(robot.q, v, DT))
    check_stop(commands, 40, "The measured velocity is not finite")


class Spoilt:
    """A task of a user whose rate becomes nan after `at` calls."""

    name = "spoilt"

    def __init__(self, at):
        self.left = at

    def evaluate(self, robot):
        self.left -= 1
        return np.ones((1, robot.nv)), np.array([0.0 if self.left >= 0 else np.nan])


def test_rows_that_are_not_finite_lead_to_hold_and_before_the_first_command_to_an_error():
    robot = random_chain(np.random.default_rng(0))
    commands = run(make(robot, levels=[*press(robot), Spoilt(30)]), robot, 200)
    assert [c.mode is Mode.RUNNING for c in commands] == [True] * 30 + [False] * 170
    assert "'spoilt': rate[0] is nan" in commands[-1].reason
    assert all(np.isfinite(c.v).all() for c in commands)
    assert not commands[-1].v.any()
    with pytest.raises(hqp_rp.ProblemError, match=r"'spoilt': rate\[0\] is nan"):
        run(make(robot, levels=[*press(robot), Spoilt(0)]), robot, 1)


def test_a_robot_whose_limits_cannot_be_told_any_more_stops_at_once():
    robot = robot_with_speed_limit()
    controller = make(robot, Failing(at=99), [*press(robot), Spoilt(30)], [VelocityLimit()])
    commands = run(controller, robot, 40)
    assert commands[29].v.any()
    assert commands[30].mode is Mode.STOPPED
    assert commands[30].scale == 0.0


def test_the_stop_is_latched_until_a_reset():
    robot = random_chain(np.random.default_rng(0))
    levels = press(robot)
    controller = make(robot, levels=levels, stop_time=0.02)
    commands = run(controller, robot, 60, lambda k: living(k) if k < 20 or k > 35 else None)
    assert controller.mode is Mode.STOPPED
    assert "No force reading" in controller.reason
    assert not commands[-1].v.any()
    controller.reset(robot)
    assert controller.mode is Mode.RUNNING
    assert not controller.reason
    again = controller.step(robot, living(0), DT).v
    fresh = make(robot, levels=levels)
    fresh.start(robot)
    np.testing.assert_array_equal(fresh.step(robot, living(0), DT).v, again)


@settings(deadline=None, max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    kinds=st.lists(
        st.sampled_from(["good", "none", "nan", "inf", "huge", "more", "zeros", "same"]), min_size=30, max_size=60
    ),
    solver=st.sampled_from(["reverse_priority", "null_space", "qp_cascade"]),
    feedback=st.sampled_from(["commanded", "measured"]),
    dt=st.sampled_from([1e-4, 1e-3, 2e-2]),
)
def test_a_command_is_always_finite_within_limits_and_never_revives(seed, kinds, solver, feedback, dt):
    rng = np.random.default_rng(seed)
    robot = robot_with_speed_limit(0.5, seed)
    hard = [VelocityLimit()] if solver == "qp_cascade" else []
    controller = make(
        robot,
        solver,
        levels=press(robot, feedback=feedback),
        limits=hard,
        scale_into=[] if hard else [VelocityLimit()],
        stop_time=0.01,
    )
    controller.start(robot)
    stopped, v = False, np.zeros(7)
    for kind in kinds:
        reading = {
            "good": 20.0 * rng.normal(size=6),
            "none": None,
            "nan": np.where(rng.random(6) < 0.5, np.nan, 1.0) * [1, 1, 1, 1, 1, np.nan],
            "inf": np.full(6, -np.inf),
            "huge": 1e12 * rng.normal(size=6),
            "more": np.full(6, 1e300),
            "zeros": np.zeros(6),
            "same": np.ones(6),
        }[kind]
        command = controller.step(robot, reading, dt, v)
        assert command.v.shape == (7,)
        assert np.isfinite(command.v).all()
        assert (np.abs(command.v) <= 0.5 * (1.0 + 1e-12)).all()
        if stopped:
            assert command.mode is not Mode.RUNNING
        stopped = command.mode is not Mode.RUNNING
        assert stopped == bool(command.reason)
        v = command.v
        robot.update(robot.integrate(robot.q, v, dt))


def test_the_hold_stays_within_position_limits():
    """Running at a limit when the reading fails: the ramp is shortened where the remaining way asks for it."""
    robot = Gantry(spare=0)
    robot.upper = np.array([0.0205, np.inf, np.inf])
    force = ForceReference("tool", 1.0, 10.0, 5.0, axes="x", feedback="commanded")
    controller = make(
        robot, "qp_cascade", [force, PostureTask(robot.neutral)], [JointLimit(velocity=9.0)], stop_time=0.5
    )
    commands = run(controller, robot, 400, lambda k: living(k) if k < 85 else None)
    assert commands[-1].mode is not Mode.RUNNING
    held = [c for c in commands if c.mode is not Mode.RUNNING]
    assert held[0].v[0] > 0.1
    assert min(c.scale for c in held) < 1.0
    assert robot.q[0] <= robot.upper[0] + 1e-9
