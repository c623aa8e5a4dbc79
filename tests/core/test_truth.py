"""The truth of equality problems: against closed forms, an independent mpmath recursion, and its own invariances."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp

from hqp_rp import Level, Problem, ProblemError, SettingError, Truth, truth
from hqp_rp.core.distance import orthogonal_cascade
from hqp_rp.core.solver import RANK_TOLERANCE
from tests.problems import (
    conditioned,
    dependent,
    equality_cases,
    independent,
    near_singular,
    over_constrained,
    rank_deficient,
    scaled,
    stack,
)

EPS = float(np.finfo(float).eps)


def by_mpmath(
    problem: Problem, tolerance: float, secondary: np.ndarray | None = None
) -> tuple[np.ndarray, list[float]]:
    """x and residuals by the textbook recursion with full singular value decompositions in 120 digits.

    Z <- Z V2 with the rank rule; nothing is shared with the library.
    """
    with mp.workdps(120):
        n = problem.n
        x, Z = mp.zeros(n, 1), mp.eye(n)
        for level in problem.levels:
            if level.m == 0 or Z.cols == 0:
                continue
            A = mp.matrix(level.A.tolist())
            b = mp.matrix(level.lower.tolist())
            size = max(mp.svd_r(A, compute_uv=False))
            B = A * Z
            if B.rows < B.cols:  # rows of zeros do no harm, and svd_r then returns all right singular vectors
                B = mp.matrix(B.tolist() + [[mp.mpf(0)] * B.cols] * (B.cols - B.rows))
                A = mp.matrix(A.tolist() + [[mp.mpf(0)] * n] * (B.rows - A.rows))
                b = mp.matrix([*b, *[mp.mpf(0)] * (B.rows - b.rows)])
            U, S, V = mp.svd_r(B)
            rank = sum(1 for s in S if s > tolerance * size)
            c = U.T * (b - A * x)
            for i in range(rank):
                x += Z * V[i, :].T * (c[i] / S[i])
            if rank < Z.cols:
                Z = Z * V[rank:, :].T
            else:
                Z = mp.zeros(n, 0)
        if Z.cols and secondary is not None:
            x += Z * (Z.T * (mp.matrix(secondary.tolist()) - x))
        residuals = [
            float(mp.norm(mp.matrix(level.A.tolist()) * x - mp.matrix(level.lower.tolist()))) if level.m else 0.0
            for level in problem.levels
        ]
        return np.array([float(e) for e in x]), residuals


def close(a: np.ndarray, b: np.ndarray) -> bool:
    """Equal but for the last bit, relative to the vector."""
    return bool(np.linalg.norm(a - b) <= 3e-16 * np.linalg.norm(b) + 1e-300)


@pytest.mark.parametrize(("name", "problem"), equality_cases(1))
@pytest.mark.parametrize("rule", ["exact", RANK_TOLERANCE])
def test_against_mpmath(name: str, problem: Problem, rule: str | float) -> None:
    answer = truth(problem, rank_rule=rule)
    x, residuals = by_mpmath(problem, 1e-40 if rule == "exact" else RANK_TOLERANCE)
    assert answer.x is not None
    assert close(answer.x, x)
    for k, (mine, other) in enumerate(zip(answer.residuals, residuals, strict=True)):
        size = np.abs(problem.levels[k].lower).max(initial=0.0)
        assert mine == pytest.approx(other, rel=1e-15, abs=1e-35 * size)
    assert not answer.ambiguous, answer.reason


@pytest.mark.parametrize("eps", [1e-6, 1e-9, 1e-14])
@pytest.mark.parametrize("rows", [(3, 3), (3, 3, 7)])
@pytest.mark.parametrize("rule", ["exact", RANK_TOLERANCE])
def test_near_singular_against_mpmath(eps: float, rows: tuple[int, ...], rule: str | float) -> None:
    problem = near_singular(eps, 1, rows=rows)
    answer = truth(problem, rank_rule=rule)
    x, _ = by_mpmath(problem, 1e-40 if rule == "exact" else RANK_TOLERANCE)
    assert answer.x is not None
    assert close(answer.x, x)
    cut = eps < RANK_TOLERANCE
    assert answer.ambiguous is cut
    kept = 3 if rule == "exact" or not cut else 0
    assert answer.ranks[:2] == (3, kept)
    assert bool(answer.reason) is cut


def test_secondary_against_mpmath() -> None:
    secondary = np.random.default_rng(5).standard_normal(7)
    for problem in (independent(2), dependent(2), near_singular(1e-14, 2)):
        for rule in ("exact", RANK_TOLERANCE):
            answer = truth(problem, secondary, rule)
            x, _ = by_mpmath(problem, 1e-40 if rule == "exact" else RANK_TOLERANCE, secondary)
            assert answer.x is not None
            assert close(answer.x, x)


def test_closed_forms() -> None:
    def solved(*levels: tuple[list, list], **settings: object) -> Truth:
        return truth(
            stack([np.array(A, float) for A, _ in levels], [np.array(b, float) for _, b in levels]), **settings
        )  # type: ignore[arg-type]

    # least norm of one equation: b a / ||a||^2, correctly rounded
    np.testing.assert_array_equal(solved(([[1, 2, 2]], [1])).x, [1 / 9, 2 / 9, 2 / 9])
    # contradicting equations of one level: their mean
    mean = solved(([[1], [1], [1]], [0, 1, 4]))
    np.testing.assert_array_equal(mean.x, [5 / 3])
    assert mean.residuals[0] == pytest.approx(np.sqrt(26 / 3), rel=1e-16)
    # the same contradiction between levels: the first wins
    first = solved(([[1]], [0]), ([[1], [1]], [1, 4]))
    np.testing.assert_array_equal(first.x, [0])
    assert first.ranks == (1, 0)
    assert first.residuals[1] == pytest.approx(np.sqrt(17), rel=1e-16)
    # level 2 works in what level 1 leaves: x1 + x2 = 2, then x1 as near to 5 as can be, least norm in x3
    np.testing.assert_array_equal(solved(([[1, 1, 0]], [2]), ([[1, 0, 0]], [5])).x, [5, -3, 0])
    # free directions go to the secondary vector
    np.testing.assert_array_equal(solved(([[1, 0, 0]], [2]), secondary=[7, 8, 0.1]).x, [2, 8, 0.1])
    # a level of zeros, whatever it asks for, changes nothing
    nothing = solved(([[0, 0]], [3]), ([[1, 1]], [1]))
    np.testing.assert_array_equal(nothing.x, [0.5, 0.5])
    assert nothing.residuals[0] == 3.0
    assert nothing.ranks == (0, 1)


def test_truncation_in_closed_form() -> None:
    """diag(1, s): the rule cuts s <= tolerance, and the cut direction goes to the secondary vector and to later levels."""
    s = 1e-13
    problem = stack([np.diag([1.0, s])], [[1.0, 1.0]])
    exact, cut = truth(problem), truth(problem, rank_rule=1e-12)
    np.testing.assert_array_equal(exact.x, [1.0, 1e13])
    np.testing.assert_array_equal(cut.x, [1.0, 0.0])
    assert (exact.ranks, cut.ranks) == ((2,), (1,))
    assert (exact.residuals[0], cut.residuals[0]) == (0.0, 1.0)
    assert exact.ambiguous
    assert cut.ambiguous
    np.testing.assert_array_equal(truth(problem, [0.0, 4.0], 1e-12).x, [1.0, 4.0])
    later = stack([np.diag([1.0, s]), np.array([[1.0, 1.0]])], [[1.0, 1.0], [3.0]])
    np.testing.assert_array_equal(truth(later, rank_rule=1e-12).x, [1.0, 2.0])
    np.testing.assert_array_equal(truth(problem, rank_rule=1e-14).x, exact.x)


def test_borderline_is_ambiguous() -> None:
    for s, ambiguous in ((1.5e-12, True), (3e-12, False), (0.7e-12, True)):
        assert truth(stack([np.diag([1.0, s])], [[1.0, 1.0]])).ambiguous is ambiguous
    assert "within a factor 2 of the rank tolerance 1e-12" in truth(stack([np.diag([1.0, 1.5e-12])], [[1, 1]])).reason


@pytest.mark.parametrize("make", [independent, dependent, rank_deficient, over_constrained])
def test_rules_agree_where_ranks_are_clear(make: object) -> None:
    for seed in range(4):
        problem = make(seed)  # type: ignore[operator]
        exact, rule = truth(problem), truth(problem, rank_rule=RANK_TOLERANCE)
        np.testing.assert_array_equal(exact.x, rule.x)
        assert exact.ranks == rule.ranks


def test_multi_precision_equals_rational_arithmetic() -> None:
    """Where the rule keeps everything that is not zero, its own arithmetic rounds to the rational answer."""
    from hqp_rp.core.truth_rule import solve_by_rule

    for _, problem in equality_cases(2):
        exact = truth(problem)
        answer = solve_by_rule([(lv.A, lv.lower) for lv in problem.levels], np.zeros(problem.n), RANK_TOLERANCE)
        np.testing.assert_array_equal(answer.x, exact.x)
        np.testing.assert_allclose(answer.residuals, exact.residuals, rtol=1e-15)
        assert answer.ranks == exact.ranks


def test_high_condition_stays_exact() -> None:
    problem = conditioned(1e10, 3)
    exact = truth(problem)
    assert exact.x is not None
    np.testing.assert_array_equal(exact.x, truth(problem, rank_rule=RANK_TOLERANCE).x)
    x, _ = by_mpmath(problem, 1e-40)
    assert close(exact.x, x)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.lists(st.integers(-400, 400), min_size=3, max_size=3))
def test_scale_of_a_level_changes_nothing(seed: int, powers: list[int]) -> None:
    problem = over_constrained(seed, 5, (2, 2, 3))
    other = scaled(problem, [2.0**power for power in powers])
    for rule in ("exact", RANK_TOLERANCE):
        a, b = truth(problem, rank_rule=rule), truth(other, rank_rule=rule)
        np.testing.assert_array_equal(a.x, b.x)
        assert a.ranks == b.ranks
        np.testing.assert_allclose(b.residuals, a.residuals * [2.0**power for power in powers], rtol=1e-15)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 2))
def test_invariances(seed: int, shared: int) -> None:
    """Order and sign of a level's rows, and a repetition of a level further down, do not matter."""
    problem = dependent(seed, 6, (3, 3), shared)
    x = truth(problem).x
    rng = np.random.default_rng(seed)
    levels = []
    for level in problem.levels:
        order, sign = rng.permutation(level.m), rng.choice([-1.0, 1.0], level.m)
        levels.append(Level.equality(sign[:, None] * level.A[order], sign * level.lower[order]))
    np.testing.assert_array_equal(truth(Problem(levels)).x, x)
    np.testing.assert_array_equal(truth(Problem([*problem.levels, problem.levels[0]])).x, x)
    assert x is not None
    near = truth(problem, x).x  # x is a rounded optimum, and a projection is no further from another than it is
    assert near is not None
    assert np.linalg.norm(near - x) <= 2.0 * EPS * np.linalg.norm(x)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_small_integers_in_rational_arithmetic(seed: int) -> None:
    """x and the residual of one level from the normal equations in Python fractions, solved by Cramer's rule."""
    rng = np.random.default_rng(seed)
    A, b = rng.integers(-5, 6, (4, 2)), rng.integers(-5, 6, 4)
    (g11, g12), (_, g22) = (A.T @ A).tolist()
    h1, h2 = (A.T @ b).tolist()
    determinant = g11 * g22 - g12 * g12
    if determinant == 0:
        return
    expected = [(h1 * g22 - h2 * g12) / determinant, (g11 * h2 - g12 * h1) / determinant]
    np.testing.assert_array_equal(truth(stack([A.astype(float)], [b.astype(float)])).x, expected)


