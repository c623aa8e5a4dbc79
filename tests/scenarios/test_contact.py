"""Contact physics: the wall has the stiffness, damping and mass asked for, it pushes and never pulls, energy adds up."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.arms import sawyer
from hqp_rp.scenarios._contact import ContactArm, Surface

ARM = sawyer()
START = np.array(ARM.neutral)
TOOL = ARM.pose(START, "tool")[1]


def towards(velocity: tuple[float, float, float]) -> FloatArray:
    """(7,) rad/s that move the tool along `velocity` m/s without turning it."""
    return np.linalg.pinv(ARM.jacobian(START, "tool")) @ np.array([*velocity, 0.0, 0.0, 0.0])


def at_start(surface: Surface, timestep: float = 5e-4) -> ContactArm:
    contact = ContactArm(ARM, timestep, {"x": float(TOOL[0]), "y": float(TOOL[1])}, surface)
    contact.reset(START)
    return contact


@pytest.mark.parametrize("stiffness", [1e4, 1e5, 1e6])
@pytest.mark.parametrize("timestep", [1e-3, 2.5e-4])
def test_measured_stiffness_is_the_one_asked_for(stiffness: float, timestep: float) -> None:
    """Force over depth, both read from the simulation at rest under two loads, within 5 % as promised; it is 0.1 %."""
    contact = at_start(Surface(stiffness), timestep)
    rests = []
    for speed in (0.01, 0.02):
        for _ in range(10):
            touch = contact.advance(towards((speed, 0.5 * speed, 0.0)), round(0.05 / timestep))
        rests.append(touch)
    data = contact.robot.data
    assert np.abs(ARM.jacobian(data.qpos, "tool")[:2] @ data.qvel).max() < 1e-3  # the ball rests, the arm still yields
    for axis in "xy":
        rise = rests[1].force[axis] - rests[0].force[axis]
        assert rise > 1.0
        measured = rise / (rests[1].depth[axis] - rests[0].depth[axis])
        assert measured == pytest.approx(stiffness, rel=1e-3)
        assert rests[1].force[axis] == pytest.approx(stiffness * rests[1].depth[axis], rel=1e-3)


def test_moving_contact_obeys_the_law_of_the_environment() -> None:
    """F_e = K_e r + B_e r' + M_e r'' at every step of an impact, the derivatives from MuJoCo's own state."""
    surface = Surface(1e5, 40.0, 0.02)
    contact = at_start(surface)
    model, data = contact.robot.model, contact.robot.data
    jacobian, seen = np.zeros((3, model.nv)), 0
    site = model.site("tool").id
    for _ in range(40):
        touch = contact.advance(towards((0.1, 0.0, 0.0)), 1)
        mujoco.mj_jacSite(model, data, jacobian, None, site)
        if touch.force["x"] > 0.0:
            speed = jacobian[0] @ data.qvel
            # J' q' by central differences of J along q'.
            h = 1e-6
            ends = [ARM.jacobian(data.qpos + sign * h * data.qvel, "tool")[0] @ data.qvel for sign in (1.0, -1.0)]
            acceleration = jacobian[0] @ data.qacc + (ends[0] - ends[1]) / (2.0 * h)
            law = 1e5 * touch.depth["x"] + 40.0 * speed + 0.02 * acceleration
            assert touch.force["x"] == pytest.approx(law, rel=2e-2, abs=2e-2)
            seen += 1
    assert seen > 20


def test_walls_never_pull_and_only_the_ball_is_touched() -> None:
    contact = at_start(Surface())
    contact.advance(towards((0.02, 0.0, 0.0)), 400)
    assert contact.reading()[0] > 5.0
    touch = contact.advance(towards((-0.05, 0.0, 0.0)), 400)
    assert touch.force["x"] == 0.0
    assert touch.depth["x"] < 0.0
    assert 0.0 < touch.share["x"] < 1.0
    assert (contact.reading() == 0.0).all()
    inside = START.copy()
    inside[0] += 1.0  # the ball leaves the corner, links stand in both walls
    contact.reset(inside)
    assert contact.robot.data.ncon <= 2


def test_energy_is_what_the_wall_stores_and_what_its_damper_takes() -> None:
    """At rest, slowly loaded: F^2 / (2 K_e) and no more; pushing and letting go leaves nothing but the damper's part."""
    contact = at_start(Surface(1e5, 0.0))
    total = 0.0
    for k in range(200):
        touch = contact.advance(towards((0.0001 * k, 0.0, 0.0)), 5)
        total += touch.energy["x"]
    assert touch.force["x"] > 5.0
    assert total == pytest.approx(touch.force["x"] ** 2 / 2e5, rel=1e-2)
    loaded = total
    for _ in range(200):
        total += contact.advance(towards((-0.02, 0.0, 0.0)), 5).energy["x"]
    assert abs(total) < 0.02 * loaded


def test_peak_is_the_largest_of_all_steps_and_share_counts_them() -> None:
    one, many = at_start(Surface()), at_start(Surface())
    push = towards((0.05, 0.0, 0.0))
    singles = [one.advance(push, 1) for _ in range(20)]
    together = many.advance(push, 20)
    assert together.peak["x"] == max(touch.peak["x"] for touch in singles)
    assert together.share["x"] == pytest.approx(np.mean([touch.share["x"] for touch in singles]))
    assert together.energy["x"] == pytest.approx(sum(touch.energy["x"] for touch in singles))
    assert together.force == singles[-1].force


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"stiffness": 0.0}, "stiffness of a wall is 0.0; it must be a finite number > 0"),
        ({"damping": -1.0}, "damping of a wall is -1.0; it must be a finite number >= 0"),
        ({"mass": float("nan")}, "mass of a wall is nan"),
    ],
)
def test_impossible_surfaces_are_refused(settings: dict[str, float], message: str) -> None:
    with pytest.raises(SettingError, match=message):
        Surface(**settings)


def test_a_mass_that_mujoco_cannot_represent_is_refused() -> None:
    with pytest.raises(SettingError, match="mass of a wall is 1e-07 kg; MuJoCo takes"):
        at_start(Surface(mass=1e-7))
