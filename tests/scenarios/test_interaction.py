"""What the force scenarios share: protocol, gains, safe ends, singular starts, figures that do not hang on the time step."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.solution import Status
from hqp_rp.core.solver import Solver, get_solver
from hqp_rp.robot.arms import sawyer
from hqp_rp.scenarios._interaction import DAMPED, PAPER, REGULAR, SINGULAR, Case, Interaction, find_start
from hqp_rp.scenarios.sawyer_force_tracking import SawyerForceTracking
from hqp_rp.scenarios.sawyer_hybrid_wipe import SawyerHybridWipe
from hqp_rp.scenarios.sawyer_priority_conflict import SawyerPriorityConflict
from hqp_rp.scenarios.sawyer_wall_contact import SawyerWallContact
from hqp_rp.scenarios.scenario import Step, all_scenarios
from tests.scenarios.crossings import Constant, SometimesNothing

KINDS: tuple[type[Interaction], ...] = (
    SawyerForceTracking,
    SawyerHybridWipe,
    SawyerPriorityConflict,
    SawyerWallContact,
)
SHORT = {"duration": 0.05}


def case_of(scenario: Interaction, gains: str, place: str) -> Case:
    return next(case for case in scenario.cases() if (case.gains, case.place) == (gains, place))


def run(scenario: Interaction, gains: str, place: str, solver: Solver, seed: int = 0) -> list[Step]:
    case = case_of(scenario, gains, place)
    return list(scenario.run_case(case, scenario.contact_arm(case, seed), solver, seed))


def measured(steps: list[Step], name: str) -> FloatArray:
    return np.array([step.measured[name] for step in steps])


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_found_by_name_and_not_part_of_the_default_comparison(kind: type[Interaction]) -> None:
    assert all_scenarios()[kind.name] is kind
    assert not kind.by_default
    assert kind.question.endswith("?")
    assert len(set(kind.cannot_tell)) == len(kind.cannot_tell) > len(Interaction.cannot_tell)


@pytest.mark.parametrize("kind", KINDS)
def test_every_case_yields_every_step_with_every_figure(kind: type[Interaction]) -> None:
    scenario = kind(**SHORT)
    steps = list(scenario.steps(get_solver("null_space"), 0))
    assert len(steps) == scenario.length()
    assert list(dict.fromkeys(step.case for step in steps)) == [
        f"{gains}, {place}" for gains, place in itertools.product((PAPER, DAMPED), (REGULAR, SINGULAR))
    ]
    for name in ("force x [N]", "desired force x [N]", "peak force x [N]", "contact x", "energy x [J]", "shortened to"):
        assert np.isfinite(measured(steps, name)).all()
    for _, part in itertools.groupby(steps, key=lambda step: step.case):
        times = [step.parameter for step in part]
        np.testing.assert_allclose(times, scenario.period * np.arange(scenario.periods()), atol=1e-12)
    assert all(step.problem.n == 7 for step in steps)
    assert scenario.quick().length() < scenario.length() or scenario.periods() == scenario.quick().periods()


@pytest.mark.parametrize("kind", KINDS)
def test_seeds_repeat_and_differ(kind: type[Interaction]) -> None:
    scenario, solver = kind(duration=0.02), get_solver("pseudo_inverse")
    runs = [run(scenario, PAPER, REGULAR, solver, seed) for seed in (0, 3, 3, 4)]
    forces = [measured(steps, "commanded speed [rad/s]") for steps in runs]
    np.testing.assert_array_equal(forces[1], forces[2])
    assert not np.array_equal(forces[0], forces[1])
    assert not np.array_equal(forces[1], forces[3])


def test_gains_are_the_papers_and_then_have_the_damping_ratio_asked_for() -> None:
    scenario = SawyerForceTracking(damping_ratio=0.7)
    paper = scenario.gains(case_of(scenario, PAPER, REGULAR), "xy")
    np.testing.assert_array_equal(paper.M_d, (15, 15, 15, 80, 80, 80))
    np.testing.assert_array_equal(paper.B_d, (150, 150, 150, 280, 280, 280))
    damped = scenario.gains(case_of(scenario, DAMPED, REGULAR), "xy")
    np.testing.assert_array_equal(damped.M_d, paper.M_d)
    np.testing.assert_array_equal(damped.B_d[2:], paper.B_d[2:])
    for i in range(2):
        roots = np.roots((damped.M_d[i], damped.B_d[i], scenario.stiffness))
        assert -roots[0].real / abs(roots[0]) == pytest.approx(0.7)
    for i in range(6):  # the spring that the paper leaves open: a double root
        assert paper.B_d[i] ** 2 == pytest.approx(4.0 * paper.M_d[i] * paper.K_d[i])


def beside(q: FloatArray, first: slice, lower: slice) -> float:
    """Least singular value of some rows of the tool's Jacobian in the null space of others."""
    J = sawyer().jacobian(q, "tool")
    null_space = np.linalg.svd(J[first])[2][len(J[first]) :].T
    return float(np.linalg.svd(J[lower] @ null_space, compute_uv=False)[-1])


