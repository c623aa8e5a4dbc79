"""The certificate accepts the right answer and names the level at fault of every wrong one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from hqp_rp import Level, Problem, ProblemError, SettingError, certify, truth
from hqp_rp.core.nonnegative import nonnegative_least_squares
from hqp_rp.core.solver import RANK_TOLERANCE
from tests.problems import (
    boxed,
    conditioned,
    dependent,
    equality_cases,
    independent,
    near_singular,
    over_constrained,
    rank_deficient,
    scaled,
    stack,
    two_sided,
)


def optimum(problem: Problem, secondary: np.ndarray | None = None) -> np.ndarray:
    x = truth(problem, secondary, RANK_TOLERANCE).x
    assert x is not None
    return x


def inequality_problems(count: int) -> list[Problem]:
    shapes = [(3, (1, 3)), (4, (2, 2)), (5, (3, 3)), (7, (3, 3, 7))]
    return [two_sided(s, *shapes[s % 4], band=1.0, box=(None, 0.3, 1.0)[s % 3]) for s in range(count)]


@pytest.mark.parametrize(("name", "problem"), equality_cases(2))
def test_accepts_the_optimum(name: str, problem: Problem) -> None:
    verdict = certify(problem, optimum(problem), tolerance=1e-13)
    assert verdict.ok, verdict.sentence
    assert verdict.fault is None
    assert verdict.relative_excess < 1e-13
    assert [level.name for level in verdict.levels] == list(problem.names)


@pytest.mark.parametrize("eps", [1e-2, 1e-5, 1e-8, 1e-11, 1e-14])
@pytest.mark.parametrize("rows", [(3, 3), (3, 3, 7)])
def test_accepts_the_optimum_near_a_singularity(eps: float, rows: tuple[int, ...]) -> None:
    for seed in range(3):
        problem = near_singular(eps, seed, rows=rows)
        verdict = certify(problem, optimum(problem))
        assert verdict.ok, verdict.sentence


def test_accepts_the_optimum_with_inequalities() -> None:
    for problem in inequality_problems(40):
        verdict = certify(problem, optimum(problem), tolerance=1e-12)
        assert verdict.ok, verdict.sentence


def test_accepts_the_optimum_with_a_secondary_vector() -> None:
    secondary = np.random.default_rng(99).standard_normal(7)
    for problem in (independent(0), dependent(1), boxed(independent(2), 1.0)):
        x = optimum(problem, secondary)
        assert certify(problem, x, secondary, 1e-12).ok
        assert certify(problem, x).fault == "least norm"


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([1e-2, 1e-4, 1e-6]))
def test_perturbed_answers_are_caught(seed: int, size: float) -> None:
    problem = two_sided(seed, 5, (2, 2, 4), band=1.0, box=None if seed % 2 else 0.8)
    x = optimum(problem)
    direction = np.random.default_rng(seed).standard_normal(5)
    assert not certify(problem, x + size * direction).ok


@pytest.mark.parametrize(("name", "problem"), equality_cases(1))
def test_each_level_is_named(name: str, problem: Problem) -> None:
    """A step that only level k can feel, within the null space of the levels before it, is level k's fault."""
    x, Z = optimum(problem), np.eye(problem.n)
    for k, level in enumerate(problem.levels):
        if level.m == 0 or Z.shape[1] == 0:
            continue
        A = level.A / np.abs(level.A).max()
        _, sigma, Vt = np.linalg.svd(A @ Z)
        rank = int((sigma > 1e-9 * np.linalg.norm(A, 2)).sum())
        if rank:
            verdict = certify(problem, x + 1e-3 * (1 + np.linalg.norm(x)) * Z @ Vt[0])
            assert verdict.fault == problem.names[k]
            assert problem.names[k] in verdict.sentence
            assert all(report.accepted(1e-9) for report in verdict.levels[:k])
        Z = Z @ Vt[rank:].T
    if Z.shape[1]:
        assert certify(problem, x + 1e-3 * (1 + np.linalg.norm(x)) * Z[:, 0]).fault == "least norm"


@pytest.mark.parametrize("seed", range(5))
def test_swapped_levels_are_caught(seed: int) -> None:
    problem = over_constrained(seed, rows=(4, 5))
    swapped = Problem(problem.levels[::-1])
    assert certify(problem, optimum(swapped)).fault == "level 1"
    later = over_constrained(seed, rows=(2, 4, 4))
    mixed = Problem([later.levels[0], later.levels[2], later.levels[1]])
    assert certify(later, optimum(mixed)).fault == "level 2"


