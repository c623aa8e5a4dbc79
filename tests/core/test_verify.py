"""The quick verdict says what the certificate says; the proof of a contradiction is one."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import Level, Problem, certify, solve, truth
from hqp_rp.core._native import proven_optimal
from hqp_rp.core.verify import contradiction, fault_of, hard_excess
from tests.bench.families import family
from tests.problems import boxed, independent, over_constrained, two_sided

CASES = [
    two_sided(1),
    two_sided(2, box=0.2),
    two_sided(3, rows=(2, 2, 3)),
    boxed(independent(4), 0.3),
    over_constrained(5),
    over_constrained(6, rows=(3, 3, 7)),
    Problem([Level.equality(np.zeros((0, 3)), []), Level.equality(np.zeros((2, 3)), [1.0, 0.0])]),
]


@pytest.mark.parametrize("problem", CASES)
def test_the_proof_never_accepts_what_the_certificate_rejects(problem: Problem) -> None:
    rng = np.random.default_rng(0)
    zeta = np.linspace(-1.0, 1.0, problem.n)
    for secondary in (None, zeta):
        right = truth(problem, secondary).x
        proven = []
        for size in (0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3, 1e-1):
            x = right + size * rng.standard_normal(problem.n)
            free = np.zeros(problem.n) if secondary is None else secondary
            proof = proven_optimal(problem, x, free, 1e-7, 1e-12)
            verdict = certify(problem, x, secondary, tolerance=1e-7)
            assert verdict.ok or not proof
            assert fault_of(problem, x, secondary, 1e-7) == ("" if verdict.ok else verdict.sentence)
            proven.append(proof)
        assert proven[0]
        assert not proven[-1]


@pytest.mark.parametrize("name", ["7_limits", "humanoid_20", "humanoid_40"])
def test_at_a_tight_tolerance_with_many_active_rows(name: str) -> None:
    rng = np.random.default_rng(0)
    refused = 0
    for problem in family(name, quick=True).problems[:8]:
        right = solve(problem, "hierarchical_active_set").x
        for size in (0.0, 1e-11, 1e-10, 1e-9, 1e-8, 1e-6):
            x = right + size * np.linalg.norm(right) * rng.standard_normal(problem.n)
            proof = proven_optimal(problem, x, np.zeros(problem.n), 1e-9, 1e-12)
            assert not proof or certify(problem, x, tolerance=1e-9).ok
            assert proof or size >= 1e-10  # what rounding leaves needs no second opinion
            refused += not proof
    assert refused > 4


def test_hard_rows_are_on_top() -> None:
    problem = boxed(independent(0), 0.3)
    stacked = problem.with_hard
    np.testing.assert_array_equal(stacked.matrix[:7], np.eye(7))
    np.testing.assert_array_equal(stacked.offsets, [0, 7, 10, 13])
    np.testing.assert_array_equal(independent(0).with_hard.offsets, [0, 0, 3, 6])
    assert hard_excess(problem.hard, np.zeros(7)) == 0.0
    assert hard_excess(None, np.ones(7)) == 0.0
    x = np.zeros(7)
    x[2] = 0.6
    assert hard_excess(problem.hard, x) == pytest.approx(0.3 / 0.9)


def test_a_contradiction_needs_a_proof() -> None:
    def beside(hard: Level) -> Problem:
        return Problem([Level.equality(np.eye(2), np.zeros(2))], hard=hard)

    apart = Level([[1, 0], [0, 2], [2, 0]], [1, 0, -np.inf], [np.inf, 1, 1])
    assert "Hard rows 0, 2 contradict each other" in contradiction(beside(apart), np.array([0.75, 0.2]))
    assert "Hard rows 0, 2 contradict each other" in contradiction(beside(apart), np.array([5.0, 9.0]))  # wherever x is
    assert contradiction(beside(Level(np.eye(2), 0, 1)), np.array([0.5, 0.5])) == ""
    assert contradiction(beside(Level(np.eye(2), 0, 1)), np.array([2.0, 0.5])) == ""
    assert "Hard row 1 is a row of zeros" in contradiction(beside(Level([[1, 0], [0, 0]], 1, 2)), np.zeros(2))
