"""The kept answers are right, and the problems are as hard as they say."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from hqp_rp import certify, problems, truth
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.core.truth_exact import stacked_ranks

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
