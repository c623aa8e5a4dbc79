"""Opt-SNS: the largest scale by linear programming, then the nearest point by a QP, on random boxes; priorities; bounds."""

from __future__ import annotations

import numpy as np
import pytest
import qpsolvers
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from hqp_rp import Level, Problem, SettingError, Status, solve, truth
from hqp_rp.core import _native
from hqp_rp.solvers.saturation_null_space import SaturationNullSpace, ScaledSolution
from tests.hard_problems import box_problem, hard_violation
from tests.problems import Array, boxed, equality_cases, independent

BASIC, OPTIMAL = SaturationNullSpace(), SaturationNullSpace(variant="optimal")


def run(problem: Problem, secondary: Array | None = None, solver: SaturationNullSpace = OPTIMAL) -> ScaledSolution:
    solution = solver.solve(problem, secondary)
    assert solution.status is Status.SOLVED, solution.message
    assert isinstance(solution, ScaledSolution)
    return solution


def box(n: int, bound: float) -> Level:
    return Level(np.eye(n), -bound, bound)


def random_problem(seed: int) -> tuple[Problem, Array]:
    """One to three levels of independent rows on 2 to 8 unknowns in a box around 0, and a secondary vector, 0 or not."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    rows = [int(m) for m in rng.integers(1, 4, rng.integers(1, 4))]
    while len(rows) > 1 and sum(rows) > n:
        rows.pop()
    rows[0] = min(rows[0], n)
    levels = [Level.equality(rng.standard_normal((m, n)), rng.standard_normal(m)) for m in rows]
    hard = Level(np.eye(n), -rng.uniform(0.1, 1.0, n), rng.uniform(0.1, 1.0, n))
    return Problem(levels, hard), rng.standard_normal(n) * rng.integers(0, 2)


def largest_scales(problem: Problem) -> list[float | None]:
    """Level by level the largest s in [0, 1] with A_k x = s b_k in the box, earlier levels as they are; None for no s."""
    assert problem.hard is not None
    low, high = problem.hard.lower, problem.hard.upper
    A, b = np.zeros((0, problem.n)), np.zeros(0)
    scales: list[float | None] = []
    for level in problem.levels:
        equations = np.block([[A, np.zeros((len(A), 1))], [level.A, -level.lower[:, None]]])
        found = linprog(
            np.append(np.zeros(problem.n), -1.0),
            A_eq=equations,
            b_eq=np.append(b, np.zeros(level.m)),
            bounds=[*zip(low, high, strict=True), (0.0, 1.0)],
            method="highs",
        )
        if found.status != 0:
            return [*scales, None]
        scales.append(float(found.x[-1]))
        A, b = np.vstack((A, level.A)), np.append(b, scales[-1] * level.lower)
    return scales


@pytest.mark.parametrize("block", range(8))
def test_it_is_the_optimum_that_a_linear_program_and_a_qp_find(block: int) -> None:
    compared = scaled = 0
    for seed in range(50 * block, 50 * (block + 1)):
        problem, zeta = random_problem(seed)
        assert problem.hard is not None
        expected = largest_scales(problem)
        solution = run(problem, zeta)
        assert hard_violation(problem, solution.x) <= 1e-15
        if expected[-1] is None:
            continue
        np.testing.assert_allclose(solution.scales, np.array(expected, float), rtol=0.0, atol=1e-9)
        targets = [s * level.lower for level, s in zip(problem.levels, solution.scales, strict=True)]
        np.testing.assert_allclose(problem.matrix @ solution.x, np.concatenate(targets), rtol=0.0, atol=1e-10)
        # A hair inside, where the QP back end still finds a point however small the set of optima is.
        nearest = qpsolvers.solve_qp(
            np.eye(problem.n),
            -zeta,
            A=problem.matrix,
            b=np.concatenate(targets) * (1.0 - 1e-10),
            lb=problem.hard.lower,
            ub=problem.hard.upper,
            solver="quadprog",
        )
        if nearest is not None:
            np.testing.assert_allclose(solution.x, nearest, rtol=0.0, atol=1e-5)
            compared += 1
            scaled += min(expected) < 1.0  # type: ignore[type-var]
    assert compared >= 30
    assert scaled >= 5


def test_the_basic_variant_misses_some_of_these_optima() -> None:
    scales = points = 0
    for seed in range(200):
        problem, zeta = random_problem(seed)
        optimal, basic = run(problem, zeta), run(problem, zeta, BASIC)
        if largest_scales(problem)[-1] is None:
            continue  # a level that no scale allows is left as it came, and the two bring it along differently
        first = np.flatnonzero(np.abs(optimal.scales - basic.scales) > 1e-9)
        if first.size:
            assert optimal.scales[first[0]] > basic.scales[first[0]]
            scales += 1
        else:
            assert np.linalg.norm(optimal.x - zeta) <= np.linalg.norm(basic.x - zeta) + 1e-9
            points += bool(np.linalg.norm(optimal.x - basic.x) > 1e-6)
    assert scales > 0
    assert points > 10


def test_a_saturated_unknown_is_released_by_hand() -> None:
    # One task 2 x0 + 2 x1 + x2 = 6 in [-1, 1]^3 asks all to saturate; half of it needs none.
    row = Level.equality([[2.0, 2.0, 1.0]], [6.0])
    np.testing.assert_allclose(run(Problem([row], box(3, 1.0))).scales, [5.0 / 6.0])
    # Level 1 drives x0 from its bound 1 (zeta) to 0; the secondary vector may not hold it there.
    levels = [Level.equality([[1.0, 1.0]], [0.0]), Level.equality([[1.0, -1.0]], [-1.0])]
    solution = run(Problem(levels, box(2, 1.0)), np.array([5.0, 0.0]))
    np.testing.assert_allclose(solution.x, [-0.5, 0.5], atol=1e-15)


def test_scale_in_a_box_that_excludes_zero() -> None:
    # x0 in [1, 2]: x0 + x1 = s with |x1| <= 0.5 is possible from s = 0.5 on; x0 + x1 = s / 4 is not, at any s.
    hard = Level(np.eye(2), [1.0, -0.5], [2.0, 0.5])
    found = run(Problem([Level.equality([[1.0, 1.0]], [1.0])], hard))
    np.testing.assert_allclose(found.scales, [1.0])
    np.testing.assert_allclose(found.x, [1.0, 0.0], atol=1e-15)
    # Two rows, of which the second bounds the scale: x1 = s, so s = 0.5, and x0 = 2 s = 1 just holds.
    found = run(Problem([Level.equality(np.eye(2), [2.0, 1.0])], hard))
    np.testing.assert_allclose(found.scales, [0.5])
    np.testing.assert_allclose(found.x, [1.0, 0.5])
    left = run(Problem([Level.equality([[1.0, 1.0]], [0.25]), Level.equality([[0.0, 1.0]], [0.5])], hard))
    np.testing.assert_allclose(left.scales, [0.0, 0.0])
    np.testing.assert_allclose(left.x, [1.0, 0.0])


CASES = equality_cases(2)


@pytest.mark.parametrize(("name", "problem"), CASES, ids=[name for name, _ in CASES])
def test_without_saturation_it_is_the_null_space_cascade(name: str, problem: Problem) -> None:
    zeta = np.linspace(-1.0, 2.0, problem.n)
    expected = solve(problem, "null_space", secondary=zeta).x
    for case in (problem, Problem(problem.levels, box(problem.n, 10.0 * np.abs(expected).max() + 10.0))):
        solution = run(case, zeta)
        assert np.linalg.norm(solution.x - expected) <= 1e-9 * (1.0 + np.linalg.norm(expected))
        np.testing.assert_array_equal(solution.scales, 1.0)


def test_where_nothing_is_scaled_it_is_the_lexicographic_optimum() -> None:
    met = saturated = 0
    for seed in range(80):
        problem = boxed(independent(seed, rows=(2, 2)), 0.7)
        solution = run(problem)
        if solution.scales.min() == 1.0:
            np.testing.assert_allclose(solution.x, truth(problem).x, rtol=0.0, atol=1e-9)
            met += 1
            saturated += solution.iterations > 0
    assert met > 10
    assert saturated > 5


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(("wide", "barely")))
def test_bounds_always_hold_and_no_level_is_scaled_more_than_by_the_basic_variant(seed: int, kind: str) -> None:
    problem = box_problem(seed, kind)
    solution, basic = run(problem), run(problem, solver=BASIC)
    assert hard_violation(problem, solution.x) <= 1e-15
    assert ((solution.scales >= 0.0) & (solution.scales <= 1.0)).all()
    assert solution.scales[0] >= basic.scales[0] - 1e-9


@pytest.mark.parametrize("n", [6, 24])
def test_ties_do_not_hold_it_up(n: int) -> None:
    row = Level.equality(np.ones((1, n)), [2.0 * n])
    solution = run(Problem([row], box(n, 1.0)))
    np.testing.assert_allclose(solution.scales, [0.5])
    np.testing.assert_allclose(solution.x, 1.0)
    twice = Problem([Level.equality(np.eye(n)[:2], [3.0, 3.0]), Level.equality(np.ones((1, n)), [n])], box(n, 1.0))
    solution = run(twice)
    np.testing.assert_allclose(solution.scales, [1.0 / 3.0, 1.0])
    np.testing.assert_allclose(solution.x, 1.0)


def test_when_iterations_run_out_the_status_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = Problem([Level.equality([[2.0, 1.0]], [3.0])], box(2, 1.0))
    monkeypatch.setattr(_native, "saturation_null_space", _unfinished)
    solution = OPTIMAL.solve(problem)
    assert solution.status is Status.INACCURATE
    assert "Iterations ran out at level 1" in solution.message


def _unfinished(problem: Problem, *settings: object) -> tuple[object, ...]:
    return np.zeros(problem.n), np.ones(problem.p), True, 1, 0, -1


@pytest.mark.parametrize("solver", [BASIC, OPTIMAL], ids=["basic", "optimal"])
def test_solved_means_that_every_level_is_where_its_scale_puts_it(solver: SaturationNullSpace) -> None:
    """Also near a singularity, where saturated unknowns make ill-conditioned systems; what is off says so."""
    statuses = set()
    for seed in range(200):
        rng = np.random.default_rng(seed)
        A1 = rng.standard_normal((2, 3))
        A2 = rng.standard_normal((2, 2)) @ A1 + 10.0 ** rng.uniform(-11, -6) * rng.standard_normal((2, 3))
        hard = Level(np.eye(3), -rng.uniform(0, 2, 3), rng.uniform(0, 2, 3))
        solution = solver.solve(Problem([Level.equality(A, rng.standard_normal(2)) for A in (A1, A2)], hard))
        assert isinstance(solution, ScaledSolution)
        statuses.add(solution.status)
        level, s = solution.problem.levels[0], solution.scales[0]
        if solution.status is Status.SOLVED:
            scale = np.linalg.norm(level.A) * np.linalg.norm(solution.x) + np.linalg.norm(level.lower)
            assert np.linalg.norm(level.A @ solution.x - s * level.lower) <= 2e-9 * scale
        else:
            assert "off its scaled task by more than 1e-09" in solution.message
    assert statuses == {Status.SOLVED, Status.INACCURATE}


def test_multipliers_fit_the_bounds_they_belong_to() -> None:
    """Stationarity: x - zeta is a combination of the levels' rows and of the saturated unknowns, with the right signs."""
    for seed in range(60):
        problem, zeta = random_problem(seed)
        assert problem.hard is not None
        x = run(problem, zeta).x
        at_low, at_high = x <= problem.hard.lower + 1e-12, x >= problem.hard.upper - 1e-12
        held = at_low | at_high
        if (
            np.linalg.matrix_rank(np.vstack((problem.matrix, np.eye(problem.n)[held])), 1e-9)
            < len(problem.matrix) + held.sum()
        ):
            continue  # multipliers are not unique there
        columns = np.vstack((problem.matrix, np.eye(problem.n)[held])).T
        force, *_ = np.linalg.lstsq(columns, x - zeta)
        np.testing.assert_allclose(columns @ force, x - zeta, atol=1e-9)
        sign = np.where(at_low, 1.0, -1.0)[held]
        assert (sign * force[len(problem.matrix) :] >= -1e-9).all()


def test_an_unknown_variant_is_named() -> None:
    with pytest.raises(SettingError, match="variant is 'fast'; choose one of basic, optimal"):
        SaturationNullSpace(variant="fast")
