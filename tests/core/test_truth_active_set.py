"""The truth with two-sided and hard rows: closed forms, an enumeration of all active sets, and its own certificate."""

import itertools

import numpy as np
import pytest
from flint import fmpz_mat
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import Level, Problem, WorkLimitError, certify, truth
from hqp_rp.core.truth_active_set import solve_active_set
from hqp_rp.core.truth_exact import AffineSet, RationalVector, Rows
from tests.problems import (
    boxed,
    degenerate,
    dependent,
    independent,
    near_singular,
    over_constrained,
    rank_deficient,
    scaled,
    two_sided,
)


def enumerated(problem: Problem) -> tuple[np.ndarray, list[float]]:
    """x and residuals by trying every choice of binding rows at every level, in double precision: exponential, simple.

    A level's minimizer is the least-squares solution of some of its rows, each pulled to one of its bounds, with some of
    the earlier rows held at one of theirs; the best of those that respect all earlier rows is it.
    """
    n = problem.n
    C, low, high = np.zeros((0, n)), np.zeros(0), np.zeros(0)
    levels = [*problem.levels, Level.equality(np.eye(n), np.zeros(n))]
    if problem.hard is not None:
        C, low, high = problem.hard.A, problem.hard.lower, problem.hard.upper
    residuals = []
    for level in levels:
        best = (np.inf, np.inf, np.zeros(n))
        for held in itertools.product((0, -1, 1), repeat=len(C)):
            rows = [i for i, side in enumerate(held) if side]
            if len(rows) > n or not np.isfinite([(low if held[i] < 0 else high)[i] for i in rows]).all():
                continue
            E, e = C[rows], np.array([(low if held[i] < 0 else high)[i] for i in rows])
            x0 = np.linalg.lstsq(E, e, rcond=None)[0] if rows else np.zeros(n)
            if len(rows) and np.linalg.norm(E @ x0 - e) > 1e-9:
                continue
            Z = np.linalg.svd(E)[2][np.linalg.matrix_rank(E) :].T if rows else np.eye(n)
            for pulled in itertools.product((0, -1, 1), repeat=level.m):
                if any(side == 0 and a == b for side, a, b in zip(pulled, level.lower, level.upper, strict=True)):
                    continue
                pick = [i for i, side in enumerate(pulled) if side]
                t = np.array([(level.lower if pulled[i] < 0 else level.upper)[i] for i in pick])
                if not np.isfinite(t).all():
                    continue
                z = (
                    np.linalg.lstsq(level.A[pick] @ Z, t - level.A[pick] @ x0, rcond=1e-10)[0]
                    if pick and Z.size
                    else np.zeros(Z.shape[1])
                )
                x = x0 + Z @ z
                if ((C @ x < low - 1e-9) | (C @ x > high + 1e-9)).any():
                    continue
                value = level.A @ x
                cost = np.linalg.norm(value - np.clip(value, level.lower, level.upper))
                if (round(cost, 9), np.linalg.norm(x)) < best[:2]:
                    best = (round(cost, 9), float(np.linalg.norm(x)), x)
        value = level.A @ best[2]
        gap = value - np.clip(value, level.lower, level.upper)
        residuals.append(float(np.linalg.norm(gap)))
        C = np.vstack([C, level.A])
        low = np.concatenate([low, level.lower + np.minimum(gap, 0)])
        high = np.concatenate([high, level.upper + np.maximum(gap, 0)])
    return best[2], residuals[:-1]


@pytest.mark.parametrize("seed", range(24))
def test_against_enumeration(seed: int) -> None:
    n, rows = ((2, (1, 2)), (2, (2, 1)), (3, (1, 1, 1)), (2, (1, 1, 1)))[seed % 4]
    problem = two_sided(seed, n, rows, band=1.0, box=0.4 if seed % 3 == 0 and n == 2 else None)
    answer = truth(problem)
    x, residuals = enumerated(problem)
    assert answer.x is not None
    np.testing.assert_allclose(answer.residuals, residuals, atol=1e-8)
    np.testing.assert_allclose(answer.x, x, atol=1e-7)


