"""The QP cascade against references of other kinds: SVD cascades, bounded least squares, answers known by hand."""

from __future__ import annotations

import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from hqp_rp import Level, Problem, SettingError, Status, certify, solve, truth
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.problems import load
from hqp_rp.solvers.qp_cascade import QpCascade
from hqp_rp.solvers.weighted import Weighted
from tests.problems import (
    badly_scaled,
    boxed,
    equality_cases,
    independent,
    near_singular,
    over_constrained,
    scaled,
    two_sided,
)

NATIVE = ("proxqp", "osqp")
INF = np.inf
CASES = equality_cases(3)


def svd_cascade(problem: Problem, secondary: np.ndarray | None = None) -> np.ndarray:
    """The lexicographic optimum of equality levels, each scaled to one, by null-space bases."""
    x = np.zeros(problem.n) if secondary is None else secondary.copy()
    Z = np.eye(problem.n)
    for level in problem.levels:
        size = np.abs(level.A).max(initial=0.0)
        if size == 0.0 or Z.shape[1] == 0:
            continue
        A, b = level.A / size, level.lower / size
        U, sigma, Vt = np.linalg.svd(A @ Z)
        r = int((sigma > RANK_TOLERANCE * np.linalg.norm(A, 2)).sum())
        x = x + Z @ (Vt[:r].T @ ((U[:, :r].T @ (b - A @ x)) / sigma[:r]))
        Z = Z @ Vt[r:].T
    return x


@pytest.mark.parametrize("backend", NATIVE)
@pytest.mark.parametrize(("name", "problem"), CASES, ids=[name for name, _ in CASES])
def test_equality_levels(name: str, problem: Problem, backend: str) -> None:
    solver = QpCascade(backend=backend)
    for secondary in (None, np.linspace(-1.0, 2.0, problem.n)):
        solution = solver.solve(problem, secondary)
        assert solution.status is Status.SOLVED, solution.message
        expected = svd_cascade(problem, secondary)
        assert np.linalg.norm(solution.x - expected) <= 1e-6 * np.linalg.norm(expected)


@pytest.mark.parametrize("backend", ["daqp", "quadprog", "piqp"])
def test_other_back_ends_by_their_names(backend: str) -> None:
    solver = QpCascade(backend=backend)
    for seed in range(5):
        problem = over_constrained(seed)
        np.testing.assert_allclose(solver.solve(problem).x, svd_cascade(problem), atol=1e-8)


@pytest.mark.parametrize("backend", NATIVE)
@pytest.mark.parametrize("rows", [(3, 3), (3, 3, 7)])
def test_near_a_singularity_solved_means_solved(backend: str, rows: tuple[int, ...]) -> None:
    solver = QpCascade(backend=backend)
    for eps in 10.0 ** -np.arange(0, 15):
        problem = near_singular(eps, rows=rows)
        solution = solver.solve(problem)
        assert solution.status is Status.SOLVED, solution.message
        x = solution.x
        for level, best in zip(problem.levels, (0.0, 0.0), strict=False):
            scale = np.linalg.norm(level.A, 2) * np.linalg.norm(x) + np.linalg.norm(level.lower)
            if eps > 1e-11:  # Below, the rank rule gives level 2 up.
                assert np.linalg.norm(level.A @ x - level.lower) - best <= solver.tolerance * scale
        first = problem.levels[0]
        assert np.linalg.norm(first.A @ x - first.lower) <= 1e-9 * (1.0 + np.linalg.norm(x))


@pytest.mark.parametrize("backend", NATIVE)
def test_a_loose_back_end_is_never_called_solved(backend: str) -> None:
    problem = boxed(over_constrained(0), 0.3)
    solver = QpCascade(backend=backend, max_iterations=1, polish=False)
    solution = solver.solve(problem)
    if solution.status is Status.SOLVED:
        np.testing.assert_allclose(solution.x, solve(problem, "qp_cascade").x, atol=1e-6)
    else:
        assert solution.status is Status.ITERATION_LIMIT
        assert any(word in solution.message for word in ("could be", "are violated")), solution.message


