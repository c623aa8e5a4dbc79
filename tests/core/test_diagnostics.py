"""Violation, ranks, sigma_min and the kind of singularity, from (problem, x) alone."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hqp_rp
from hqp_rp import Level, Problem, Singularity, diagnose
from hqp_rp.core.diagnostics import norm, spectra
from tests.problems import (
    badly_scaled,
    boxed,
    dependent,
    equality_cases,
    independent,
    near_singular,
    over_constrained,
    rank_deficient,
    scaled,
    stack,
)


def test_violation_is_signed_and_zero_inside() -> None:
    level = Level(np.eye(4), [-1, -1, 0, -np.inf], [1, 1, 0, np.inf], name="band")
    report = diagnose(Problem([level]), [3.0, -1.5, 0.25, 1e9])[0]
    assert report.name == "band"
    np.testing.assert_array_equal(report.violation, [2.0, -0.5, 0.25, 0.0])
    assert report.residual == pytest.approx(math.sqrt(4 + 0.25 + 0.0625), rel=1e-15)


def test_equality_violation_is_the_residual_vector() -> None:
    problem = independent(3)
    x = np.arange(7.0)
    for report, level in zip(diagnose(problem, x), problem.levels, strict=True):
        np.testing.assert_allclose(report.violation, level.A @ x - level.lower, rtol=0, atol=0)


def test_sigma_min_is_that_of_the_projected_rows() -> None:
    problem = independent(4, rows=(3, 2, 2))
    Z = np.eye(7)
    for report, level in zip(diagnose(problem, np.zeros(7)), problem.levels, strict=True):
        sigma = np.linalg.svd(level.A @ Z, compute_uv=False)
        assert report.sigma_min == pytest.approx(sigma[-1], rel=1e-10)
        stacked = np.vstack([lv.A for lv in problem.levels[: problem.levels.index(level) + 1]])
        Z = np.linalg.svd(stacked)[2][len(stacked) :].T


def test_planar_two_link_arm_in_closed_form() -> None:
    """Level 1: the tip's height; level 2: the second link's angle. Rows cos q1 + cos q12, cos q12 and 1, 1: the second
    depends on the first when cos q1 = 0, while both rows are non-zero."""
    for q1, q2, kind in ((0.3, 0.9, Singularity.NONE), (math.pi / 2, 0.9, Singularity.ALGORITHMIC)):
        J1 = np.array([[math.cos(q1) + math.cos(q1 + q2), math.cos(q1 + q2)]])
        J2 = np.array([[1.0, 1.0]])
        reports = diagnose(stack([J1, J2], [[1.0], [0.5]]), np.zeros(2))
        assert [r.singularity for r in reports] == [Singularity.NONE, kind]
        # The part of (1, 1) across J1 is |cos q1| / ||J1||.
        assert reports[1].sigma_min == pytest.approx(abs(math.cos(q1)) / np.linalg.norm(J1), abs=1e-15)


@pytest.mark.parametrize("seed", range(3))
def test_kinds_of_singularity(seed: int) -> None:
    x = np.zeros(7)
    assert {r.singularity for r in diagnose(independent(seed), x)} == {Singularity.NONE}
    kinematic = diagnose(rank_deficient(seed), x)
    assert [(r.rank, r.own_rank, r.singularity) for r in kinematic] == [(2, 2, Singularity.KINEMATIC)] * 2
    first, second = diagnose(dependent(seed), x)
    assert first.singularity is Singularity.NONE
    assert (second.rank, second.own_rank, second.singularity) == (2, 3, Singularity.ALGORITHMIC)
    A = rank_deficient(seed).levels[0].A
    twice = diagnose(stack([A, A[[0, 1, 0, 1]]], [np.ones(4), np.ones(4)]), x)
    assert twice[1].rank == 0
    assert twice[1].singularity is Singularity.BOTH


@pytest.mark.parametrize("seed", range(3))
def test_a_posture_below_others_is_partly_used_up(seed: int) -> None:
    """Seven rows beside three: the four dimensions left are all used. That is counting, no singularity."""
    rng = np.random.default_rng(seed)
    A, x = rng.normal(size=(3, 7)), np.zeros(7)
    posture = diagnose(stack([A, np.eye(7)], [np.ones(3), np.ones(7)]), x)[1]
    assert (posture.rank, posture.own_rank, posture.singularity) == (4, 7, Singularity.PARTLY_USED_UP)
    # Five rows of which one depends on level 1: four would still fit, three are had.
    lower = np.vstack([rng.normal(size=(4, 7)), A[:1]])
    lost = diagnose(stack([A, lower[1:], np.eye(7)], [np.ones(3), np.ones(4), np.ones(7)]), x)
    assert (lost[1].rank, lost[1].singularity) == (3, Singularity.ALGORITHMIC)
    assert (lost[2].rank, lost[2].singularity) == (1, Singularity.PARTLY_USED_UP)


def test_equation_12() -> None:
    """ALGORITHMIC just when rank J1 + rank J2 > rank [J1; J2], where both would fit into n."""
    for _, problem in equality_cases(2):
        if problem.p != 2:
            continue
        A1, A2 = (level.A for level in scaled(problem, [1 / norm(level.A.ravel()) for level in problem.levels]).levels)
        r1, r2, both = (np.linalg.matrix_rank(A, tol=1e-10) for A in (A1, A2, np.vstack([A1, A2])))
        report = diagnose(problem, np.zeros(problem.n))[1]
        algorithmic = report.singularity in (Singularity.ALGORITHMIC, Singularity.BOTH)
        assert algorithmic == (min(r1 + r2, problem.n) > both)


def test_rank_rule_refers_to_the_level_itself() -> None:
    eps = 1e-5
    for tolerance, rank in ((1e-3, 0), (1e-8, 3)):
        assert diagnose(near_singular(eps), np.zeros(7), tolerance)[1].rank == rank
    # After level 1 nothing but rounding noise is left of level 2: relative to itself it would have full rank.
    A1 = independent(0, rows=(6,)).levels[0].A
    problem = stack([A1, np.random.default_rng(1).standard_normal((3, 6)) @ A1], [np.zeros(6), np.zeros(3)])
    assert diagnose(problem, np.zeros(7))[1].rank == 0


def test_empty_level_and_exhausted_freedom() -> None:
    problem = Problem(
        [Level(np.zeros((0, 3)), [], []), Level.equality(np.eye(3), np.ones(3)), independent(0, 3, (2,)).levels[0]]
    )
    empty, full, late = diagnose(problem, np.ones(3))
    assert (empty.rank, empty.own_rank, empty.sigma_min, empty.residual) == (0, 0, math.inf, 0.0)
    assert empty.singularity is Singularity.NONE
    assert (full.rank, full.sigma_min) == (3, 1.0)
    assert (late.rank, late.own_rank, late.sigma_min, late.singularity) == (0, 2, 0.0, Singularity.PARTLY_USED_UP)


def test_zero_matrix_is_a_kinematic_singularity() -> None:
    report = diagnose(stack([np.zeros((2, 3))], [np.ones(2)]), np.zeros(3))[0]
    assert (report.rank, report.own_rank, report.sigma_min, report.singularity) == (0, 0, 0.0, Singularity.KINEMATIC)


@pytest.mark.parametrize("power", [-498, 498, 1000, -1000])
def test_scale_of_a_level_matters_nowhere(power: int) -> None:
    problem, x = independent(1), np.arange(7.0)
    for plain, big in zip(diagnose(problem, x), diagnose(scaled(problem, [2.0**power, 2.0**-power]), x), strict=True):
        factor = 2.0**power if plain.name == "level 1" else 2.0**-power
        assert (big.rank, big.own_rank, big.singularity) == (plain.rank, plain.own_rank, plain.singularity)
        assert big.sigma_min == plain.sigma_min * factor
        assert big.residual == plain.residual * factor


def test_only_rows_that_bind_take_freedom() -> None:
    band = Level(np.eye(3)[:1], -1.0, 1.0, name="band")
    goal = Level.equality(np.eye(3)[:1], [5.0], name="goal")
    free, blocked = diagnose(Problem([band, goal]), [0.5, 0, 0]), diagnose(Problem([band, goal]), [1.0, 0, 0])
    assert (free[0].rank, free[0].sigma_min, free[1].rank) == (0, math.inf, 1)
    assert (blocked[0].rank, blocked[0].sigma_min, blocked[1].rank) == (1, 1.0, 0)
    assert blocked[1].singularity is Singularity.LIMITED
    violated = diagnose(Problem([band, goal]), [2.0, 0, 0])
    assert (violated[0].rank, violated[1].rank) == (1, 0)


def test_active_hard_rows_come_before_level_1() -> None:
    problem = boxed(independent(0, 3, (2,)), 1.0)
    assert diagnose(problem, np.zeros(3))[0].rank == 2
    assert diagnose(problem, [1.0, -1.0, 0.0])[0].rank == 1


def kinds(problem: Problem, x: object) -> list[Singularity]:
    return [report.singularity for report in diagnose(problem, x)]


def test_what_limits_take_is_no_singularity() -> None:
    e = np.eye(3)
    box = Level(e, -1.0, 1.0, name="box")
    first, second = Level.equality(e[:1], [5.0]), Level.equality(e[1:], [0.0, 0.0])
    # One of two rows lies along a joint at its limit: a loss of rank that only the limit makes.
    along = Level.equality([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [5.0, 0.0])
    assert kinds(Problem([along], hard=box), [1.0, 0.0, 0.0]) == [Singularity.LIMITED]
    assert kinds(Problem([along], hard=box), [0.5, 0.0, 0.0]) == [Singularity.NONE]
    # By number: one dimension is left for two rows.
    assert kinds(Problem([second], hard=box), [1.0, 1.0, 0.0]) == [Singularity.LIMITED]
    # A posture below gets what is left, with limits and without.
    posture = Level.equality(e, np.zeros(3))
    assert kinds(Problem([first, posture], hard=box), [1.0, 0.0, 0.0]) == [
        Singularity.LIMITED,
        Singularity.PARTLY_USED_UP,
    ]
    # A conflict among levels stays one, beside limits too, and a level's own dependence its own.
    twice = Level.equality(e[:1] + 1e-15, [4.0])
    assert kinds(Problem([first, twice], hard=box), [0.0, 1.0, 0.0])[1] is Singularity.ALGORITHMIC
    dependent = Level.equality([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], [1.0, 2.0])
    assert kinds(Problem([dependent], hard=box), [0.0, 1.0, 0.0]) == [Singularity.KINEMATIC]
    assert kinds(Problem([dependent], hard=box), [1.0, 0.0, 0.0]) == [Singularity.KINEMATIC]
    assert kinds(Problem([first, dependent], hard=box), [0.0, 1.0, 0.0])[1] is Singularity.BOTH
    # Soft limits of an earlier level, and what the metric makes of it.
    for metric in (None, [1.0, 2.0, 3.0]):
        soft = Problem([box, along], metric=metric)
        assert kinds(soft, [1.0, 0.0, 0.0])[1] is Singularity.LIMITED
        assert kinds(Problem([first, along], hard=box, metric=metric), [0.0, 0.0, 1.0])[1] is Singularity.ALGORITHMIC


def test_a_hard_equality_is_no_limit() -> None:
    """A task among `limits=`, a locked joint: what it takes is gone at every x, as what a level before takes."""
    e = np.eye(3)
    along = Level.equality([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [5.0, 0.0])
    for metric in (None, [1.0, 2.0, 3.0]):
        fixed = Level.equality(e[:1], [1.0])
        assert kinds(Problem([along], hard=fixed, metric=metric), [1.0, 0.0, 0.0]) == [Singularity.ALGORITHMIC]
        # Beside an active limit, on another unknown and on the same one.
        both = Level(e[[0, 2]], [1.0, -1.0], [1.0, 1.0])
        assert kinds(Problem([along], hard=both, metric=metric), [1.0, 0.0, 1.0]) == [Singularity.ALGORITHMIC]
        same = Level(e[[0, 0]], [1.0, -1.0], [1.0, 1.0])
        assert kinds(Problem([along], hard=same, metric=metric), [1.0, 0.0, 0.0]) == [Singularity.ALGORITHMIC]
        # The equality leaves this level its rank, the limit does not.
        other = Level(e[[2, 0]], [1.0, -1.0], [1.0, 1.0])
        assert kinds(Problem([along], hard=other, metric=metric), [1.0, 0.0, 1.0]) == [Singularity.LIMITED]
    # A locked joint below a whole posture: it gets all that is left.
    posture = Level.equality(e, np.zeros(3))
    assert kinds(Problem([posture], hard=Level.equality(e[:1], [0.0])), np.zeros(3)) == [Singularity.PARTLY_USED_UP]
    # The level's own dependence beside a hard equality on the same row.
    dependent = Level.equality([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], [1.0, 2.0])
    assert kinds(Problem([dependent], hard=Level.equality(e[:1], [1.0])), [1.0, 0.0, 0.0]) == [Singularity.BOTH]


def test_a_hard_equality_counts_as_the_same_rows_at_a_level_before() -> None:
    """Whatever stands before them, the levels' kinds are those beside these rows as level 1."""
    rng = np.random.default_rng(7)
    for _ in range(60):
        n = int(rng.integers(2, 7))
        rows = [rng.integers(-1, 2, (int(m), n)) for m in rng.integers(1, 4, 3)]
        stated = [Level.equality(A, np.zeros(len(A))) for A in rows]
        hard = Problem(stated[1:], hard=stated[0])
        assert kinds(hard, np.zeros(n)) == kinds(Problem(stated), np.zeros(n))[1:]


