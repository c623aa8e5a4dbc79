"""The kept answers are right, and the problems are as hard as they say."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from hqp_rp import ConstantDamping, ErrorDamping, Level, Problem, ProblemError, certify, problems, truth
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.truth_exact import stacked_ranks
from hqp_rp.problems.exact import damped_answer
from hqp_rp.problems.robots import TORQUE_STATES

KNOWN = {name: problems.load(name) for name in problems.names()}
CLEAR = {name: known for name, known in KNOWN.items() if known.feasible and not known.ambiguous}


def test_the_certificate_accepts_every_answer() -> None:
    for name, known in CLEAR.items():
        verdict = certify(known.problem, known.exact.x)
        assert verdict.ok, f"{name}: {verdict.sentence}"


def test_the_certificate_accepts_the_rule_s_answer_of_ambiguous_problems() -> None:
    for known in (known for known in KNOWN.values() if known.ambiguous):
        verdict = certify(known.problem, known.rule.x)
        assert verdict.ok, f"{known.name}: {verdict.sentence}"


def test_a_wrong_answer_is_refused() -> None:
    rng = np.random.default_rng(0)
    for name, known in CLEAR.items():
        if known.distance is None:
            step = rng.standard_normal(known.problem.n)
            off = known.exact.x + 1e-4 * np.linalg.norm(known.exact.x) * step / np.linalg.norm(step)
            assert not certify(known.problem, off).ok, name


def test_residuals_are_those_of_the_answer() -> None:
    for name, known in CLEAR.items():
        for level, kept in zip(known.problem.levels, known.exact.residuals, strict=True):
            value = level.A @ known.exact.x
            found = np.linalg.norm(value - np.clip(value, level.lower, level.upper))
            size = np.linalg.norm(level.A) * np.linalg.norm(known.exact.x)
            assert found == pytest.approx(kept, rel=1e-9, abs=1e-13 * size), f"{name} {level.name}"


def test_equalities_are_what_the_truth_says() -> None:
    for name, known in KNOWN.items():
        if known.problem.damping is not None:
            continue  # truth rounds what a damped level reached
        if known.problem.is_equality and known.problem.hard is None and known.problem.n <= 14:
            right = truth(known.problem)
            assert right.x.tobytes() == known.exact.x.tobytes(), name
            assert right.residuals.tobytes() == known.exact.residuals.tobytes(), name
            assert (
                right.ranks == known.exact.ranks == stacked_ranks([a.A for a in known.problem.levels], known.problem.n)
            )
            assert right.ambiguous == known.ambiguous


SEARCHED = [name for name in problems.names("inequality") if KNOWN[name].problem.n <= 7]


@pytest.mark.parametrize("name", [*SEARCHED, "hard_rows/n7_3-3_mixed", "sawyer/3-3-7_limits_q0"])
@pytest.mark.parametrize("guess", ["right", "zero"])
def test_a_proof_from_a_guess_is_the_search_s_answer(name: str, guess: str) -> None:
    known = KNOWN[name]
    searched = truth(known.problem)
    found = truth(known.problem, start=known.exact.x if guess == "right" else np.zeros(known.problem.n))
    assert found.x.tobytes() == searched.x.tobytes() == known.exact.x.tobytes()
    assert found.ranks == searched.ranks
    np.testing.assert_array_equal(found.residuals, searched.residuals)


def test_no_answer_where_there_is_none() -> None:
    for name in problems.names("infeasible"):
        problem = KNOWN[name].problem
        assert not truth(problem).feasible, name
        assert not truth(problem, start=np.zeros(7)).feasible, name


@pytest.mark.parametrize("guess", ["right", "zero"])
def test_the_rule_s_answer_does_not_depend_on_the_guess(guess: str) -> None:
    for name in ("hard_rows/n7_3-3_box", "sawyer/3-7-3_band_q0"):
        known = KNOWN[name]
        right = known.exact if known.rule is None else known.rule
        start = right.x if guess == "right" else np.zeros(7)
        found = truth(known.problem, rank_rule=RANK_TOLERANCE, start=start)
        assert found.x == pytest.approx(right.x, abs=1e-12), name
        assert found.ambiguous == known.ambiguous, name


@pytest.mark.parametrize("name", [*problems.names("barely_feasible"), *problems.names("infeasible")[:5]])
def test_hard_rows_meet_or_contradict_each_other_by_the_stated_distance(name: str) -> None:
    known = KNOWN[name]
    A, upper = known.problem.hard.A, known.problem.hard.upper
    weights = np.rint(np.linalg.lstsq(A[:3].T, -A[3], rcond=None)[0])
    assert weights.min() >= 1.0
    np.testing.assert_array_equal(weights @ A[:3] + A[3], 0.0)
    # sum w_i (a_i x) + a_4 x = 0 for every x, so the bounds leave room just when this sum is not negative.
    room = sum(Fraction(w) * Fraction(u) for w, u in zip([*weights, 1.0], upper, strict=True))
    assert room == (Fraction(known.distance) if known.feasible else -Fraction(known.distance))


@pytest.mark.parametrize("name", problems.names("near_singular"))
def test_random_problems_are_at_the_stated_distance_from_a_singularity(name: str) -> None:
    known = KNOWN[name]
    assert sum(known.exact.ranks) == 7 if "3-3-7" in name or "own" in name else known.exact.ranks == (3, 3)
    first, second = (level.A for level in known.problem.levels[:2])
    if "own" in name:
        sigma = np.linalg.svd(first, compute_uv=False)[-1]
    else:
        sigma = np.linalg.svd(second @ np.linalg.svd(first)[2][3:].T, compute_uv=False)[-1]
    rounding = 1e-14  # of the singular values, which are computed in floating point
    assert 0.02 * known.distance - rounding < sigma < 5.0 * known.distance + rounding


def test_exact_ranks_leave_less_where_the_rule_cuts() -> None:
    for name in problems.names("near_singular"):
        known = KNOWN[name]
        if known.ambiguous:
            cut = next(k for k in range(known.problem.p) if known.exact.ranks[k] != known.rule.ranks[k])
            assert known.exact.ranks[cut] > known.rule.ranks[cut]
            assert known.exact.residuals[cut] < known.rule.residuals[cut]
            assert np.linalg.norm(known.exact.x) > np.linalg.norm(known.rule.x)


def test_damped_answers_are_the_truth_but_for_its_rounding() -> None:
    for name in problems.names("damped"):
        known = KNOWN[name]
        right = truth(known.problem)
        gap = np.linalg.norm(right.x - known.exact.x) / (1.0 + np.linalg.norm(known.exact.x))
        assert gap <= 1e-15 / (known.distance or 1.0) + 1e-14, name
        assert right.ranks == known.exact.ranks, name


def test_exact_damping_of_one_level_is_its_formula() -> None:
    # A = [2 0; 0 1], b = (1, 1), eta = 1/2: x_i = sigma_i b_i / (sigma_i^2 + eta^2).
    level = Level.equality(np.diag([2.0, 1.0]), [1.0, 1.0], damping=ConstantDamping(0.5))
    found = damped_answer(Problem([level]))
    assert found.x.tolist() == [2.0 / 4.25, 1.0 / 1.25]
    assert found.residuals == pytest.approx([np.hypot(1.0 - 4.0 / 4.25, 1.0 - 1.0 / 1.25)], rel=1e-15)
    # What a damped level reached, a later one keeps; the freedom left is as large as without damping.
    later = Level.equality([[1.0, 1.0, 1.0]], [3.0])
    first = Level.equality([[2.0, 0.0, 0.0]], [1.0], damping=ConstantDamping(1.0))
    found = damped_answer(Problem([first, later]))
    assert found.x == pytest.approx([0.4, 1.3, 1.3], rel=1e-15)
    assert found.ranks == (1, 1)


def test_damping_beside_what_is_not_exact_is_refused() -> None:
    level = Level.equality(np.eye(2), [1.0, 1.0], damping=ConstantDamping(0.5))
    with pytest.raises(ProblemError, match=r"take hqp_rp\.truth"):
        damped_answer(Problem([level], hard=Level(np.eye(2), -1.0, 1.0)))
    with pytest.raises(ProblemError, match="ConstantDamping"):
        damped_answer(Problem([Level.equality(np.eye(2), [1.0, 1.0], damping=ErrorDamping(1.0))]))


def test_the_metric_decides_what_the_levels_leave() -> None:
    for name in problems.names("metric"):
        known = KNOWN[name]
        W, x = known.problem.metric, known.exact.x
        if known.problem.hard is None:
            # W x is a combination of the rows: no move in the null space makes x^T W x smaller.
            Z = np.linalg.svd(known.problem.matrix)[2][sum(known.exact.ranks) :].T
            assert Z.shape[1] > 0, name
            assert np.linalg.norm(Z.T @ W @ x) <= 1e-12 * np.linalg.norm(W) * np.linalg.norm(x), name
        plain = truth(Problem(list(known.problem.levels), known.problem.hard))
        if known.problem.hard is None:
            assert np.linalg.norm(plain.x - x) > 1e-3 * np.linalg.norm(x), name


def test_torque_limits_bind_and_cost_something() -> None:
    for i in range(TORQUE_STATES):
        free, limited = (KNOWN[f"torque/sawyer_3-3-7_{kind}_s{i}"] for kind in ("free", "limits"))
        assert free.exact.residuals[0] < 1e-9 < limited.exact.residuals[1]
        hard = limited.problem.hard
        torque = hard.A @ limited.exact.x
        assert np.isclose(torque, hard.lower).any() or np.isclose(torque, hard.upper).any()
        assert ((hard.lower < 0.0) & (hard.upper > 0.0)).all(), "standing still is within the limits"
