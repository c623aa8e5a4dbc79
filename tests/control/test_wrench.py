"""Wrenches about other points, sign and axes of a sensor, and readings that cannot be trusted."""

import numpy as np
import pytest

from hqp_rp.control.wrench import Wrench, WrenchSensor
from hqp_rp.core.errors import SettingError
from tests.control.chain import random_chain, random_rotation
from tests.control.gantry import Gantry

READING = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])


def test_the_torque_about_another_point_does_the_same_work():
    rng = np.random.default_rng(0)
    force, torque, point, other, velocity, omega = rng.normal(size=(6, 3))
    moved = Wrench(force, torque, point).about(other)
    np.testing.assert_array_equal(moved[:3], force)
    # A rigid body that moves with `velocity` at `point` moves so at `other`:
    at_other = velocity + np.cross(omega, other - point)
    assert moved[:3] @ at_other + moved[3:] @ omega == pytest.approx(force @ velocity + torque @ omega)


@pytest.mark.parametrize(("measures", "sign"), [("on_environment", 1.0), ("on_robot", -1.0)])
@pytest.mark.parametrize("axes", [None, "world", "link3"])
def test_sign_and_axes_of_a_reading(measures, sign, axes):
    robot = random_chain(np.random.default_rng(1))
    wrench = WrenchSensor("tool", measures=measures, expressed_in=axes).read(robot, READING, 0.001)
    R = np.eye(3) if axes == "world" else robot.pose(axes or "tool")[0]
    np.testing.assert_allclose(wrench.force, sign * R @ READING[:3], atol=1e-15)
    np.testing.assert_allclose(wrench.torque, sign * R @ READING[3:], atol=1e-15)
    np.testing.assert_array_equal(wrench.point, robot.pose("tool")[1])


@pytest.mark.parametrize("bad", [None, [np.nan] * 6, [0, 0, np.inf, 0, 0, 0]])
def test_the_last_good_reading_stands_in_for_ten_milliseconds_and_no_longer(bad):
    sensor, robot = WrenchSensor("tool", measures="on_environment"), Gantry()
    sensor.read(robot, READING, 0.001)
    for _ in range(10):
        assert sensor.read(robot, bad, 0.001).force.tolist() == READING[:3].tolist()
        assert not sensor.fault
    assert sensor.read(robot, bad, 0.001) is None
    what = "came" if bad is None else "was finite"
    assert sensor.fault == f"No force reading {what} for more than 0.01 s."
    assert sensor.read(robot, 2 * READING, 0.001).force.tolist() == (2 * READING[:3]).tolist()
    assert not sensor.fault


def test_the_reading_that_stands_in_turns_with_the_robot():
    rng = np.random.default_rng(2)
    robot = Gantry(random_rotation(rng))
    sensor = WrenchSensor("tool", measures="on_environment")
    sensor.read(robot, READING, 0.001)
    robot.rotation = random_rotation(rng)
    np.testing.assert_allclose(sensor.read(robot, None, 0.001).force, robot.rotation @ READING[:3], atol=1e-15)


def test_no_reading_at_the_beginning_is_a_fault_at_once():
    sensor = WrenchSensor("tool", measures="on_robot")
    assert sensor.read(Gantry(), None, 0.001) is None
    assert sensor.fault == "There has been no force reading yet."


def test_a_reading_that_does_not_change_is_a_fault_after_its_window():
    sensor, robot = WrenchSensor("tool", measures="on_robot"), Gantry()
    given = [sensor.read(robot, READING, 0.001) is not None for _ in range(120)]
    assert given == [True] * 100 + [False] * 20  # the first one, then 99 repetitions; the 100th has lasted 0.1 s
    assert sensor.fault == "The force reading has not changed by a single bit for 0.1 s."
    assert sensor.read(robot, np.nextafter(READING, 9.0), 0.001) is not None


def test_stand_ins_do_not_hide_a_frozen_sensor():
    sensor, robot = WrenchSensor("tool", measures="on_robot", frozen_after=0.05), Gantry()
    given = [sensor.read(robot, READING if k % 2 == 0 else None, 0.001) is not None for k in range(200)]
    assert given[0]
    assert not given[-1]


@pytest.mark.parametrize(
    ("reading", "settings", "fine"),
    [
        (0 * READING, {}, True),
        (0 * READING, {"zeros_freeze": True}, False),
        (READING, {"frozen_after": None}, True),
    ],
)
def test_what_counts_as_frozen(reading, settings, fine):
    sensor, robot = WrenchSensor("tool", measures="on_robot", **settings), Gantry()
    assert all(sensor.read(robot, reading, 0.01) is not None for _ in range(50)) is fine


@pytest.mark.parametrize("reading", [[1, 2, 3], "force", [[1] * 6], ["a"] * 6])
def test_a_reading_of_another_kind_is_misuse(reading):
    with pytest.raises(SettingError, match="it must be 6 numbers in N and N m"):
        WrenchSensor("tool", measures="on_robot").read(Gantry(), reading, 0.001)


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"measures": "force"}, "measures is 'force'; it must be 'on_environment' or 'on_robot'"),
        ({"measures": "on_robot", "missing_after": -1.0}, "missing_after is -1.0"),
        ({"measures": "on_robot", "frozen_after": 0.0}, "frozen_after is 0.0; it must be a finite number > 0"),
        ({"measures": "on_robot", "expressed_in": 3}, "expressed_in is 3; it must be the name of a frame"),
    ],
)
def test_settings_out_of_range(settings, text):
    with pytest.raises(SettingError, match=text):
        WrenchSensor("tool", **settings)


def test_a_wrench_is_finite():
    with pytest.raises(SettingError, match="force"):
        Wrench([np.nan, 0, 0])
    with pytest.raises(SettingError, match=r"torque has shape \(2,\); it must be 3 numbers in N m"):
        Wrench([0, 0, 0], [1, 2])