@pytest.mark.parametrize("seed", range(5))
def test_a_dropped_level_or_row_is_caught(seed: int) -> None:
    problem = independent(seed, rows=(2, 2, 2))
    for k in range(3):
        rest = Problem([level for i, level in enumerate(problem.levels) if i != k])
        assert certify(problem, optimum(rest)).fault == f"level {k + 1}"
    one_row_less = Problem([Level.equality(problem.levels[0].A[1:], problem.levels[0].lower[1:]), *problem.levels[1:]])
    assert certify(problem, optimum(one_row_less)).fault == "level 1"


@pytest.mark.parametrize("seed", range(5))
def test_dropped_hard_rows_are_caught(seed: int) -> None:
    problem = boxed(over_constrained(seed, rows=(4, 5)), 0.2)
    x = optimum(Problem(problem.levels))
    verdict = certify(problem, x)
    assert verdict.fault == "hard rows"
    assert verdict.hard_violation == pytest.approx(np.abs(x).max() - 0.2, rel=1e-12)
    assert "violated by up to" in verdict.sentence
    # Cutting at the box, as a controller without a proper solver would, is not optimal either.
    assert certify(problem, np.clip(x, -0.2, 0.2)).fault in ("level 1", "level 2")


@pytest.mark.parametrize("seed", range(8))
def test_a_flipped_multiplier_is_caught(seed: int) -> None:
    """The optimum held at the edge of a hard row from the wrong side: stationary but for the sign of its multiplier."""
    problem = independent(seed, 4, (6,))
    free = optimum(problem)
    row = np.zeros(4)
    row[seed % 4] = 1.0
    edge = free[seed % 4] + 0.5
    held = optimum(Problem(problem.levels, hard=Level.equality([row], [edge])))
    right = Problem(problem.levels, hard=Level([row], edge, np.inf))  # wants to fall, must not
    wrong = Problem(problem.levels, hard=Level([row], -np.inf, edge))  # may fall, does not
    accepted, refused = certify(right, held, tolerance=1e-12), certify(wrong, held)
    assert accepted.ok, accepted.sentence
    assert accepted.levels[0].multipliers == 1
    assert refused.fault == "level 1"
    assert refused.levels[0].multipliers == 0


