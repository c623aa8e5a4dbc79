"""The hierarchical active set against exact truth and the certificate, on equalities, two-sided levels and hard rows."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hqp_rp import Level, Problem, SettingError, Status, certify, get_solver, load_problem, solve, truth
from tests import reference
from tests.bench.families import family
from tests.fuzz_uneven import row_errors
from tests.problems import (
    EQUALITY_CASES,
    boxed,
    degenerate,
    independent,
    near_singular,
    nearly_degenerate,
    over_constrained,
    scaled,
    two_sided,
    uneven,
)

EPS = np.finfo(float).eps
NAME = "hierarchical_active_set"


def error(x, expected):
    return np.abs(x - expected).max() / max(1e-300, np.abs(expected).max())


@pytest.mark.parametrize("name", EQUALITY_CASES)
def test_equalities_alone_give_the_lexicographic_optimum(name):
    for seed in range(3):
        problem = EQUALITY_CASES[name](seed)
        assert error(solve(problem, NAME).x, truth(problem).x) < 1e3 * EPS * reference.condition(problem)


@pytest.mark.parametrize("box", [None, 0.2, 1.0])
def test_two_sided_levels_and_a_box_give_the_truth(box):
    for seed in range(12):
        problem = two_sided(seed, box=box)
        np.testing.assert_allclose(solve(problem, NAME).x, truth(problem).x, atol=1e-10)


@pytest.mark.parametrize("exponent", range(0, 17, 2))
def test_level_1_stays_at_rounding_error_at_every_condition(exponent):
    problem = near_singular(10.0**-exponent, 1, rows=(3, 3, 7))
    x = solve(problem, NAME).x
    A, b = problem.levels[0].A, problem.levels[0].lower
    assert np.linalg.norm(A @ x - b) <= 1e2 * EPS * np.linalg.norm(A, 2) * np.linalg.norm(x)


def test_a_box_bounds_x_through_a_singularity():
    for exponent in (4, 8, 12):
        problem = boxed(near_singular(10.0**-exponent, 1), 2.0)
        solution = solve(problem, NAME)
        assert np.abs(solution.x).max() <= 2.0 + 1e-12
        assert certify(problem, solution.x).ok


@pytest.mark.parametrize("rows", [(3, 3), (3, 3, 7)])
@pytest.mark.parametrize("exponent", range(4, 14))
def test_near_a_singularity_under_limits_solved_is_never_refuted(exponent, rows):
    for seed in range(6):
        problem = boxed(near_singular(10.0**-exponent, seed, rows=rows), (0.5, 2.0, 1e3)[seed % 3])
        solution = solve(problem, NAME)
        if solution.status is Status.SOLVED:
            certificate = certify(problem, solution.x)
            assert certificate.ok, certificate.sentence
        else:  # only where the rank rule is about to cut
            assert exponent >= 10
            assert solution.status in (Status.INACCURATE, Status.ITERATION_LIMIT)
            assert solution.message


def draw(rng, n, integers, hard_kind):
    """A random problem, degenerate when `integers`; its hard rows are none, a box, feasible, or anything."""

    def rows(m, feasible):
        A = rng.integers(-2, 3, (m, n)).astype(float) if integers else rng.standard_normal((m, n))
        centre = A @ point if feasible else rng.integers(-3, 4, m).astype(float)
        half = rng.integers(0, 2, m).astype(float) if integers else rng.uniform(0, 1, m)
        kind = rng.integers(0, 4, m)
        lower = np.where(kind == 3, -np.inf, np.where(kind == 0, centre, centre - half))
        upper = np.where(kind == 2, np.inf, np.where(kind == 0, centre, centre + half))
        return Level(A, lower, upper)

    point = rng.integers(-2, 3, n).astype(float)
    levels = [rows(int(rng.integers(0, 7)), False) for _ in range(int(rng.integers(1, 5)))]
    hard = None
    if hard_kind == "box":
        hard = Level(np.eye(n), -0.5, 0.5)
    elif hard_kind is not None:
        hard = rows(int(rng.integers(1, n + 3)), hard_kind == "feasible")
    return Problem(levels, hard=hard)


def right_verdict(solver, problem):
    """How a solve ended: solved, and certified, or infeasible, as the exact truth has it."""
    solution = solver.solve(problem)
    assert solution.status in (Status.SOLVED, Status.INFEASIBLE)
    if solution.status is Status.SOLVED:
        certificate = certify(problem, solution.x)
        assert certificate.ok, certificate.sentence
    else:
        assert not truth(problem).feasible
    return solution.status


@settings(max_examples=300, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 9),
    integers=st.booleans(),
    hard_kind=st.sampled_from([None, "box", "feasible", "any"]),
)
def test_no_wrong_verdict_on_random_problems(seed, n, integers, hard_kind):
    problem = draw(np.random.default_rng(seed), n, integers, hard_kind)
    solver = get_solver(NAME)
    for _ in range(2):  # cold, then from its own answer
        status = right_verdict(solver, problem)
        assert status is Status.SOLVED or hard_kind == "any"


def neighbour(problem, rng, size):
    """The problem with its targets and bounds moved by about `size`; what was feasible may not be any more."""

    def near(level):
        moved = size * rng.standard_normal(level.m)
        return Level(level.A, level.lower + moved, level.upper + moved)

    hard = None if problem.hard is None else near(problem.hard)
    return Problem([near(level) for level in problem.levels], hard=hard)


@settings(max_examples=100, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 9),
    integers=st.booleans(),
    hard_kind=st.sampled_from([None, "box", "feasible"]),
    # Nearer neighbours of degenerate problems turn on 1e-9, the tolerance of verdict and certificate, in either of them.
    size=st.floats(-5.0, 0.0).map(lambda exponent: 10.0**exponent),
)
def test_no_wrong_verdict_from_the_answer_of_a_neighbour(seed, n, integers, hard_kind, size):
    rng = np.random.default_rng(seed)
    problem = draw(rng, n, integers, hard_kind)
    solver = get_solver(NAME)
    for _ in range(4):
        right_verdict(solver, problem)
        problem = neighbour(problem, rng, size)


def test_contradicting_hard_rows_are_named_and_no_x_is_given():
    hard = Level(np.vstack([np.eye(3), np.ones((1, 3))]), [0.0, 0.0, 0.0, 4.0], [1.0, 1.0, 1.0, 5.0])
    problem = Problem([Level.equality(np.eye(3), np.zeros(3))], hard=hard)
    solution = solve(problem, NAME)
    assert solution.status is Status.INFEASIBLE
    assert solution.x is None
    assert solution.message == "Hard rows 0, 1, 2, 3 contradict each other: no x meets them all."
    asked = solve(problem, NAME, least_violation=True)
    assert asked.status is Status.INFEASIBLE
    np.testing.assert_allclose(asked.x, np.full(3, 1.25))  # 0.25 over each bound, 0.25 short of the sum


def test_only_the_rows_of_the_contradiction_are_named():
    hard = Level(np.vstack([np.eye(3), np.eye(3)[:1]]), [0.0, 0.0, 0.0, 3.0], [1.0, 1.0, 1.0, 4.0])
    message = solve(Problem([Level.equality(np.eye(3), np.zeros(3))], hard=hard), NAME).message
    assert message.startswith("Hard rows 0, 3 contradict")


def test_barely_feasible_hard_rows_are_met():
    for gap in (0.0, 1e-14, 1e-10):
        hard = Level(np.array([[1.0, 1.0], [1.0, 1.0]]), [-np.inf, 1.0 - gap], [1.0, np.inf])
        problem = Problem([Level.equality(np.eye(2), [3.0, 0.0])], hard=hard)
        solution = solve(problem, NAME)
        assert solution.status is Status.SOLVED
        np.testing.assert_allclose(solution.x, [2.0, -1.0], atol=1e-9)


def test_a_step_across_a_narrow_band_meets_its_other_side():
    # Level 1 pulls x below a band that it is above of: the row must count again from below.
    rows = Level([[1.0, 0.0], [1.0, 0.0], [1.0, 0.0]], [2.0, -10.0, -10.0], [2.1, -10.0, -10.0], name="band and pull")
    hard = Level([[1.0, 0.0]], [-np.inf], [50.0])
    problem = Problem([rows], hard=hard)
    for start in (None, np.array([40.0, 0.0])):
        solver = get_solver(NAME)
        if start is not None:
            solver.solve(Problem([Level.equality([[1.0, 0.0]] * 3, [40.0] * 3)], hard=hard))
        np.testing.assert_allclose(solver.solve(problem).x, truth(problem).x, atol=1e-12)
    for seed in (5, 17, 29):
        wide = two_sided(seed, n=4, rows=(5, 6, 6), band=0.2)
        np.testing.assert_allclose(solve(wide, NAME).x, truth(wide).x, atol=1e-10)


def assert_warm_is_cheaper(problems: Iterable[Problem], share: float) -> None:
    warm, cold = get_solver(NAME), get_solver(NAME, warm_start=False)
    counts = {"warm": 0, "cold": 0}
    for problem in problems:
        first, second = warm.solve(problem), cold.solve(problem)
        np.testing.assert_allclose(first.x, second.x, atol=1e-11)
        counts["warm"] += first.iterations
        counts["cold"] += second.iterations
    assert counts["warm"] < share * counts["cold"]


def test_warm_and_cold_agree_along_a_path_and_warm_takes_fewer_iterations():
    base = over_constrained(3, rows=(3, 3, 7))

    def path() -> Iterator[Problem]:
        for t in np.linspace(0.0, 1.0, 60):
            levels = [Level.equality(level.A, level.lower * (1.0 + t), name=level.name) for level in base.levels]
            yield boxed(Problem(levels), 0.5)

    assert_warm_is_cheaper(path(), 0.8)


def test_a_warm_start_saves_more_where_more_rows_are_active():
    assert_warm_is_cheaper(family("humanoid_40_path").problems[:60], 0.7)


@pytest.mark.parametrize("factors", [(2.0**498, 2.0**-498, 1.0), (2.0**-498, 2.0**498, 2.0**-498)])
def test_the_scale_of_a_level_plays_no_part(factors):
    for seed in range(4):
        problem = two_sided(seed, box=0.3)
        x = get_solver(NAME).solve(scaled(problem, factors)).x
        np.testing.assert_allclose(x, get_solver(NAME).solve(problem).x, rtol=1e-12)


def test_the_free_vector_is_the_point_to_be_near():
    problem, zeta = two_sided(1, rows=(2, 2)), np.linspace(-1, 1, 7)
    np.testing.assert_allclose(solve(problem, NAME, secondary=zeta).x, truth(problem, zeta).x, atol=1e-11)


def test_the_iteration_limit_is_a_status():
    solution = solve(boxed(over_constrained(0), 0.1), NAME, max_iterations=1)
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.x is None
    assert "max_iterations" in solution.message


def test_the_answer_is_not_the_stored_warm_start():
    solver, problem = get_solver(NAME), independent()
    first = solver.solve(problem)
    first.x[:] = 1e6
    np.testing.assert_allclose(solver.solve(problem).x, truth(problem).x, atol=1e-10)


@pytest.mark.parametrize("wrong", [{"max_iterations": 0}, {"max_iterations": 2.5}, {"rank_tolerance": 1.0}])
def test_wrong_settings_are_named(wrong):
    with pytest.raises(SettingError, match=f"{next(iter(wrong))} is {next(iter(wrong.values()))}"):
        get_solver(NAME, **wrong)


@pytest.mark.parametrize(
    ("gap", "status"),
    [(1e-12, Status.SOLVED), (3e-9, Status.SOLVED), (5e-9, Status.INACCURATE), (1e-8, Status.INFEASIBLE)],
)
def test_hard_rows_that_all_but_agree_are_not_called_solved_beyond_the_tolerance(gap: float, status: Status) -> None:
    hard = Level([[1.0, 0.0], [1.0, 0.0]], [-np.inf, 1.0 + gap], [1.0, np.inf])
    problem = Problem([Level.equality([[0.0, 1.0]], [0.0])], hard=hard)
    solution = get_solver(NAME).solve(problem)
    assert solution.status is status
    if solution.x is not None:
        assert certify(problem, solution.x).ok == (status is Status.SOLVED)


def test_what_is_kept_may_be_spoilt_by_nobody() -> None:
    solver, problem = get_solver(NAME), independent()
    first = solver.solve(problem)
    expected = first.x.copy()
    first.x[:] = np.nan
    first.held[:] = 7
    np.testing.assert_allclose(solver.solve(problem).x, expected, rtol=1e-12)


def test_a_warm_start_decides_no_contradiction() -> None:
    solver = get_solver(NAME)
    feasible = Problem([Level.equality([[1.0, 2.0]], [1.0])], hard=Level(np.eye(2), -0.5, 0.5))
    narrow = Problem(
        [Level.equality([[1.0, 2.0]], [1.0])], hard=Level([[1.0, 0.0], [1.0, 0.0]], [1.0, -9.0], [9.0, 0.0])
    )
    solver.solve(feasible)
    warm, cold = solver.solve(narrow), get_solver(NAME, warm_start=False).solve(narrow)
    assert warm.status is cold.status is Status.INFEASIBLE
    assert warm.message == cold.message
    assert warm.iterations == cold.iterations  # that it started again
    assert solver.solve(feasible).status is Status.SOLVED


def test_a_row_that_comes_back_at_once_stays() -> None:
    """A humanoid whose damped level hardly weighs: the multiplier of a joint limit is rounding error of the wrong sign."""
    problem = load_problem(Path(__file__).parent.parent / "cases" / "damped_cycle.npz")
    solution = solve(problem, NAME)
    assert solution.status is Status.SOLVED
    assert solution.iterations < 100
    assert certify(problem, solution.x).ok


@pytest.mark.parametrize(("seed", "iterations"), [(6323, 9), (11564, 14), (20190, 11)])
def test_rows_keep_their_targets_where_the_newest_one_leaves_a_degenerate_vertex(seed: int, iterations: int) -> None:
    solution = get_solver(NAME).solve(degenerate(seed))
    assert solution.status is Status.SOLVED
    assert solution.iterations <= iterations  # with another row's target, each took two more to come back


def test_bounds_that_depend_on_each_other_to_1e_8_do_not_cycle() -> None:
    """An arm at its joint limits under a variable damping."""
    problem = load_problem(Path(__file__).parent.parent / "cases" / "nearly_dependent_bounds.npz")
    solution = solve(problem, NAME)
    assert solution.status in (Status.SOLVED, Status.INACCURATE)
    assert solution.iterations < 50


@pytest.mark.parametrize("by", [1e-2, -1e-4, 1e-6, 1e-10])
@pytest.mark.parametrize("seeds", [range(300), (808, 1061, 1105, 3520)], ids=["many", "once wrong"])
def test_levels_that_contradict_each_other_by_little_hold_no_row_by_rounding(by: float, seeds: Sequence[int]) -> None:
    """The multiplier of a row that nothing presses against is rounding of the little that the level misses."""
    solver = get_solver("hierarchical_active_set", warm_start=False)
    solved = 0
    for seed in seeds:
        problem, free = nearly_degenerate(seed, by)
        solution = solver.solve(problem, free)
        if solution.status is Status.SOLVED:
            verdict = certify(problem, solution.x, free)
            assert verdict.ok, f"seed {seed}: {verdict.sentence}"
            solved += 1
    assert solved >= 0.5 * len(seeds)


@pytest.mark.parametrize(("seed", "by"), [(135, -1e-8), (3962, 1e-6)])
def test_multipliers_of_very_different_size_are_certified(seed: int, by: float) -> None:
    """The smallest multiplier is 1e-9 of the largest, and right."""
    problem, free = nearly_degenerate(seed, by)
    right = truth(problem, free)
    assert certify(problem, right.x, free).ok
    solution = solve(problem, NAME, secondary=free)
    assert solution.status is Status.SOLVED
    assert error(solution.x, right.x) < 1e-12


@pytest.mark.parametrize("target", [1e6, 1e8, 1e10, 1e12])
def test_a_target_far_beyond_reach_explains_no_violation_of_another_row(target: float) -> None:
    limits = Level([[1.0, 0.0], [1.0, 0.0]], -np.inf, [1.00005, 1.0])
    solution = solve(Problem([Level([[1.0, 0.0]], target, np.inf)], limits), NAME)
    assert solution.status is Status.SOLVED
    assert solution.x[0] == pytest.approx(1.0, abs=1e-12)
    for seed in range(100):
        rng = np.random.default_rng(seed)
        wanted = [Level.equality(rng.normal(size=(3, 5)), size * rng.normal(size=3)) for size in (target, 1.0)]
        box = Level(np.vstack([np.eye(5), rng.normal(size=(3, 5))]), -1.0, 1.0)
        solution = solve(Problem(wanted, box), NAME)
        if solution.status is Status.SOLVED:
            assert np.abs(box.A @ solution.x).max() <= 1.0 + 1e-9


@pytest.mark.parametrize("ratio", [10.0**k for k in range(2, 12)])
def test_a_long_row_at_its_bound_does_not_hide_a_short_one_of_its_level(ratio: float) -> None:
    """What the long row would have to miss by to hold the short one back is far below the rounding error of its value."""
    long, short = Level([[ratio, 0.0]], 0.7 * ratio, np.inf), Level([[1.0, 0.0]], 0.9, 0.9)
    for rows in ([long, short], [long, long, short], [short, long]):
        level = Level(*(np.concatenate([getattr(row, part) for row in rows]) for part in ("A", "lower", "upper")))
        solution = solve(Problem([level]), NAME)
        assert solution.status is Status.SOLVED
        assert solution.x == pytest.approx([0.9, 0.0], abs=1e-12)
        limited = solve(Problem([Level([[1.0, 0.0]], -np.inf, 0.8), level]), NAME)
        assert limited.status is Status.SOLVED
        assert limited.x == pytest.approx([0.8, 0.0], abs=1e-12)


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), decades=st.floats(0.0, 8.0), box=st.booleans())
@example(seed=411, decades=7.9, box=False)
@example(seed=46503, decades=6.0, box=False)
def test_rows_of_very_different_length_are_solved_each_in_its_own_size(seed: int, decades: float, box: bool) -> None:
    """By the exact truth: what is called solved is right row by row, and so is what the certificate accepts."""
    problem = uneven(seed, decades, box)
    right = truth(problem)
    if right.ambiguous:
        return
    assert right.x is not None
    assert certify(problem, right.x).ok
    solution = solve(problem, NAME)
    assert solution.status in (Status.SOLVED, Status.INACCURATE)
    wrong = row_errors(problem, solution.x, right.x) > 1e-6
    assert not (wrong and solution.status is Status.SOLVED)
    assert not (wrong and certify(problem, solution.x).ok)
    if decades <= 3.0:
        assert solution.status is Status.SOLVED


@pytest.mark.parametrize("target", [1e12, 1e15, 1e18, 1e30])
def test_a_target_beyond_all_reach_leaves_the_other_rows_as_they_are(target: float) -> None:
    box = Level(np.eye(3), -1.0, 1.0)
    far, near = Level.equality([[1.0, 1.0, 0.0]], [target]), Level.equality([[0.0, 0.0, 1.0]], [0.5])
    beside = Level.equality([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [target, 0.5])
    for levels in ([far, near], [beside]):
        solution = solve(Problem(levels, box), NAME)
        assert solution.status is Status.SOLVED
        assert solution.x == pytest.approx([1.0, 1.0, 0.5], abs=1e-12)