def test_thirty_unknowns() -> None:
    problem = over_constrained(0, 30, (6, 6, 3, 12, 30))
    answer = truth(problem)
    assert answer.ranks == (6, 6, 3, 12, 3)
    assert (answer.residuals[:4] == 0).all()
    rule = truth(near_singular(1e-13, 0, 30, (10, 10)), rank_rule=RANK_TOLERANCE)
    assert rule.ranks[0] == 10
    assert rule.ranks[1] < 10


@pytest.mark.parametrize("eps", [0.0, 1e-15, 1e-14, 1e-6, 1e-3])
@pytest.mark.parametrize("rows", [(3, 3), (3, 3, 7), (4, 5, 3)])
def test_rule_is_what_a_double_precision_svd_cascade_does(eps: float, rows: tuple[int, ...]) -> None:
    """eps = 0: rows that are dependent up to rounding only, as those of a real arm. Exact arithmetic calls them
    independent; the rule and every solver in double precision do not."""
    for seed in range(3):
        problem = near_singular(eps, seed, rows=rows)
        answer = truth(problem, rank_rule=RANK_TOLERANCE)
        x, _ = orthogonal_cascade(problem, np.zeros(7), RANK_TOLERANCE)
        assert answer.x is not None
        bound = 1e-13 / (eps if eps > RANK_TOLERANCE else 1.0) * (1 + np.linalg.norm(answer.x))
        np.testing.assert_allclose(x, answer.x, rtol=0, atol=bound)
        assert answer.ambiguous is (eps < RANK_TOLERANCE)
        assert answer.ranks[1] == (0 if eps < RANK_TOLERANCE else min(rows[1], 7 - rows[0]))


