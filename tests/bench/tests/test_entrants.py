"""Who takes part in the benchmark, how answers are judged, and a whole control step."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

import hqp_rp
from tests.bench.accuracy import judge, references
from tests.bench.entrants import numpy_cascade, our_entrants, peer_entrants
from tests.bench.families import family, random_problem
from tests.bench.steps import step_family, steppers


def test_every_solver_takes_part() -> None:
    settings = " ".join(item.settings for item in our_entrants())
    for kind in hqp_rp.all_solvers().values():
        assert kind.__name__ in settings


def test_a_missing_peer_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    found, missing = peer_entrants(["daqp"])
    assert found == []
    assert missing == [
        "daqp is not installed, so it takes no part (pip install daqp, or in an environment of its own and --peer-python PATH)."
    ]


def test_peers_solve_the_problem_that_they_are_given() -> None:
    peers, missing = peer_entrants()
    assert missing == []
    problems = [random_problem(np.random.default_rng(i), 7, (3, 3)) for i in range(2)]
    for peer in peers:
        found = judge(problems, peer.prepare(problems), peer.answer, references(problems))
        assert found.ok, (peer.label, found)
        assert found.distance < 1e-5
    limited = family("7_limits", quick=True).problems[:3]
    accurate = next(peer for peer in peers if peer.label == "DAQP, accurate")
    found = judge(limited, accurate.prepare(limited), accurate.answer, references(limited))
    assert found.ok
    assert found.distance < 1e-6
    numpy_peer = next(peer for peer in peers if peer.label == "numpy SVD cascade")
    assert numpy_peer.refuses(limited[0]) == "It solves equalities only."


def test_the_numpy_cascade_is_the_optimum() -> None:
    problem = random_problem(np.random.default_rng(5), 7, (6, 1, 7))
    x = numpy_cascade([(level.A, level.lower) for level in problem.levels])
    assert x == pytest.approx(hqp_rp.solve(problem, "null_space").x, abs=1e-10)


def test_wrong_answers_and_missing_ones_are_not_certified() -> None:
    problems = [random_problem(np.random.default_rng(i), 7, (3, 3)) for i in range(2)]
    right = hqp_rp.solve(problems[0], "null_space").x
    found = judge(problems, [lambda: right, lambda: None], lambda x: x, references(problems))
    assert (found.asked, found.answered, found.certified, found.ok) == (2, 1, 1, False)
    assert found.fault == "There is no answer."
    wrong = judge(problems[:1], [lambda: np.zeros(7)], lambda x: x, references(problems))
    assert wrong.certified == 0
    assert wrong.error > 0.1
    assert "level 1" in wrong.fault


def test_a_control_step_of_ours_and_of_mink() -> None:
    made = step_family("step_sawyer", quick=True)
    found, missing = steppers(made, ["mink"])
    assert missing == []
    answers = {item.label: item.answer(item.calls[3]()) for item in found}
    x = answers["null space"]
    assert x is not None
    assert x == pytest.approx(answers["active set, cold"], abs=1e-9)
    # Weights in place of priorities: near, and not the same.
    assert answers["mink daqp"] == pytest.approx(answers["null space, mink's tasks"], abs=0.05)
    assert hqp_rp.certify(found[0].problems[3], x).ok
