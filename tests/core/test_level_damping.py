"""Damping of single levels: its rows, what is kept, independent solvers against the truth, and a certificate that can fail."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import (
    ConstantDamping,
    ErrorDamping,
    Level,
    ManipulabilityDamping,
    NoDamping,
    NumericalFiltering,
    Problem,
    ProblemError,
    SettingError,
    Status,
    Truncation,
    VariableDamping,
    certify,
    load_problem,
    save_problem,
    solve,
    truth,
)
from hqp_rp.core.level_damping import damped_targets, solve_damped
from tests.problems import POLICIES, boxed, damped, independent, near_singular, two_sided

EXACT = ("hierarchical_active_set", "qp_cascade", "null_space")


def one(policy: object, b: float = 2.0, **named: object) -> Problem:
    return Problem([Level.equality([[1.0, 0.0]], [b], damping=policy, **named)])  # type: ignore[arg-type]


def rows(policy: object, **named: object) -> tuple[np.ndarray, np.ndarray]:
    D, d, offsets = one(policy, **named).damping_rows  # type: ignore[arg-type]
    assert offsets.tolist() == [0, len(D)]
    return D, d


def test_the_rows_of_each_policy() -> None:
    np.testing.assert_allclose(rows(ConstantDamping(0.3))[0], 0.3 * np.eye(2))
    np.testing.assert_allclose(rows(ErrorDamping(0.25))[0], 0.5 * 2.0 * np.eye(2))
    np.testing.assert_allclose(rows(ErrorDamping(0.25, power=1))[0], 0.5 * np.sqrt(2.0) * np.eye(2))
    np.testing.assert_allclose(rows(VariableDamping(2.0, 0.1))[0], np.sqrt(0.75) * 0.1 * np.eye(2))
    assert rows(VariableDamping(1.0, 0.1))[0].shape == (0, 2)
    assert rows(Truncation(0.5))[0].shape == (0, 2)
    np.testing.assert_allclose(np.abs(rows(Truncation(1.5))[0]), [[1e3, 0.0]], atol=1e-12)
    assert rows(ErrorDamping(0.25), b=0.0)[0].shape == (0, 2)  # no error, no damping
    for nothing in (None, NoDamping()):
        assert one(nothing).damping is None


def test_toward_what_the_levels_below_ask_for() -> None:
    posture = Level.equality(np.eye(2), [0.0, 1.0])
    level = Level.equality([[1.0, 0.0]], [2.0], damping=ErrorDamping(0.25))
    D, d, _ = Problem([level, posture]).damping_rows
    np.testing.assert_allclose(d, D @ np.array([0.0, 1.0 / (1.0 + 1.0)]))  # of |x - (0, 1)|^2 + |x|^2
    # By hand: |x_1 - 2|^2 + |x - (0, 1/2)|^2 has x_1 = 1, and the posture then has x_2 = 1.
    for name in EXACT:
        np.testing.assert_allclose(solve(Problem([level, posture]), name).x, [1.0, 1.0], rtol=1e-9)
    rest = Level.equality([[1.0, 0.0]], [2.0], damping=ErrorDamping(0.25, toward="rest"))
    assert not Problem([rest, posture]).damping_rows[1].any()


def test_by_hand() -> None:
    # min |x - 3|^2 + |x|^2 / 4 in -1 <= x <= 2 is at 2; without the bound at 12/5, which a second level cannot undo.
    damped_level = Level.equality([[1.0]], [3.0], damping=ConstantDamping(0.5))
    second = Level.equality([[1.0]], [0.0])
    for name in EXACT:
        assert solve(Problem([damped_level, second]), name).x == pytest.approx([12.0 / 5.0])
    for name in EXACT[:2]:
        hard = Level([[1.0]], [-1.0], [2.0])
        assert solve(Problem([damped_level, second], hard=hard), name).x == pytest.approx([2.0])


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("name", ["hierarchical_active_set", "qp_cascade", "null_space", "daqp"])
def test_against_the_truth(name: str, seed: int) -> None:
    problem = (
        damped(two_sided(seed, n=5, rows=(2, 3, 2), box=0.5), seed) if seed % 2 else damped(independent(seed), seed)
    )
    solution = solve(problem, name)
    if solution.status is Status.REFUSED:
        assert name == "null_space"
        return
    known = truth(problem)
    assert solution.status is Status.SOLVED, solution.message
    assert solution.x is not None
    assert known.x is not None
    close = 1e-5 if name == "daqp" else 1e-8
    assert np.linalg.norm(solution.x - known.x) <= close * (1.0 + np.linalg.norm(known.x))
    assert certify(problem, known.x).ok
    assert certify(problem, solution.x, tolerance=1e-6 if name == "daqp" else 1e-9).ok


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.integers(0, 6), st.booleans())
def test_two_independent_solvers_agree(seed: int, shift: int, box: bool) -> None:
    problem = damped(two_sided(seed, n=4, rows=(2, 2), box=0.4 if box else None), shift)
    ours, theirs = solve(problem, "hierarchical_active_set"), solve(problem, "qp_cascade")
    if ours.status is Status.SOLVED and theirs.status is Status.SOLVED:
        assert ours.x is not None
        assert theirs.x is not None
        assert np.linalg.norm(ours.x - theirs.x) <= 1e-6 * (1.0 + np.linalg.norm(theirs.x))
        assert certify(problem, ours.x, tolerance=1e-8).ok


@pytest.mark.parametrize(
    "policy",
    [
        ConstantDamping(0.2),
        VariableDamping(1.5, 0.4),
        Truncation(0.9),
        ManipulabilityDamping(3.0, 0.5),
        NumericalFiltering(1.5, 0.4),
    ],
)
@pytest.mark.parametrize(
    "make", [independent, lambda seed: near_singular(1e-5, seed)], ids=["regular", "near singular"]
)
def test_on_equalities_it_is_the_damping_of_null_space(policy: object, make: object) -> None:
    for seed in range(5):
        problem: Problem = make(seed)  # type: ignore[operator]
        own = Problem([Level(level.A, level.lower, level.upper, damping=policy) for level in problem.levels])  # type: ignore[arg-type]
        closed = solve(problem, "null_space", damping=policy).x
        assert closed is not None
        for name in EXACT:
            np.testing.assert_allclose(solve(own, name).x, closed, rtol=1e-5, atol=2e-6 * np.linalg.norm(closed))


def test_hard_rows_and_earlier_levels_are_kept() -> None:
    for seed in range(20):
        problem = boxed(independent(seed, rows=(2, 3, 7)), 0.4)
        levels = problem.levels
        later = Level(levels[1].A, levels[1].lower, levels[1].upper, damping=ConstantDamping(0.5))
        x = solve(Problem([levels[0], later, levels[2]], hard=problem.hard), "hierarchical_active_set").x
        exact = solve(Problem(levels[:1], hard=problem.hard), "hierarchical_active_set").x
        assert x is not None
        assert exact is not None
        assert np.abs(x).max() <= 0.4 + 1e-15
        residual = np.linalg.norm(levels[0].A @ x - levels[0].lower)
        assert residual == pytest.approx(np.linalg.norm(levels[0].A @ exact - levels[0].lower), abs=1e-12)


def test_near_a_singularity_x_stays_bounded() -> None:
    for eps in (1e-4, 1e-7, 1e-10, 1e-13):
        problem = near_singular(eps, 3)
        second = problem.levels[1]
        own = Problem([problem.levels[0], Level.equality(second.A, second.lower, damping=ConstantDamping(0.1))])
        for name in EXACT:
            solution = solve(own, name)
            assert solution.status is Status.SOLVED
            assert solution.x is not None
            assert np.linalg.norm(solution.x) < 10.0
            assert np.linalg.norm(problem.levels[0].A @ solution.x - problem.levels[0].lower) < 1e-13


def test_the_certificate_can_fail() -> None:
    rng = np.random.default_rng(5)
    for seed in range(10):
        problem = damped(two_sided(seed, n=5, rows=(2, 3), box=0.5), seed % 3)
        bare = Problem([Level(level.A, level.lower, level.upper) for level in problem.levels], hard=problem.hard)
        x, undamped = solve(problem, "hierarchical_active_set").x, solve(bare, "hierarchical_active_set").x
        assert x is not None
        assert undamped is not None
        assert certify(problem, x).ok
        if np.linalg.norm(x - undamped) > 1e-3:
            assert not certify(problem, undamped).ok
            assert not certify(bare, x).ok
        assert not certify(problem, np.clip(x + 1e-3 * rng.standard_normal(5), -0.5, 0.5)).ok


def test_the_native_search_is_the_one_by_whole_solves() -> None:
    def bare(problem: Problem, secondary: np.ndarray | None) -> object:
        return solve(problem, "hierarchical_active_set", secondary=secondary)

    for seed in range(20):
        problem = damped(two_sided(seed, n=6, rows=(3, 2, 6), box=0.6), seed)
        secondary = np.random.default_rng(seed).standard_normal(6)
        native = solve(problem, "hierarchical_active_set", secondary=secondary)
        steps = solve_damped(problem, secondary, bare)  # type: ignore[arg-type]
        assert native.status is steps.status is Status.SOLVED
        np.testing.assert_allclose(native.x, steps.x, rtol=1e-7, atol=1e-9)
        assert native.active is not None
        assert steps.active is not None
        assert native.active.shape == steps.active.shape


def test_warm_starts_change_no_answer() -> None:
    solver_problems = [damped(two_sided(seed, n=6, rows=(3, 2, 6), box=0.6), 1) for seed in range(20)]
    from hqp_rp import get_solver

    warm = get_solver("hierarchical_active_set")
    for problem in solver_problems:
        cold = solve(problem, "hierarchical_active_set", warm_start=False).x
        for _ in range(2):
            np.testing.assert_allclose(warm.solve(problem).x, cold, rtol=1e-9, atol=1e-12)


def test_methods_that_scale_or_project() -> None:
    """Saturation and unilateral reverse priority ask for what null-space priority reaches with the damping."""
    problem = damped(independent(2, rows=(3, 3)), 0)
    free = solve(problem, "null_space").x
    for name in ("saturation_null_space", "reverse_priority_unilateral"):
        solution = solve(problem, name)
        assert solution.problem is problem
        np.testing.assert_allclose(solution.x, free, rtol=1e-9)
        boxed_answer = solve(boxed(problem, 0.3), name)
        assert boxed_answer.status.ok
        assert boxed_answer.x is not None
        assert np.abs(boxed_answer.x).max() <= 0.3 + 1e-12
    bare = damped_targets(problem, lambda step, secondary: solve(step, "null_space", secondary=secondary))
    assert bare.damping is None


def test_the_weighted_sum() -> None:
    A, b = np.random.default_rng(0).standard_normal((3, 7)), np.ones(3)
    x = solve(Problem([Level.equality(A, b, damping=ConstantDamping(0.3))]), "weighted", damping=0.0).x
    np.testing.assert_allclose(x, np.linalg.solve(A.T @ A + 0.09 * np.eye(7), A.T @ b), rtol=1e-10)


@pytest.mark.parametrize("name", ["pseudo_inverse", "damped_least_squares", "singularity_robust", "reverse_priority"])
def test_who_does_not_know_it_says_so(name: str) -> None:
    solution = solve(one(ConstantDamping(0.1)), name)
    assert solution.status is Status.REFUSED
    assert "knows no damping of single levels" in solution.message
    assert "hierarchical_active_set" in solution.message


def test_one_damping_or_the_other() -> None:
    message = solve(one(ConstantDamping(0.1)), "null_space", damping=ConstantDamping(0.2)).message
    assert "give one or the other" in message


@pytest.mark.parametrize("policy", POLICIES)
def test_files_and_copies(policy: object, tmp_path: Path) -> None:
    problem = Problem([*one(policy).levels, Level.equality([[0.0, 1.0]], [1.0])])
    for again in (load_problem(save_problem(problem, tmp_path / "problem.npz")), pickle.loads(pickle.dumps(problem))):
        assert again.damping == problem.damping
        assert [level.damping for level in again.levels] == [level.damping for level in problem.levels]
    level = problem.levels[0]
    assert pickle.loads(pickle.dumps(level)).damping == level.damping
    if policy is not None:
        assert repr(policy) in repr(level)
        assert repr(policy) in repr(problem)


def test_misuse() -> None:
    with pytest.raises(SettingError, match=r"level 'tool': damping is 0.1; give None, ConstantDamping\(factor\)"):
        one(0.1, name="tool")
    with pytest.raises(ProblemError, match=r"hard rows have damping constant\(0.1\); hard rows are met or not"):
        Problem(one(None).levels, hard=one(ConstantDamping(0.1)).levels[0])
    with pytest.raises(SettingError, match=r"error\(0.1\), which is of one level: Level"):
        solve(one(None), "null_space", damping=ErrorDamping(0.1))
    with pytest.raises(SettingError, match="power is 3; it must be 1 or 2"):
        ErrorDamping(0.1, power=3)
    with pytest.raises(SettingError, match="toward is 'home'; it must be 'below' or 'rest'"):
        ErrorDamping(0.1, toward="home")  # type: ignore[arg-type]
    matrix = np.eye(2)
    with pytest.raises(ProblemError, match="2 policies of damping for 1 levels"):
        Problem.from_stacked(matrix, np.ones(2), np.ones(2), np.array([0, 2]), damping=[None, None])
