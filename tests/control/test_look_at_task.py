"""Looking at a place: the Jacobian is the derivative of the angle, whether the frame turns or moves."""

import numpy as np
import pytest

from hqp_rp.control import LookAtTask, PointingTask
from hqp_rp.core.errors import SettingError
from tests.control.chain import random_chain
from tests.control.test_task_derivatives import check_energy, derivative


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("point", [None, [0.1, -0.2, 0.3]])
def test_the_energy_is_exact(seed: int, point) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(rng)
    check_energy(robot, LookAtTask("tool", rng.normal(size=3), axis=rng.normal(size=3), point=point), rng)


def test_the_error_is_that_of_pointing_in_the_direction_of_the_place() -> None:
    rng = np.random.default_rng(1)
    robot = random_chain(rng)
    place = rng.normal(size=3)
    R, p = robot.pose("tool")
    point = np.array([0.1, 0.2, 0.3])
    task = LookAtTask("tool", place, axis="x", point=point)
    pointing = PointingTask("tool", place - p - R @ point, axis="x")
    np.testing.assert_allclose(task.error(robot), pointing.error(robot), atol=1e-14)


def test_far_away_it_is_pointing_and_near_by_moving_counts() -> None:
    robot = random_chain(np.random.default_rng(3))
    direction = np.array([0.3, -0.5, 0.8])
    far, pointing = LookAtTask("tool", 1e9 * direction), PointingTask("tool", direction)
    np.testing.assert_allclose(far.jacobian(robot), pointing.jacobian(robot), atol=1e-8)
    near = LookAtTask("tool", robot.pose("tool")[1] + 0.05 * direction)
    assert np.abs(near.jacobian(robot) - pointing.jacobian(robot)).max() > 1.0


def test_a_place_that_moves_is_followed() -> None:
    rng = np.random.default_rng(4)
    robot = random_chain(rng)
    place, velocity, v = rng.normal(size=3), rng.normal(size=3), rng.normal(size=robot.nv)
    task = LookAtTask("tool", place, gain=0.0, feedforward=velocity)
    J, rate = task.evaluate(robot)
    plain = LookAtTask("tool", place)
    q, h, values = robot.q.copy(), 1e-6, []
    for s in (h, -h):
        robot.update(q + s * v)
        plain.target = place + s * velocity
        values.append(0.5 * plain.error(robot) @ plain.error(robot))
    robot.update(q)
    plain.target = place
    assert (values[0] - values[1]) / (2 * h) == pytest.approx(plain.error(robot) @ (rate - J @ v), abs=1e-6)


def test_a_place_at_the_eye_gives_no_error() -> None:
    robot = random_chain(np.random.default_rng(5))
    task = LookAtTask("tool", robot.pose("tool")[1])
    J, rate = task.evaluate(robot)
    np.testing.assert_allclose(rate, 0.0, atol=1e-15)
    assert np.isfinite(J).all()


def test_names_and_bad_input() -> None:
    assert LookAtTask("tool", [1, 2, 3]).name == "tool look at"
    for build, message in (
        (lambda: LookAtTask("tool", [1, 2]), "the target of 'tool look at' has shape"),
        (lambda: LookAtTask("tool", [1, 2, 3], axis="w"), "the axis of 'tool look at' is 'w'"),
        (lambda: LookAtTask("tool", [1, 2, 3], point=[1]), "the point of 'tool look at' has shape"),
        (lambda: LookAtTask("tool", [1, 2, 3], feedforward=[np.nan, 0, 0]), "the feedforward of 'tool look at'"),
    ):
        with pytest.raises(SettingError, match=message):
            build()


def test_derivative_helper_sees_a_wrong_jacobian() -> None:
    robot = random_chain(np.random.default_rng(6))
    task = LookAtTask("tool", [1.0, 2.0, 3.0])
    v = np.ones(robot.nv)
    change = derivative(robot, lambda: task.error(robot) @ task.error(robot) / 2, v)
    turned_alone = PointingTask("tool", task.target - robot.pose("tool")[1])
    assert abs(change + task.error(robot) @ turned_alone.jacobian(robot) @ v) > 1e-3