def test_a_coarse_tolerance_is_declared_as_such() -> None:
    assert QpCascade(eps_abs=1e-4).tolerance == 1e-4
    assert QpCascade().tolerance == 1e-9


@pytest.mark.parametrize("backend", NATIVE)
def test_scaling_a_level_changes_no_digit(backend: str) -> None:
    x = QpCascade(backend=backend).solve(independent(0)).x
    for factors in ((2.0**-500, 1.0), (1.0, 2.0**500), (2.0**-500, 2.0**500)):
        scaled_solution = QpCascade(backend=backend).solve(scaled(independent(0), factors))
        assert scaled_solution.status is Status.SOLVED
        np.testing.assert_array_equal(scaled_solution.x, x)
    assert QpCascade(backend=backend).solve(badly_scaled(0)).status is Status.SOLVED


def test_what_overflows_has_no_answer() -> None:
    solution = solve(Problem([Level.equality(np.eye(2) * 1e-300, [1e200, 1.0])]), "qp_cascade")
    assert solution.status is Status.NOT_FINITE
    assert solution.x is None


@pytest.mark.parametrize("backend", [*NATIVE, "quadprog", "daqp", "piqp"])
def test_two_sided_levels_known_by_hand(backend: str) -> None:
    solver = QpCascade(backend=backend)
    # x0 + x1 >= 2 first, then x = 0: the nearest point of the half-plane. Then a band that is out of reach.
    half = Level(np.array([[1.0, 1.0]]), 2.0, INF)
    np.testing.assert_allclose(solver.solve(Problem([half])).x, [1, 1], atol=1e-8)
    below = Level(np.array([[1.0, 0.0]]), -INF, -3.0)
    np.testing.assert_allclose(solver.solve(Problem([half, below])).x, [-3, 5], atol=1e-8)
    # Contradictory bands in one level share the violation; what is left free goes to the next level.
    bands = Level(np.array([[1.0, 0.0], [1.0, 0.0]]), [1.0, -INF], [INF, 0.0])
    target = Level.equality(np.eye(2), [7.0, 4.0])
    solution = solver.solve(Problem([bands, target]))
    assert solution.status is Status.SOLVED, solution.message
    np.testing.assert_allclose(solution.x, [0.5, 4.0], atol=1e-8)
    # A satisfied band stays satisfied: the level below stops at its edge.
    box = Level(np.eye(2), -1.0, 1.0)
    np.testing.assert_allclose(solver.solve(Problem([box, target])).x, [1, 1], atol=1e-8)


@pytest.mark.parametrize("backend", NATIVE)
@pytest.mark.parametrize("seed", range(6))
def test_a_hard_box_against_bounded_least_squares(backend: str, seed: int) -> None:
    problem = boxed(Problem(over_constrained(seed).levels[:1]), 0.3)
    level = problem.levels[0]
    solution = QpCascade(backend=backend).solve(problem)
    assert solution.status is Status.SOLVED, solution.message
    best = lsq_linear(level.A, level.lower, (-0.3, 0.3), method="bvls", tol=1e-14)
    assert np.linalg.norm(level.A @ solution.x - level.lower) <= np.sqrt(2.0 * best.cost) + 1e-9
    assert np.abs(solution.x).max() <= 0.3 + 1e-9


@pytest.mark.parametrize("backend", [*NATIVE, "quadprog"])
@pytest.mark.parametrize("box", [None, 0.5])
def test_two_sided_levels_against_the_truth(box: float | None, backend: str) -> None:
    solver = QpCascade(backend=backend)
    for seed in range(12):
        problem = two_sided(seed, 5, (2, 3, 3), box=box)
        solution, right = solver.solve(problem), truth(problem)
        assert solution.status is Status.SOLVED, solution.message
        assert np.linalg.norm(solution.x - right.x) <= 1e-6 * np.linalg.norm(right.x)