def test_spectra_are_those_of_diagnose() -> None:
    for _, problem in equality_cases(1):
        for spectrum, report in zip(spectra(problem), diagnose(problem, np.zeros(problem.n)), strict=True):
            assert (spectrum.rank, spectrum.own_rank, spectrum.sigma_min, spectrum.singularity) == (
                report.rank,
                report.own_rank,
                report.sigma_min,
                report.singularity,
            )


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.lists(st.integers(0, 4), min_size=1, max_size=4))
def test_ranks_add_up_and_agree_with_the_stack(seed: int, n: int, rows: list[int]) -> None:
    problem = over_constrained(seed, n, rows)
    reports = diagnose(problem, np.zeros(n))
    total = 0
    for k, report in enumerate(reports):
        assert 0 <= report.rank <= report.own_rank <= min(problem.levels[k].A.shape)
        total += report.rank
        assert total == np.linalg.matrix_rank(problem.matrix[: problem.offsets[k + 1]])


def test_solution_levels_are_diagnosed() -> None:
    problem = independent(0)
    solution = hqp_rp.Solution(problem, np.ones(7))
    assert [r.residual for r in solution.levels] == [r.residual for r in diagnose(problem, np.ones(7))]


def test_norm_neither_overflows_nor_underflows() -> None:
    assert norm(np.array([3e200, 4e200])) == pytest.approx(5e200, rel=1e-15)
    assert norm(np.array([3e-200, 4e-200])) == pytest.approx(5e-200, rel=1e-15)
    assert norm(np.zeros(0)) == 0.0
    assert norm(np.array([np.inf, 1.0])) == np.inf


@pytest.mark.parametrize("x", [np.zeros(6), np.full(7, np.nan), "nothing", None])
def test_bad_x(x: object) -> None:
    with pytest.raises(hqp_rp.ProblemError, match=r"x .*7 finite numbers"):
        diagnose(independent(0), x)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [-1e-3, np.nan, np.inf, True, "small"])
def test_bad_tolerance(value: object) -> None:
    with pytest.raises(hqp_rp.SettingError, match=r"rank_tolerance is .* finite number >= 0"):
        diagnose(badly_scaled(0), np.zeros(7), value)  # type: ignore[arg-type]