@pytest.mark.parametrize("kind", [SawyerForceTracking, SawyerWallContact])
def test_y_z_and_orientation_are_nearly_singular_beside_x_at_one_start(kind: type[Interaction]) -> None:
    regular, near = (case_of(kind(), PAPER, place).q for place in (REGULAR, SINGULAR))
    assert beside(regular, slice(0, 1), slice(1, 6)) > 0.15
    assert beside(near, slice(0, 1), slice(1, 6)) == pytest.approx(0.0133, abs=5e-4)
    assert np.linalg.svd(sawyer().jacobian(near, "tool")[1:], compute_uv=False)[-1] > 0.1  # it is no kinematic one


def test_the_search_remakes_the_singular_starts() -> None:
    place = find_start()
    near = case_of(SawyerWallContact(), PAPER, SINGULAR).q
    along = np.sign(place.approach @ (near - place.q)) * place.approach
    np.testing.assert_allclose(place.q + 0.1 * along, near, atol=1e-6)
    place = find_start(("y", "z"))
    near = case_of(SawyerPriorityConflict(), PAPER, SINGULAR).q
    along = np.sign(place.approach @ (near - place.q)) * place.approach
    np.testing.assert_allclose(place.q + 0.4 * along, near, atol=1e-6)
    assert abs(place.task_direction[1]) > 0.99  # z: the arm is stretched upwards
    with pytest.raises(SettingError, match=r"starts is 1, margin is 3\.0"):
        find_start(starts=1, margin=3.0)


def test_the_wipe_stays_on_the_wall_and_passes_the_singularity_of_the_orientation() -> None:
    scenario = SawyerHybridWipe()
    middle = scenario.periods() // 2
    for place in (REGULAR, SINGULAR):
        wipe = scenario.wipe(case_of(scenario, PAPER, place))
        assert np.ptp(wipe.position[:, 0]) < 1e-12
        assert np.ptp(wipe.position[:, 1:], axis=0).max() > 0.1
        step = np.abs(np.diff(wipe.position, axis=0)).max()
        assert step < 2e-3
        # The rates are those of the references: integrated, they give the path.
        moved = 0.5 * scenario.period * (wipe.velocity[1:, :3] + wipe.velocity[:-1, :3]).sum(axis=0)
        np.testing.assert_allclose(moved, wipe.position[-1] - wipe.position[0], atol=1e-6)
    orientation = slice(3, 6)
    sigma = [beside(q, slice(0, 3), orientation) for q in scenario.wipe(case_of(scenario, PAPER, SINGULAR)).q]
    assert int(np.argmin(sigma)) == middle
    assert sigma[middle] < 1e-6
    assert min(sigma[0], sigma[-1]) > 0.1
    assert min(beside(q, slice(0, 3), orientation) for q in scenario.wipe(case_of(scenario, PAPER, REGULAR)).q) > 0.1


@pytest.mark.parametrize("place", [REGULAR, SINGULAR])
def test_the_conflict_is_reachable_first_and_not_midway(place: str) -> None:
    """Newton steps along the shortest motion: they meet the target early on and cannot at the farthest point."""
    arm, scenario = sawyer(), SawyerPriorityConflict()
    case = case_of(scenario, PAPER, place)
    q0 = case.q
    start, misses = arm.pose(q0, "tool")[1], []
    for t in (0.2 * scenario.duration, 0.5 * scenario.duration):
        offset, velocity, acceleration = scenario.motion(case, t)
        q = q0.copy()
        for _ in range(300):
            J = arm.jacobian(q, "tool")[:3]
            miss = start + offset - arm.pose(q, "tool")[1]
            q = q + J.T @ np.linalg.solve(J @ J.T + 1e-3 * np.eye(3), miss)
        misses.append(np.linalg.norm(start + offset - arm.pose(q, "tool")[1]))
        ahead, behind = (scenario.motion(case, t + h)[0] for h in (1e-4, -1e-4))
        np.testing.assert_allclose(velocity, (ahead - behind) / 2e-4, atol=1e-6)
        np.testing.assert_allclose(acceleration, (ahead - 2 * offset + behind) / 1e-8, atol=1e-4)
    assert misses[0] < 1e-3
    assert misses[1] > 0.02