def random_problem(seed: int) -> Problem:
    """Levels of mixed equality, one-sided and two-sided rows, some dependent; a hard box or a feasible polytope."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    levels: list[Level] = []
    for _ in range(int(rng.integers(1, 4))):
        m = int(rng.integers(1, 6))
        # Small integers, so that dependent rows are dependent exactly.
        A = rng.integers(-9, 10, (m, n)) / 4.0
        if levels and rng.random() < 0.3:
            A = rng.integers(-3, 4, (m, levels[-1].m)) @ levels[-1].A
        lower = 2.0 * rng.standard_normal(m)
        upper = np.where(rng.random(m) < 0.4, lower, lower + 2.0 * rng.random(m))
        kind = rng.random(m)
        levels.append(
            Level(A, np.where((kind > 0.8) & (lower < upper), -INF, lower), np.where(kind < 0.15, INF, upper))
        )
    if seed % 3 == 0:
        return Problem(levels)
    if seed % 3 == 1:
        return Problem(levels, Level(np.eye(n), -0.5, 0.5))
    A = rng.standard_normal((int(rng.integers(1, 2 * n)), n))
    centre = A @ rng.standard_normal(n)
    return Problem(levels, Level(A, centre - 0.3 * rng.random(len(A)), centre + rng.random(len(A))))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_different_algorithms_agree_on_random_problems(seed: int) -> None:
    problem = random_problem(seed)
    answers = [QpCascade(backend=name).solve(problem) for name in ("proxqp", "osqp", "quadprog")]
    solved: list[np.ndarray] = []
    for answer in answers:
        assert answer.status is not Status.INFEASIBLE, answer.message
        if answer.status is not Status.SOLVED:
            continue
        solved.append(answer.x)
        assert np.linalg.norm(answer.x - solved[0]) <= 1e-6 * max(1.0, np.linalg.norm(solved[0]))
        if problem.hard is not None:
            value = problem.hard.A @ answer.x
            outside = np.abs(value - np.clip(value, problem.hard.lower, problem.hard.upper))
            scale = np.linalg.norm(problem.hard.A, axis=1) * np.linalg.norm(answer.x) + np.abs(value)
            assert (outside <= 2e-9 * scale).all()


@pytest.mark.parametrize("backend", NATIVE)
def test_nearly_all_random_problems_are_solved(backend: str) -> None:
    solver = QpCascade(backend=backend)
    unsolved = [s for s in range(200) if not solver.solve(random_problem(s)).status.ok]
    assert len(unsolved) <= 2, unsolved


@pytest.mark.parametrize("backend", NATIVE)
def test_a_warm_start_changes_no_answer(backend: str) -> None:
    rng = np.random.default_rng(0)
    base = boxed(over_constrained(0), 0.3)
    kept = QpCascade(backend=backend)
    assert base.hard is not None
    for step in range(15):
        levels = [Level.equality(lv.A + 0.02 * step * rng.standard_normal(lv.A.shape), lv.lower) for lv in base.levels]
        problem = Problem(levels, base.hard)
        warm, cold = kept.solve(problem), QpCascade(backend=backend).solve(problem)
        assert warm.status is cold.status is Status.SOLVED
        np.testing.assert_allclose(warm.x, cold.x, atol=1e-8)
    kept.reset()
    np.testing.assert_allclose(kept.solve(problem).x, cold.x, atol=1e-8)


@pytest.mark.parametrize("backend", [*NATIVE, "quadprog"])
@pytest.mark.parametrize(
    ("hard", "named"),
    [
        (Level([[1, 0], [1, 0], [0, 1]], [1, -INF, -5], [INF, 0, 5]), "Hard rows 0, 1 contradict"),
        (Level.equality([[1, 0], [1, 0]], [1, 2]), "Hard rows 0, 1 contradict"),
        (Level([[1, 0], [1, 0]], [1e-7, -INF], [INF, 0]), "Hard rows 0, 1 contradict"),
        (Level([[1e8, 0], [1e-8, 0]], [1, -INF], [INF, 0]), "Hard rows 0, 1 contradict"),
        (Level([[0, 0], [1, 0]], 1, 2), "Hard row 0 is a row of zeros"),
    ],
)
def test_hard_rows_in_conflict(hard: Level, named: str, backend: str) -> None:
    solution = QpCascade(backend=backend).solve(Problem([Level.equality(np.eye(2), [3.0, 4.0])], hard))
    assert solution.status is Status.INFEASIBLE
    assert solution.x is None
    assert named in solution.message, solution.message


@pytest.mark.parametrize("backend", NATIVE)
def test_hard_rows_that_barely_meet(backend: str) -> None:
    hard = Level([[1, 0], [1, 0]], [1, -INF], [INF, 1])
    solution = QpCascade(backend=backend).solve(Problem([Level.equality(np.eye(2), [3.0, 4.0])], hard))
    assert solution.status is Status.SOLVED, solution.message
    np.testing.assert_allclose(solution.x, [1.0, 4.0], atol=1e-8)


def test_levels_that_ask_nothing() -> None:
    levels = [
        Level(np.zeros((0, 3)), 0.0, 1.0),
        Level.equality(np.zeros((2, 3)), [1.0, 2.0]),
        Level(np.eye(3), -INF, INF),
        Level.equality(np.ones((1, 3)), [3.0]),
    ]
    solution = solve(Problem(levels), "qp_cascade")
    assert solution.status is Status.SOLVED
    np.testing.assert_allclose(solution.x, np.ones(3), atol=1e-9)


def test_settings_out_of_range() -> None:
    with pytest.raises(SettingError, match=r"backend is 'prox'.*installed: .*osqp.*proxqp"):
        QpCascade(backend="prox")
    with pytest.raises(SettingError, match="eps_abs is 0"):
        QpCascade(eps_abs=0.0)
    with pytest.raises(SettingError, match=r"max_iterations is 1\.5"):
        QpCascade(max_iterations=1.5)  # type: ignore[arg-type]


def test_what_is_kept_is_no_setting() -> None:
    solver = QpCascade(backend="osqp")
    label = repr(solver)
    solver.solve(independent(0))
    assert repr(solver) == label
    assert solver == QpCascade(backend="osqp")
    assert hash(solver) == hash(QpCascade(backend="osqp"))
    assert pickle.loads(pickle.dumps(solver)) == solver
    assert dataclasses.replace(solver, backend="proxqp") == QpCascade()
    assert solver.is_lexicographic(independent(0))


@pytest.mark.parametrize("backend", [*NATIVE, "piqp", "quadprog", "daqp"])
def test_where_a_back_end_fails_solved_is_not_said(backend: str) -> None:
    known = load("humanoid/12-32-3-12-32_band_q0")
    solver = QpCascade(backend=backend)
    solution = solver.solve(known.problem)
    verdict = certify(known.problem, solution.x, tolerance=solver.tolerance)
    assert solution.status.ok == verdict.ok
    assert solution.status.ok or verdict.sentence in solution.message


@pytest.mark.parametrize("backend", [*NATIVE, "piqp", "quadprog", "daqp"])
@pytest.mark.parametrize("exponent", [1, 10, 20])
def test_a_narrow_contradiction_is_proven(backend: str, exponent: int) -> None:
    known = load(f"infeasible/n7_3-3_1p-{exponent:02d}")
    for solver in (QpCascade(backend=backend), Weighted(backend=backend)):
        solution = solver.solve(known.problem)
        assert solution.status is Status.INFEASIBLE, solution.message
        assert solution.x is None


@pytest.mark.parametrize(
    "hard", [Level([[0, 0]], 1, 2), Level.equality([[0, 0]], [1]), Level.equality([[1], [1]], [1, -1])]
)
def test_hard_rows_in_conflict_that_no_qp_can_help(hard: Level) -> None:
    for solver in (QpCascade(), Weighted()):
        solution = solver.solve(Problem([Level.equality(np.ones((1, hard.n)), [3.0])], hard))
        assert solution.status is Status.INFEASIBLE, solution.message


@pytest.mark.parametrize("seed", range(6))
def test_equalities_of_very_different_size_beside_two_sided_rows_in_one_level(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((12, 4)) * np.array([1.0, 1e-2, 1e-4, 1e-5])
    b = rng.standard_normal(12)
    lower, upper = b.copy(), b.copy()
    lower[9:], upper[9:] = b[9:] - 0.1, b[9:] + 0.1
    problem = Problem([Level(A, lower, upper)], hard=Level(np.eye(4), -1e4, 1e4))
    solution = QpCascade().solve(problem)
    assert solution.status is Status.SOLVED, solution.message
    assert certify(problem, solution.x).ok
