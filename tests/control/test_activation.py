"""Activation of levels and rows: no jump in x, measured for every solver, and nothing else changes on the way."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import hqp_rp
from hqp_rp import Level, Problem, ProblemError, Status, certify, solve
from hqp_rp.control.activation import BlendedSolution, blend, ramp
from tests.problems import boxed, independent, two_sided

EQUALITIES = independent(1, rows=(2, 2, 7))
BOXED = boxed(independent(1, rows=(2, 2, 7)), 0.6)
TWO_SIDED = two_sided(2, rows=(2, 3, 7), box=0.6)
# Dense at both ends, where strict hierarchies jump.
DEGREES = np.unique(np.concatenate((np.linspace(0.0, 1.0, 9), [1e-9, 1e-6, 1e-3, 0.999, 1.0 - 1e-6, 1.0 - 1e-9])))


def largest_slope(answers: list[np.ndarray]) -> float:
    """The largest change of x over the change of the activation, where it changed by 1e-7 at least; else the change itself."""
    worst = 0.0
    for (a, x), (b, y) in itertools.pairwise(zip(DEGREES, answers, strict=True)):
        worst = max(worst, float(np.abs(y - x).max()) / max(b - a, 1e-6))
    return worst


@pytest.mark.parametrize("name", sorted(hqp_rp.all_solvers()))
@pytest.mark.parametrize("problem", [EQUALITIES, BOXED, TWO_SIDED], ids=["equalities", "boxed", "two-sided"])
def test_no_solver_jumps(problem: Problem, name: str) -> None:
    solver = hqp_rp.get_solver(name)
    if solver.refuses(problem) is not None:
        assert blend(problem, solver, levels=[1.0, 0.5, 1.0]).status is Status.REFUSED
        return
    first, second, third = problem.levels
    empty = Level(np.zeros((0, problem.n)), [], [])  # `weighted` weighs levels by their number
    ends = [
        solve(Problem([first, empty, third], problem.hard), solver),
        solve(Problem([first, second, third], problem.hard), solver),
    ]
    blends = [blend(problem, solver, levels=[1.0, degree, 1.0]) for degree in DEGREES]
    assert all(blended.status.ok == all(part.status.ok for _, part in blended.parts) for blended in blends)
    assert not any(blended.x is None for blended in blends)
    answers = [blended.x for blended in blends]
    np.testing.assert_allclose(answers[0], ends[0].x, atol=1e-7)
    np.testing.assert_allclose(answers[-1], ends[1].x, atol=1e-7)
    assert largest_slope(answers) <= 2.0 * np.abs(ends[1].x - ends[0].x).max() + 0.1


@pytest.mark.parametrize("name", ["null_space", "qp_cascade", "daqp"])
def test_weighting_the_rows_instead_jumps(name: str) -> None:
    def weighted(degree: float) -> np.ndarray:
        first, second, third = EQUALITIES.levels
        return solve(Problem([first, Level.equality(degree * second.A, degree * second.lower), third]), name).x

    jump = np.abs(weighted(1e-3) - weighted(0.0)).max()
    assert jump > 0.1
    assert np.abs(weighted(1e-3) - weighted(1.0)).max() <= 1e-3 * jump


def test_one_level_in_transition_is_the_intermediate_desired_value() -> None:
    first, second, third = EQUALITIES.levels
    without = solve(Problem([first, third]), "null_space").x
    for degree in (0.2, 0.7):
        target = degree * second.lower + (1.0 - degree) * second.A @ without
        expected = solve(Problem([first, Level.equality(second.A, target), third]), "null_space").x
        np.testing.assert_allclose(blend(EQUALITIES, "null_space", levels=[1, degree, 1]).x, expected, atol=1e-10)


@pytest.mark.parametrize("name", ["hierarchical_active_set", "daqp", "qp_cascade"])
def test_levels_before_it_and_hard_rows_are_kept(name: str) -> None:
    residual = solve(TWO_SIDED, name).levels[0].residual
    for degree in (0.1, 0.5, 0.9):
        blended = blend(TWO_SIDED, name, levels=[1.0, degree, 1.0])
        assert np.abs(blended.x).max() <= 0.6 + 1e-6
        assert blended.levels[0].residual == pytest.approx(residual, abs=1e-6)


@pytest.mark.parametrize("name", ["null_space", "hierarchical_active_set"])
def test_the_metric_is_that_of_every_part(name: str) -> None:
    first, second, _ = EQUALITIES.levels
    problem = Problem([first, second], metric=np.arange(1.0, EQUALITIES.n + 1.0))
    blended = blend(problem, name, levels=[1.0, 0.4])
    for _, part in blended.parts:
        assert part.problem.metric is not None
    parts = (Problem([first], metric=problem.metric), problem)
    expected = sum(w * solve(part, name).x for w, part in zip((0.6, 0.4), parts, strict=True))
    np.testing.assert_allclose(blended.x, expected, atol=1e-9)


def test_single_rows_and_several_at_once() -> None:
    rows = np.ones(len(EQUALITIES.matrix))
    rows[2], rows[3] = 0.3, 0.8
    blended = blend(EQUALITIES, "null_space", rows=rows)
    assert [round(weight, 12) for weight, _ in blended.parts] == [0.3, 0.5, 0.2]
    assert [len(part.problem.matrix) for _, part in blended.parts] == [11, 10, 9]
    # Where two degrees cross, x does not jump either, and their order does not matter.
    path = []
    for shift in (-1e-9, 0.0, 1e-9):
        rows[2], rows[3] = 0.5 + shift, 0.5
        path.append(blend(EQUALITIES, "null_space", rows=rows).x)
    np.testing.assert_allclose(path[0], path[1], atol=1e-7)
    np.testing.assert_allclose(path[2], path[1], atol=1e-7)
    both = blend(EQUALITIES, "null_space", rows=rows, levels=[1.0, 0.0, 1.0])
    np.testing.assert_allclose(both.x, blend(EQUALITIES, "null_space", levels=[1, 0, 1]).x)


def test_fully_active_is_the_plain_answer_and_the_free_vector_is_used() -> None:
    problem, zeta = independent(0, rows=(2, 2)), np.linspace(-1.0, 1.0, 7)
    blended = blend(problem, "null_space", secondary=zeta)
    assert isinstance(blended, BlendedSolution)
    assert len(blended.parts) == 1
    np.testing.assert_array_equal(blended.x, solve(problem, "null_space", secondary=zeta).x)
    assert certify(problem, blended.x, zeta).ok


def test_a_failed_part_is_the_status_of_the_whole() -> None:
    problem = Problem(EQUALITIES.levels, Level(np.eye(7)[[0, 0]], [1.0, 2.0], [1.0, 2.0]))
    blended = blend(problem, "daqp", levels=[1.0, 0.5, 1.0])
    assert blended.status is Status.INFEASIBLE
    assert blended.x is None
    assert "contradict" in blended.message


def test_degrees_that_do_not_fit() -> None:
    for wrong in ({"levels": [1.0, 2.0, 1.0]}, {"levels": [0.5]}, {"rows": np.ones(3)}, {"levels": [np.nan, 1, 1]}):
        with pytest.raises(ProblemError, match=r"numbers in \[0, 1\]; got"):
            blend(EQUALITIES, "null_space", **wrong)
    with pytest.raises(ProblemError, match="levels is 'all'"):
        blend(EQUALITIES, "null_space", levels="all")


def test_ramp() -> None:
    np.testing.assert_allclose(ramp([-1.0, 0.0, 0.5, 1.0, 2.0], 0.0, 1.0), [0.0, 0.0, 0.5, 1.0, 1.0])
    np.testing.assert_allclose(ramp([0.2, 0.1, 0.06, 0.02, 0.0], 0.10, 0.02), [0.0, 0.0, 0.5, 1.0, 1.0])
    s = np.linspace(-0.1, 1.1, 1201)
    slope = np.gradient(ramp(s, 0.0, 1.0), s)
    assert np.abs(np.diff(slope)).max() <= 0.01
    with pytest.raises(ProblemError, match="two different finite numbers"):
        ramp(0.5, 1.0, 1.0)