def test_force_is_tracked_at_a_regular_start() -> None:
    steps = run(SawyerForceTracking(duration=1.5), DAMPED, REGULAR, get_solver("reverse_priority"))
    for axis in "xy":
        error = measured(steps, f"force {axis} [N]") - measured(steps, f"desired force {axis} [N]")
        assert np.abs(error[-200:]).max() < 0.5
        assert (measured(steps, f"contact {axis}")[1:] == 1.0).all()
    t = steps[-1].parameter + SawyerForceTracking().period
    assert steps[-1].measured["desired force x [N]"] == pytest.approx(30.0 + 5.0 * math.sin(t / math.pi))


def test_the_papers_numbers_overshoot_at_the_wall_and_the_damped_ones_do_not() -> None:
    scenario = SawyerWallContact(duration=1.5)
    for gains, peak in ((PAPER, (80.0, 95.0)), (DAMPED, (29.9, 30.5))):
        steps = run(scenario, gains, REGULAR, get_solver("null_space"))
        force, contact = measured(steps, "peak force x [N]"), measured(steps, "contact x")
        first = int(np.argmax(contact > 0.0))
        assert first > 10
        assert peak[0] < force.max() < peak[1]
        assert (contact[first + 1 :] == 1.0).all()  # the velocity servos yield enough that nothing bounces off
        assert force[-1] == pytest.approx(30.0, abs=0.3)


@pytest.mark.parametrize("kind", [SawyerForceTracking, SawyerWallContact])
def test_halving_the_time_step_changes_no_printed_figure_of_the_damped_set(kind: type[Interaction]) -> None:
    """Two digits are printed: peak, RMS error and final depth agree within half a unit of the second one."""
    found = []
    for substeps in (8, 16):
        steps = run(kind(duration=1.5, substeps=substeps), DAMPED, REGULAR, get_solver("reverse_priority"))
        error = measured(steps, "force x [N]") - measured(steps, "desired force x [N]")
        found.append(
            (np.sqrt(np.mean(error**2)), measured(steps, "peak force x [N]").max(), steps[-1].measured["energy x [J]"])
        )
    np.testing.assert_allclose(found[0], found[1], rtol=5e-3)


def test_a_failing_solver_stops_the_arm_and_ends_the_case() -> None:
    scenario = SawyerWallContact(duration=0.2)
    steps = run(scenario, PAPER, REGULAR, SometimesNothing(period=11))
    assert len(steps) == 11
    assert steps[-1].solution.status is Status.NOT_FINITE
    assert steps[-1].measured["commanded speed [rad/s]"] == 0.0
    refused = list(scenario.steps(Constant(value=None, status=Status.REFUSED), 0))
    assert len(refused) == 1


def test_a_command_that_is_too_fast_is_shortened() -> None:
    steps = run(SawyerWallContact(duration=0.02), PAPER, REGULAR, Constant(value=100.0))
    limit = np.asarray(sawyer().velocity_limit).min()
    np.testing.assert_allclose(measured(steps, "shortened to"), limit / 100.0)
    np.testing.assert_allclose(measured(steps, "commanded speed [rad/s]"), 100.0 * math.sqrt(7.0))
    assert measured(steps, "measured speed [rad/s]").max() < 1.01 * limit * math.sqrt(7.0)


@pytest.mark.parametrize(
    ("kind", "settings", "message"),
    [
        (SawyerWallContact, {"gap": 0.0}, "gap of sawyer_wall_contact is 0.0; it must be a finite number > 0"),
        (SawyerWallContact, {"period": -1.0}, "period of sawyer_wall_contact is -1.0"),
        (SawyerForceTracking, {"substeps": 0}, "substeps of sawyer_force_tracking is 0; it must be an integer"),
        (SawyerForceTracking, {"duration": 0.001}, "a run needs at least two periods"),
        (SawyerForceTracking, {"stiffness": 0.0}, "stiffness of a wall is 0.0"),
        (SawyerForceTracking, {"noise": math.inf}, "noise of sawyer_force_tracking is inf"),
        (SawyerHybridWipe, {"demand": -0.1}, "demand of sawyer_hybrid_wipe is -0.1; it must be a finite number >= 0"),
        (SawyerPriorityConflict, {"posture_gain": 501.0}, r"must be a finite number in \[0, 1 / period\] = \[0, 500\]"),
    ],
)
def test_settings_out_of_range_are_refused(kind: type[Interaction], settings: dict[str, float], message: str) -> None:
    with pytest.raises(SettingError, match=message):
        dataclasses.replace(kind(), **settings)
