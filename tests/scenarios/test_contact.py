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


def test_a_sliding_ball_meets_coulomb_friction_and_a_resting_one_stays_within_it() -> None:
    """At constant speed along the wall the tangential force is mu times the normal one, with the motion: on the wall."""
    mu = 0.3
    contact = at_start(Surface(1e4, friction=mu), 5e-4)
    contact.advance(towards((0.02, 0.0, 0.0)), 800)
    still = contact.reading()
    assert still[0] > 2.0
    assert np.linalg.norm(still[1:3]) <= 1.001 * mu * still[0]
    for sign in (1.0, -1.0):
        contact.advance(towards((0.0, 0.0, sign * 0.05)), 400)
        sliding = contact.reading()
        assert sliding[2] == pytest.approx(sign * mu * sliding[0], rel=0.02)
    with pytest.raises(SettingError, match=r"friction of a wall is -0\.1; it must be a finite number >= 0"):
        Surface(friction=-0.1)


def test_a_late_reading_is_the_one_of_before() -> None:
    wall = {"x": float(TOOL[0])}
    prompt, late = (ContactArm(ARM, 1e-3, wall, Surface(1e4), delay=delay) for delay in (0, 5))
    readings = []
    for contact in (prompt, late):
        contact.reset(START)
        own = []
        for _ in range(40):
            contact.advance(towards((0.02, 0.0, 0.0)), 1)
            own.append(contact.reading()[0])
        readings.append(np.array(own))
    assert readings[0][-1] > 1.0
    np.testing.assert_array_equal(readings[1][5:], readings[0][:-5])
    assert (readings[1][:4] == 0.0).all()
    late.reset(START)
    assert (late.reading() == 0.0).all()


def test_a_tilted_wall_pushes_along_its_normal() -> None:
    tilt = 0.6
    n = np.array((np.cos(tilt), np.sin(tilt), 0.0))
    contact = ContactArm(ARM, 5e-4, {"x": float(n @ TOOL)}, Surface(1e4), tilt=tilt)
    contact.reset(START)
    touch = contact.advance(towards(tuple(0.02 * n)), 600)
    assert touch.force["x"] > 1.0
    np.testing.assert_allclose(contact.reading()[:3], touch.force["x"] * n, atol=1e-9)
    assert touch.force["x"] == pytest.approx(1e4 * touch.depth["x"], rel=0.05)


def test_a_push_is_a_wrench_about_the_tool() -> None:
    """It adds J^T F to the forces on the joints, J of the tool, F the wrench."""
    contact = ContactArm(ARM, 1e-4, {}, Surface())
    contact.reset(START)
    wrench = np.array((3.0, -2.0, 1.0, 0.3, -0.2, 0.4))
    model, data = contact.robot.model, contact.robot.data
    before = data.qfrc_smooth.copy()
    contact.push(wrench)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_smooth - before, ARM.jacobian(START, "tool").T @ wrench, atol=1e-9)
