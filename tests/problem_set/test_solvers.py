"""Every solver on the whole set: right where it says solved, honest where it is not."""

from __future__ import annotations

import numpy as np
import pytest

import hqp_rp
from hqp_rp import Status, certify, get_solver, problems

KNOWN = {name: problems.load(name) for name in problems.names()}
PLAIN = 2.0**-10
"""Hard rows that contradict each other by at least this are no matter of tolerance."""


@pytest.mark.parametrize("label", hqp_rp.all_solvers())
def test_solver_on_the_set(label: str) -> None:
    solver = get_solver(label)
    solved = []
    for name, known in KNOWN.items():
        solver.reset()
        solution = solver.solve(known.problem)
        refusal = solver.refuses(known.problem)
        assert (solution.status is Status.REFUSED) == (refusal is not None), name
        if refusal is not None:
            continue
        if not known.feasible:
            plain = known.distance is None or known.distance >= PLAIN
            assert not (plain and solution.status.ok), f"{name}: solved, and its hard rows contradict each other"
        elif known.distance is None or known.distance > solver.tolerance:
            assert solution.status is not Status.INFEASIBLE, f"{name}: {solution.message}"
        if not solution.status.ok:
            assert solution.message, name
            continue
        solved.append(name)
        assert np.isfinite(solution.x).all(), name
        verdict = certify(known.problem, solution.x, tolerance=solver.tolerance)
        assert verdict.relative_hard_violation <= solver.tolerance, f"{name}: {verdict.sentence}"
        if known.feasible and not known.ambiguous and solver.is_lexicographic(known.problem):
            assert verdict.ok, f"{name}: {verdict.sentence}"
            if known.distance is None:
                gap = np.linalg.norm(solution.x - known.exact.x) / (1.0 + np.linalg.norm(known.exact.x))
                assert gap <= 1e3 * solver.tolerance, name
    assert set(problems.names("independent")) <= set(solved), "what every method solves"


@pytest.mark.parametrize("label", hqp_rp.all_solvers())
def test_lexicographic_solver_gives_one_of_the_two_answers(label: str) -> None:
    solver = get_solver(label)
    for known in (known for known in KNOWN.values() if known.ambiguous):
        solver.reset()
        solution = solver.solve(known.problem)
        if not (solution.status.ok and solver.is_lexicographic(known.problem)):
            continue
        near = min(np.linalg.norm(solution.x - answer.x) / (1.0 + np.linalg.norm(answer.x)) for answer in known.answers)
        judged = certify(known.problem, solution.x, tolerance=solver.tolerance)
        # So near to a singularity x itself is lost to rounding; what it does to the levels is not.
        assert judged.ok or near <= 1e-6, f"{known.name}: {judged.sentence}"
