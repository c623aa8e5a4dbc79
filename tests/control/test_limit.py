"""The plain velocity limit."""

import numpy as np
import pytest

from hqp_rp.control import Limit, VelocityLimit
from hqp_rp.core.errors import RobotError, SettingError
from tests.control.chain import Chain, random_chain

robot = random_chain(np.random.default_rng(0))


@pytest.mark.parametrize(
    ("limit", "expected"),
    [
        (None, [1.5] * 7),
        (0.5, [0.5] * 7),
        ([1, 2, 3, 4, 5, 6, np.inf], [1, 2, 3, 4, 5, 6, np.inf]),
        ({"joint2": 0.1}, [1.5, 0.1, 1.5, 1.5, 1.5, 1.5, 1.5]),
    ],
)
def test_rows(limit, expected):
    item = VelocityLimit(limit)
    assert isinstance(item, Limit)
    for _ in range(2):
        G, low, high = item.rows(robot, 0.1, None)
        np.testing.assert_array_equal(G, np.eye(7))
        np.testing.assert_array_equal(high, expected)
        np.testing.assert_array_equal(low, -high)


def test_another_robot_gets_its_own_rows():
    item = VelocityLimit()
    assert len(item.rows(robot, 0.1, None)[1]) == 7
    other = Chain(np.ones((2, 3)), np.ones((3, 3)), velocity=0.3)
    np.testing.assert_array_equal(item.rows(other, 0.1, None)[2], [0.3, 0.3])


def test_errors():
    with pytest.raises(SettingError, match=r"the limit of 'joint velocity' is 0.0; it must be > 0"):
        VelocityLimit(0.0)
    with pytest.raises(SettingError, match=r"'joint1' has 'fast'; it must be a number > 0"):
        VelocityLimit({"joint1": "fast"})
    with pytest.raises(RobotError, match=r"the robot has no velocity limit and none is given; give `limit`"):
        VelocityLimit().rows(Chain(np.ones((2, 3)), np.ones((3, 3)), velocity=np.inf), 0.1, None)