def test_closed_forms() -> None:
    eye = np.eye(2)

    def x(*levels: Level, hard: Level | None = None, secondary: list[float] | None = None) -> list[float]:
        answer = truth(Problem(levels, hard=hard), secondary)
        assert answer.x is not None
        return answer.x.tolist()

    assert x(Level(eye, [1, -2], [3, 2])) == [1, 0]  # least norm within a band
    assert x(Level(eye, [1, -2], [3, 2]), secondary=[9, 1]) == [3, 1]
    assert x(Level.equality([[1, 1]], [4]), hard=Level(eye, -1, 1)) == [1, 1]  # clipped at the hard box
    assert x(Level.equality([[1, 1]], [1]), hard=Level(eye, -1, 0.25)) == [0.25, 0.25]
    # a hard row that binds for level 1 leaves level 2 the rest: x1 = 1, then x1 + x2 = 5
    assert x(Level.equality([[1, 0]], [4]), Level.equality([[1, 1]], [5]), hard=Level([[1, 0]], -1, 1)) == [1, 4]
    # contradicting bands of one level share the violation; of two levels, the first wins
    assert x(Level([[1, 0], [1, 0]], [2, -np.inf], [np.inf, 1])) == [1.5, 0]
    assert x(Level([[1, 0]], 2, np.inf), Level([[1, 0]], -np.inf, 1)) == [2, 0]
    # a band of level 1 binds level 2 although level 1 alone would not be at its edge
    assert x(Level([[1, 0]], -1, 1), Level.equality([[1, 1], [1, -1]], [3, 3])) == [1, 0]
    # an inactive row leaves no trace
    assert x(Level([[1, 0]], -1, 1), Level.equality([[1, 0]], [0.5])) == [0.5, 0]
    # a row without any bound asks nothing
    assert x(Level([[1, 0]], -np.inf, np.inf), Level.equality([[1, 0]], [7])) == [7, 0]


def test_residuals_and_ranks() -> None:
    answer = truth(Problem([Level.equality(np.eye(2), [3.0, 0.5])], hard=Level(np.eye(2), -1.0, 1.0)))
    np.testing.assert_array_equal(answer.x, [1.0, 0.5])
    assert answer.residuals.tolist() == [2.0]
    assert answer.ranks == (1,)  # the hard row took the other direction
    assert answer.method == "exact rational active set"
    assert not answer.ambiguous


def test_contradicting_hard_rows_are_infeasible() -> None:
    levels = [Level.equality([[1.0, 0.0]], [0.0])]
    for hard in (
        Level([[1, 0], [1, 0]], [2, -np.inf], [np.inf, 1]),
        Level([[1, 0], [0, 1], [1, 1]], [-1, -1, 3], [1, 1, 4]),
        Level.equality([[1, 0], [2, 0]], [1, 3]),
        Level([[0, 0]], 1, 2),
        Level([[1, 0], [1, 0]], [0, -np.inf], [np.inf, -5e-324]),  # by the smallest number there is
    ):
        answer = truth(Problem(levels, hard=hard))
        assert answer.x is None
        assert not answer.feasible
        assert np.isnan(answer.residuals).all()
    barely = truth(Problem(levels, hard=Level([[1, 0], [1, 0]], [1, -np.inf], [np.inf, 1])))
    np.testing.assert_array_equal(barely.x, [1.0, 0.0])


@pytest.mark.parametrize("make", [independent, dependent, rank_deficient, over_constrained])
@pytest.mark.parametrize("seed", range(3))
def test_wide_bounds_change_nothing(make: object, seed: int) -> None:
    problem = make(seed)  # type: ignore[operator]
    plain, wide = truth(problem), truth(boxed(problem, 1e3))
    np.testing.assert_array_equal(wide.x, plain.x)
    np.testing.assert_array_equal(wide.residuals, plain.residuals)
    assert wide.ranks == plain.ranks