@pytest.mark.parametrize("seed", range(6))
def test_a_flipped_multiplier_of_a_soft_row_is_caught(seed: int) -> None:
    """The same with a band of an earlier level, and for the least norm instead of a level."""
    row = np.random.default_rng(seed).standard_normal((1, 3))
    band, goal = Level(row, -1.0, 1.0, name="band"), Level.equality(np.eye(3)[:1] + row, [9.0], name="goal")
    x = optimum(Problem([band, goal]))
    held = optimum(Problem([Level.equality(row, [-1.0]), goal]))
    assert certify(Problem([band, goal]), x, tolerance=1e-12).ok
    if row @ x > -0.9:
        assert certify(Problem([band, goal]), held).fault in ("goal", "least norm")
    away = Problem([Level(row, 1.0, 2.0, name="band")])
    assert certify(away, optimum(away), tolerance=1e-12).ok
    assert certify(away, 2 * optimum(away)).fault == "least norm"


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_excess_is_what_can_be_removed(seed: int) -> None:
    """excess^2 = residual^2 - (least residual that is possible without touching the levels before)^2."""
    problem = over_constrained(seed, 5, (2, 4))
    x = np.random.default_rng(seed).standard_normal(5)
    first, second = certify(problem, x).levels
    assert first.excess == pytest.approx(first.residual, rel=1e-12)  # level 1 alone can always be met
    fixed = Problem([Level.equality(problem.levels[0].A, problem.levels[0].A @ x), problem.levels[1]])
    least = truth(fixed).residuals[1]
    assert second.excess == pytest.approx(np.sqrt(second.residual**2 - least**2), rel=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_excess_with_active_rows(seed: int) -> None:
    """At the origin all rows of a cone are active: the excess is what the best point of the cone removes."""
    rng = np.random.default_rng(seed)
    cone = Level(rng.standard_normal((4, 3)), -np.inf, 0.0)
    goal = Level.equality(rng.standard_normal((5, 3)), rng.standard_normal(5))
    report = certify(Problem([goal], hard=cone), np.zeros(3)).levels[0]
    least = truth(Problem([goal], hard=cone)).residuals[0]
    assert report.residual == pytest.approx(np.linalg.norm(goal.lower), rel=1e-14)
    assert report.excess == pytest.approx(np.sqrt(max(0.0, report.residual**2 - least**2)), rel=1e-6, abs=1e-6)


def test_scale_and_relative_excess() -> None:
    A, b, x = np.diag([3.0, 1.0]), np.array([3.0, 5.0]), np.array([1.0, 4.0])
    report = certify(stack([A], [b]), x).levels[0]
    assert report.residual == 1.0
    assert report.excess == pytest.approx(1.0, rel=1e-15)
    assert report.scale == pytest.approx(3 * np.sqrt(17) + np.sqrt(34), rel=1e-15)
    assert report.relative_excess == pytest.approx(1 / report.scale, rel=1e-15)


@pytest.mark.parametrize("powers", [(498, -498), (-1000, 900), (0, 1000)])
def test_scale_of_a_level_matters_nowhere(powers: tuple[int, int]) -> None:
    for problem in (dependent(0), two_sided(3, 7, (3, 3))):
        other = scaled(problem, [2.0**power for power in powers])
        x = np.arange(7.0)
        for plain, big, power in zip(certify(problem, x).levels, certify(other, x).levels, powers, strict=True):
            assert big.relative_excess == pytest.approx(plain.relative_excess, rel=1e-9)
            assert big.residual == plain.residual * 2.0**power
        assert certify(other, optimum(problem), tolerance=1e-12).ok


def test_a_solver_tolerance_is_honoured() -> None:
    problem = independent(1, rows=(7,))
    x = optimum(problem)
    step = np.linalg.svd(problem.levels[0].A)[2][0]
    worse = x + 1e-6 * (np.linalg.norm(x) + 1) * step
    assert not certify(problem, worse, tolerance=1e-7).ok
    assert certify(problem, worse, tolerance=1e-5).ok
    slack = boxed(problem, float(np.abs(x).max()) * 0.5)
    inside = optimum(slack) * (1 - 1e-7)  # stops just short of the bounds, as interior methods do
    assert not certify(slack, inside, tolerance=1e-10).ok
    assert certify(slack, inside, tolerance=1e-5).ok


def test_the_rank_rule_is_the_judge() -> None:
    """Beyond the rank rule the exact optimum uses directions that the rule calls free: not the least norm."""
    problem = near_singular(1e-14)
    exact = truth(problem).x
    assert exact is not None
    assert certify(problem, exact).fault == "least norm"
    assert certify(problem, exact, rank_tolerance=0.0).fault is None
    assert certify(problem, optimum(problem)).ok


def test_uncertainty_grows_with_the_condition() -> None:
    sizes = [certify(conditioned(c, 1, rows=(3, 7)), np.ones(7)).levels[1].uncertainty for c in (1e1, 1e4, 1e8)]
    assert sizes[0] < 1e-10
    assert sizes[0] < sizes[1] < sizes[2]


def test_zero_is_the_answer_to_nothing() -> None:
    problem = Problem([Level(np.zeros((0, 3)), [], [], name="empty"), Level.equality(np.eye(3)[:2], [0.0, 0.0])])
    verdict = certify(problem, np.zeros(3))
    assert verdict.ok
    assert verdict.relative_excess == 0.0
    assert verdict.relative_deviation == 0.0
    assert certify(problem, [0.0, 0.0, 1.0]).fault == "least norm"


def test_infeasible_hard_rows_never_pass() -> None:
    problem = Problem([Level.equality([[1.0]], [0.0])], hard=Level([[1.0], [1.0]], [2, -np.inf], [np.inf, 1]))
    for x in (1.0, 1.5, 2.0):
        assert certify(problem, [x]).fault == "hard rows"


def test_rank_deficient_levels_leave_only_their_own_residual() -> None:
    problem = rank_deficient(0)
    verdict = certify(problem, optimum(problem))
    assert verdict.levels[0].residual > 0.1
    assert verdict.levels[0].relative_excess < 1e-14


def test_misuse() -> None:
    with pytest.raises(ProblemError, match="x must be 7 finite numbers"):
        certify(independent(0), np.full(7, np.nan))
    with pytest.raises(ProblemError, match="secondary must be 7 finite numbers"):
        certify(independent(0), np.zeros(7), np.zeros(2))
    with pytest.raises(SettingError, match="tolerance is -1"):
        certify(independent(0), np.zeros(7), tolerance=-1)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.integers(1, 9))
def test_nonnegative_least_squares_against_scipy(seed: int, m: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    C, y = rng.standard_normal((m, k)), rng.standard_normal(m)
    weights, rest = nonnegative_least_squares(C, y)
    assert (weights >= 0).all()
    np.testing.assert_allclose(rest, y - C @ weights, atol=1e-14)
    assert np.linalg.norm(rest) == pytest.approx(nnls(C, y)[1], abs=1e-10)
    assert (C.T @ rest <= 1e-9).all()