def test_method_is_said() -> None:
    assert truth(independent(0)).method == "exact rational arithmetic"
    assert truth(near_singular(1e-9), rank_rule=1e-12).method == "432-bit arithmetic, rank tolerance 1e-12"
    assert truth(independent(0)).feasible


@pytest.mark.parametrize("rule", ["exakt", 0.0, 1.0, -1e-12, float("nan"), True, None])
def test_bad_rank_rule(rule: object) -> None:
    with pytest.raises(SettingError, match=r'rank_rule is .*; give "exact" or a rank tolerance between 0 and 1'):
        truth(independent(0), rank_rule=rule)  # type: ignore[arg-type]


def test_misuse() -> None:
    with pytest.raises(ProblemError, match="secondary must be 7 finite numbers"):
        truth(independent(0), np.zeros(3))
    with pytest.raises(ProblemError, match="problem is a ndarray"):
        truth(np.eye(3))  # type: ignore[arg-type]


def test_extreme_numbers() -> None:
    """Subnormal and huge entries are rationals like any other; an answer beyond the largest float is infinite."""
    np.testing.assert_array_equal(truth(stack([np.array([[5e-324]])], [[5e-324]])).x, [1.0])
    np.testing.assert_array_equal(truth(stack([np.array([[1e308]])], [[-1e308]])).x, [-1.0])
    np.testing.assert_array_equal(truth(stack([np.array([[1e-300]])], [[1e300]])).x, [np.inf])


def test_mpmath_reference_itself() -> None:
    """The reference must not share a fault with the truth: it solves a case known in closed form."""
    x, residuals = by_mpmath(stack([np.array([[1.0, 2.0, 2.0]]), np.eye(3)[:1]], [[9.0], [0.0]]), 1e-40)
    np.testing.assert_allclose(x, [0.0, 2.25, 2.25], rtol=0, atol=1e-30)
    assert residuals == [pytest.approx(0.0, abs=1e-100), pytest.approx(0.0, abs=1e-100)]
