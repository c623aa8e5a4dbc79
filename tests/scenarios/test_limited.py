"""What holds for every scenario with limits: the loop, what is measured, and what happens to solvers that fail."""

from __future__ import annotations

import dataclasses
import re
from typing import Any, ClassVar

import numpy as np
import pytest

import hqp_rp
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver, get_solver
from hqp_rp.scenarios._limited import Limited, out_and_back
from hqp_rp.scenarios.humanoid_reach import HumanoidReach
from hqp_rp.scenarios.in_and_out_of_reach import InAndOutOfReach
from hqp_rp.scenarios.joint_limit_reach import JointLimitReach
from hqp_rp.scenarios.obstacle_pass import ObstaclePass
from hqp_rp.scenarios.scenario import all_scenarios
from tests.scenarios.crossings import Constant, by_case, measured, run, same

every_scenario = pytest.mark.parametrize(
    "scenario", [JointLimitReach(), ObstaclePass(), HumanoidReach()], ids=lambda scenario: scenario.name
)
LIMITS = (
    "position limit violation [rad]",
    "velocity limit violation [rad/s]",
    "acceleration limit violation [rad/s^2]",
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class FailsHalfway(Solver):
    """3 rad/s at every joint, within the hard box, until `good` problems were solved; then nothing."""

    good: int = 10
    calls: list[int] = dataclasses.field(default_factory=lambda: [0], compare=False)

    name: ClassVar[str] = "fails_halfway"
    summary: ClassVar[str] = "answers a while, and then no more"
    source: ClassVar[str] = "a test"

    def reset(self) -> None:
        self.calls[0] = 0

    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        self.calls[0] += 1
        if self.calls[0] > self.good or problem.hard is None:
            return Solution(problem, None, Status.NOT_FINITE, message="as planned")
        middle = np.clip(3.0, problem.hard.lower[: problem.n], problem.hard.upper[: problem.n])
        return Solution(problem, middle)


@every_scenario
def test_it_is_found_by_its_name_and_says_what_it_asks(scenario: Limited) -> None:
    assert all_scenarios()[scenario.name] is type(scenario)
    assert scenario.question.endswith("?")
    assert scenario.cannot_tell
    assert tuple(scenario.scene(0).stacks) == scenario.cases()


@every_scenario
def test_references_are_smooth_and_their_rates_are_their_derivatives(scenario: Limited) -> None:
    T, h = scenario.duration, 1e-6
    for time in np.linspace(0.0, T, 97):
        s, rate = out_and_back(time, T)
        assert 0.0 <= s <= 1.0
        slope = (out_and_back(time + h, T)[0] - out_and_back(time - h, T)[0]) / (2 * h)
        assert rate == pytest.approx(slope, abs=1e-5)
    assert [out_and_back(share * T, T)[0] for share in (0.0, 0.3, 0.55, 0.85, 1.0)] == pytest.approx([0, 1, 1, 0, 0])


@every_scenario
def test_the_same_seed_gives_the_same_run_and_another_seed_another(scenario: Limited) -> None:
    short, solver = dataclasses.replace(scenario.quick(), duration=1.0), get_solver("hierarchical_active_set")
    first = run(short, solver, 1)
    assert same(first, run(short, solver, 1))
    assert not same(first, run(short, solver, 2))


@every_scenario
def test_a_run_has_the_announced_length_cases_and_times(scenario: Limited) -> None:
    quick = scenario.quick()
    steps = run(quick, Constant())
    assert len(steps) == quick.length()
    assert tuple(by_case(steps)) == scenario.cases()
    for group in by_case(steps).values():
        np.testing.assert_allclose([step.parameter for step in group], quick.period * np.arange(quick.periods()))
    assert quick.length() <= scenario.length() / 3


@every_scenario
def test_a_refusal_is_yielded_once_for_each_case_with_nothing_measured(scenario: Limited) -> None:
    steps = run(scenario.quick(), Constant(value=None, status=Status.REFUSED))
    assert [step.case for step in steps] == list(scenario.cases())
    assert not any(step.measured for step in steps)


@every_scenario
def test_closed_forms_are_refused_where_there_are_limits_and_run_without(scenario: Limited) -> None:
    steps = by_case(run(scenario.quick(), hqp_rp.get_solver("null_space")))
    *limited, free = scenario.cases()
    for case in limited:
        assert [step.solution.status for step in steps[case]] == [Status.REFUSED]
    assert len(steps[free]) == scenario.quick().periods()
    assert all(step.solution.status is Status.SOLVED for step in steps[free])


@every_scenario
def test_standing_still_violates_nothing_and_a_wild_answer_is_measured_and_clipped(scenario: Limited) -> None:
    quick = scenario.quick()
    for step in run(quick, Constant()):
        assert [step.measured[name] for name in LIMITS] == [0.0, 0.0, 0.0]
        assert step.measured["commanded speed [rad/s]"] == 0.0
    scene = quick.scene(0)
    speed = scene.speed[np.isfinite(scene.speed)]
    bound = scene.acceleration[np.isfinite(scene.acceleration)]
    wild = run(dataclasses.replace(quick, duration=2 * quick.period), Constant(value=50.0))
    assert wild[0].measured[LIMITS[1]] == pytest.approx(50.0 - speed.min())
    assert wild[0].measured[LIMITS[2]] == pytest.approx((speed / quick.period - bound).max())
    assert wild[1].measured[LIMITS[2]] == 0.0  # the servos are at their limit already
    assert wild[0].measured["commanded speed [rad/s]"] == pytest.approx(50.0 * np.sqrt(scene.robot.nv))


def test_what_is_left_of_a_start_outside_and_what_is_added_are_told_apart() -> None:
    scenario = JointLimitReach(outside=0.1, duration=3.0, period=0.1, gain=1.0, posture_gain=1.0)
    start, total = 0.1, "position limit violation [rad]"
    still = by_case(run(scenario, Constant(), 1))["no limits"]
    left, added = (measured(still, f"position limit violation {part} [rad]") for part in ("left", "added"))
    np.testing.assert_allclose(left, start, rtol=1e-12)
    np.testing.assert_array_equal(added, 0.0)
    # All joints move on at 0.5 rad/s: the one outside goes farther out or comes back, others leave their ranges.
    moving = by_case(run(scenario, Constant(value=0.5), 1))["no limits"]
    left, added, beyond = (
        measured(moving, name)
        for name in ("position limit violation left [rad]", "position limit violation added [rad]", total)
    )
    assert (np.diff(left) <= 0.0).all()
    assert (left <= start + 1e-12).all()
    assert (added >= 0.0).all()
    assert added[-1] > 0.0
    assert (np.maximum(left, added) <= beyond + 1e-12).all()
    assert (beyond <= left + added + 1e-12).all()


@every_scenario
@pytest.mark.parametrize("value", [None, float("nan")])
def test_without_an_answer_the_robot_stays_where_it_is(scenario: Limited, value: float | None) -> None:
    steps = run(scenario.quick(), Constant(value=value, status=Status.NOT_FINITE))
    for group in by_case(steps).values():
        np.testing.assert_array_equal(group[-1].problem.levels[-1].A, group[0].problem.levels[-1].A)
        assert measured(group, LIMITS[0]).max() == 0.0


@every_scenario
def test_a_moving_robot_that_gets_no_more_answers_brakes_within_its_limits(scenario: Limited) -> None:
    steps = by_case(run(scenario, FailsHalfway()))[scenario.cases()[0]]
    assert steps[9].measured["commanded speed [rad/s]"] > 0.1
    assert measured(steps[10:], "commanded speed [rad/s]").max() == 0.0
    for name in LIMITS:
        assert measured(steps, name).max() < 1e-9
    error = next(name for name in steps[0].measured if name.startswith("posture"))
    posture = measured(steps, error)
    assert abs(posture[10] - posture[9]) > 1e-6  # it rolls out
    np.testing.assert_array_equal(posture[-20:], posture[-1])


@every_scenario
@pytest.mark.parametrize("seed", [0, 1])
def test_hard_limits_hold_and_every_level_is_lexicographic(scenario: Limited, seed: int) -> None:
    """An exact solver keeps every hard limit to its tolerance; a start outside shrinks at every step."""
    solver = get_solver("hierarchical_active_set")
    steps = by_case(run(scenario.quick(), solver, seed))[scenario.cases()[0]]
    assert {step.solution.status for step in steps} == {Status.SOLVED}
    for name in LIMITS[1:]:
        assert measured(steps, name).max() < 1e-7
    outside = measured(steps, LIMITS[0])
    assert (np.diff(outside) <= 1e-9).all()
    assert outside[-1] < 1e-9
    for step in steps[:: len(steps) // 8]:
        assert step.solution.x is not None
        assert hqp_rp.certify(step.problem, step.solution.x, None, solver.tolerance).ok


@every_scenario
def test_without_limits_an_exact_solver_breaks_them(scenario: Limited) -> None:
    steps = by_case(run(scenario.quick(), get_solver("null_space")))[scenario.cases()[-1]]
    broken = [measured(steps, name).max() for name in steps[0].measured if "violation" in name]
    assert max(broken) > 0.05


@every_scenario
@pytest.mark.parametrize(
    ("setting", "value", "text"),
    [
        ("duration", 0.0, r"duration of \w+ is 0.0; it must be a finite number > 0"),
        ("period", float("nan"), r"period of \w+ is nan"),
        ("duration", 0.01, "needs at least two periods"),
        ("acceleration", -1.0, r"acceleration of \w+ is -1.0; it must be a finite number > 0"),
        ("gain", 1e3, r"gain of \w+ is 1000.0; it must be a finite number in \[0, 1 / period\]"),
        ("spread", "far", r"spread of \w+ is 'far'"),
    ],
)
def test_settings_out_of_range_are_named(scenario: Limited, setting: str, value: Any, text: str) -> None:
    with pytest.raises(SettingError, match=text):
        dataclasses.replace(scenario, **{setting: value})


@every_scenario
@pytest.mark.parametrize("name", sorted(hqp_rp.all_solvers()))
def test_every_solver_gets_through_and_solved_means_that_hard_limits_hold(scenario: Limited, name: str) -> None:
    solver = get_solver(name)
    short = dataclasses.replace(scenario.quick(), duration=1.5)
    for step in run(short, solver, 1):
        assert np.isfinite(list(step.measured.values())).all()
        hard, x = step.problem.hard, step.solution.x
        if hard is None or not step.solution.status.ok:
            continue
        assert x is not None
        beyond = np.maximum(hard.lower - hard.A @ x, hard.A @ x - hard.upper)
        # The tolerance is relative: to the row's size times |x| and to its bound.
        bound = np.where(
            np.isfinite(hard.upper), np.abs(hard.upper), np.where(np.isfinite(hard.lower), np.abs(hard.lower), 0.0)
        )
        scale = np.linalg.norm(hard.A, 2) * np.linalg.norm(x) + np.linalg.norm(bound)
        assert beyond.max() <= solver.tolerance * scale, step.parameter


def test_what_in_and_out_of_reach_says_of_its_damping_is_true() -> None:
    scenario = InAndOutOfReach()
    said = scenario.cannot_tell[-2]
    rule = {"factor": 1.0 * max(0.05 / scenario.gain, scenario.period), "second_factor": 1.0 / scenario.gain}
    assert (
        f": {scenario.factor:g} m s at level 1, reach times period, and {scenario.second_factor:g} s at level 2" in said
    )
    assert scenario.factor == pytest.approx(1.0 * scenario.period)
    assert f"gives {rule['factor']:g} m s and {rule['second_factor']:g} s here" in said
    jumps, off = [], []
    for made in (scenario, dataclasses.replace(scenario, **rule)):
        steps = [step for step in made.steps(get_solver("hierarchical_active_set"), 0) if step.case.endswith("damped")]
        v = np.array([step.solution.x for step in steps])
        jumps.append(float(np.quantile(np.abs(np.diff(v, axis=0)).max(axis=1), 0.99)))
        rest = [step for step in steps if 0.4 < step.parameter / scenario.duration < 0.55]
        off.append(float(np.mean([step.measured["tool position error [m]"] for step in rest])))
    told = re.search(r"by ([\d.]+) rad/s at most instead of ([\d.]+), for ([\d.]+) mm", said)
    assert told is not None
    assert [float(number) for number in told.groups()[:2]] == pytest.approx(jumps[::-1], abs=0.01)
    assert float(told[3]) == pytest.approx(1e3 * (off[1] - off[0]), abs=0.15)