def test_degenerate_rows() -> None:
    """Repeated and parallel rows, and more rows active at a vertex than there are unknowns."""
    rows = np.array([[1.0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [1, -1], [-1, 1]])
    problem = Problem(
        [Level.equality(np.eye(2), [5.0, 5.0])], hard=Level(rows, -np.inf, [1, 1, 2, 1, 2, 0, 0], name="vertex")
    )
    np.testing.assert_array_equal(truth(problem).x, [1.0, 1.0])
    pinned = Problem([Level.equality(np.eye(2), [5.0, 5.0])], hard=Level(np.eye(2), [1, -1], [1, 1]))
    np.testing.assert_array_equal(truth(pinned).x, [1.0, 1.0])


def test_ambiguity_with_bounds() -> None:
    assert truth(boxed(near_singular(1e-13), 1e16)).ambiguous
    assert not truth(boxed(near_singular(1e-3), 1e6)).ambiguous


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 6), st.sampled_from([None, 0.2, 1.0]))
def test_certified_and_scale_free(seed: int, n: int, box: float | None) -> None:
    problem = two_sided(seed, n, (2, 3, n), band=1.0, box=box)
    answer = truth(problem)
    assert answer.x is not None
    verdict = certify(problem, answer.x, tolerance=1e-12)
    assert verdict.ok, verdict.sentence
    other = truth(scaled(problem, [2.0**300, 2.0**-300, 8.0]))
    np.testing.assert_array_equal(other.x, answer.x)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_degenerate_integer_rows_end_at_the_optimum(seed: int) -> None:
    """Up to 8 unknowns, up to 16 hard rows, ties everywhere; the answer does not depend on where the search starts."""
    problem = degenerate(seed)
    answer = solve_active_set(problem, np.zeros(problem.n))
    rng = np.random.default_rng(seed)
    for start in (np.zeros(problem.n), rng.standard_normal(problem.n), 1e9 * rng.standard_normal(problem.n)):
        again = solve_active_set(problem, np.zeros(problem.n), start)
        assert (again is None) == (answer is None)
        if answer is not None and again is not None:
            np.testing.assert_array_equal(again.x, answer.x)
            np.testing.assert_array_equal(again.residuals, answer.residuals)
    if answer is not None:
        verdict = certify(problem, answer.x)
        assert verdict.ok, verdict.sentence


def test_rows_that_made_the_search_endless() -> None:
    """Equal columns, multiples of earlier rows, a box: an earlier form of the search did not come back from it."""
    A1 = np.array([[-6, 6, 6, 0, -7, 6], [0, -7, -7, -2, 4, -2]]) / 4
    A2 = np.array([[-12, -9, -9, -6, -2, 6], [6, -13, -13, -2, 11, -8], [0, 14, 14, 4, -8, 4]]) / 4
    A2 = np.vstack([A2, A2[2], 1.5 * A2[2]])
    A3 = np.array(
        [[-6, -29, -29, -10, 13, -4], [-12, 5, 5, -2, -10, 10], [-18, -24, -24, -12, 3, 6], [36, 13, 13, 14, 14, -22]]
    )
    problem = Problem(
        [
            Level(A1, [-np.inf, -0.9015372], [2.10188838, -0.9015372]),
            Level(
                A2,
                [3.08460822, 0.36736708, -np.inf, 1.21019497, -0.51313781],
                [3.08460822, 0.36736708, 0.78195634, 1.67637592, 1.02134422],
            ),
            Level(
                A3 / 4, [-1.01034781, -0.37830447, 1.03882667, -0.24963819], [-1.01034781, -0.37830447, 2.62, -0.2496]
            ),
        ],
        hard=Level(np.eye(6), -0.5, 0.5),
    )
    answer = truth(problem)
    assert answer.x is not None
    verdict = certify(problem, answer.x, tolerance=1e-12)
    assert verdict.ok, verdict.sentence
    assert answer.x[1] == answer.x[2]


def test_affine_set_takes_rows_in_another_unit() -> None:
    """First in halves, then in thirds: x1 = 1/2, x1 + x2 = 4/3, with the set's parametrization already computed."""
    set_ = AffineSet(3)
    set_.minimize(Rows(fmpz_mat(1, 3, [1, 0, 0]), fmpz_mat(1, 1, [1]), 2))
    set_.solved()
    set_.minimize(Rows(fmpz_mat(1, 3, [1, 1, 0]), fmpz_mat(1, 1, [4]), 3))
    assert set_.nearest(RationalVector([0, 0, 0], 1)) == RationalVector([3, 5, 0], 6)
    set_.minimize(Rows(fmpz_mat(2, 3, [1, 0, 2, 1, 0, 2]), fmpz_mat(2, 1, [0, 1]), 7))  # 1/2 + 2 x3 = 1/14
    assert set_.nearest(RationalVector([0, 0, 0], 1)) == RationalVector([21, 35, -9], 42)


def test_work_is_bounded() -> None:
    problem = two_sided(3, 6, (2, 3, 6), band=1.0, box=0.2)
    with pytest.raises(WorkLimitError, match=r"visited 1 cells, which is allowed, .* give truth\(\.\.\., start=x\)"):
        solve_active_set(problem, np.zeros(6), limit=1)
    answer = solve_active_set(problem, np.zeros(6))
    assert answer is not None
    again = solve_active_set(problem, np.zeros(6), answer.x, limit=1)  # from the optimum there is nothing to search
    assert again is not None
    np.testing.assert_array_equal(again.x, answer.x)
