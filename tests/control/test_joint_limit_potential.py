"""The joint-limit potential (8) and its gradient."""

import numpy as np
import pytest

from hqp_rp.control import JointLimitPotential
from hqp_rp.core.errors import RobotError, SettingError
from tests.control.chain import Chain, random_chain


def chain(seed=0):
    rng = np.random.default_rng(seed)
    robot = random_chain(rng)
    robot.lower, robot.upper = -rng.uniform(0.5, 3.0, 7), rng.uniform(0.5, 3.0, 7)
    return robot


@pytest.mark.parametrize("form", ["squared", "printed"])
@pytest.mark.parametrize("unlimited", [(), (2, 5)])
def test_gradient_against_finite_differences(form, unlimited):
    robot, potential = chain(), JointLimitPotential(form=form)
    robot.upper[list(unlimited)] = np.inf
    q, h = robot.q.copy(), 1e-6
    for i in range(7):
        values = []
        for s in (h, -h):
            robot.update(q + s * np.eye(7)[i])
            values.append(potential.value(robot))
        robot.update(q)
        assert potential.gradient(robot)[i] == pytest.approx((values[0] - values[1]) / (2 * h), abs=1e-8)
        assert (i not in unlimited) or potential.gradient(robot)[i] == 0.0


def test_is_0_in_the_middle_and_1_at_the_limits():
    robot, potential = chain(), JointLimitPotential()
    middle = (robot.lower + robot.upper) / 2
    robot.update(middle)
    assert potential.value(robot) == pytest.approx(0.0, abs=1e-30)
    robot.update(np.where(np.arange(7) % 2, robot.lower, robot.upper))
    assert potential.value(robot) == pytest.approx(1.0)


def test_the_squared_form_leads_to_the_middle_and_the_printed_one_to_an_end():
    robot = chain()
    middle = (robot.lower + robot.upper) / 2
    for form, ends in (("squared", middle), ("printed", np.full(7, np.inf))):
        potential = JointLimitPotential(gain=2.0, form=form)
        robot.update(middle + 0.1)
        v = potential.velocity(robot)
        np.testing.assert_allclose(v, -2.0 * potential.gradient(robot))
        assert (np.sign(v) == np.sign(ends - robot.q)).all()


def test_printed_form_is_equation_8():
    robot = chain()
    mid = (robot.lower + robot.upper) / 2
    expected = ((robot.q - mid) / (mid - robot.upper)).sum()
    assert JointLimitPotential(form="printed").value(robot) == pytest.approx(expected)


def test_follows_the_robot_it_is_given():
    potential = JointLimitPotential()
    first, second = chain(1), Chain(np.ones((2, 3)), np.ones((3, 3)), limit=1.0)
    assert potential.gradient(first).shape == (7,)
    second.update(np.array([0.5, -1.0]))
    np.testing.assert_allclose(potential.gradient(second), [0.5, -1.0])


def test_errors():
    with pytest.raises(SettingError, match=r"the form .* is 'cubic'; valid: 'squared', 'printed'"):
        JointLimitPotential(form="cubic")
    with pytest.raises(SettingError, match=r"gain of a joint-limit potential is -1.0; it must be finite and >= 0"):
        JointLimitPotential(gain=-1.0)
    with pytest.raises(SettingError, match=r"give one number"):
        JointLimitPotential(gain=[1.0, 2.0])
    with pytest.raises(RobotError, match=r"needs a joint with two finite position limits"):
        JointLimitPotential().value(Chain(np.ones((2, 3)), np.ones((3, 3)), limit=np.inf))
