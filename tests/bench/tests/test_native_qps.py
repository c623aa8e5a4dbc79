"""The QP cascade beside its own QPs: what is recorded is what was solved, and playing it again solves it again."""

from __future__ import annotations

import numpy as np
import pytest
from proxsuite import proxqp

from hqp_rp.core.problem import Level, Problem
from tests.bench.families import family
from tests.bench.native_qps import native_qps, play_and_compare, played, recorded


def test_the_tape_holds_the_qps_of_each_problem() -> None:
    original = proxqp.dense.QP
    problems = family("7_limits", quick=True).problems[:4]
    tapes = recorded(problems)
    assert proxqp.dense.QP is original
    assert len(tapes) == 4
    for tape in tapes:
        solves = [item for item in tape if item.results is not None]
        assert solves
        assert len(tape) > len(solves)  # each is updated before it is solved
        assert all(np.isfinite(item.answer).all() for item in solves)
        assert play_and_compare(tape) < 1e-7


def test_a_wrong_answer_is_seen() -> None:
    (tape,) = recorded(family("7_limits", quick=True).problems[:1])
    last = next(item for item in reversed(tape) if item.results is not None)
    last.answer[:] += 1.0
    assert play_and_compare(tape) > 0.1


def test_playing_makes_the_calls_in_order_and_sets_the_guesses_that_differ() -> None:
    from tests.bench.native_qps import _Call

    class Settings:
        initial_guess = ""

    settings, log = Settings(), []

    def solve(guess: str) -> _Call:
        return _Call(lambda: log.append(settings.initial_guess), object(), settings, guess, np.zeros(1))

    for call in played([[_Call(lambda: log.append("update")), solve("warm")], [solve("cold")]]):
        call()
    assert log == ["update", "warm", "cold"]
    log.clear()
    settings.initial_guess = "untouched"
    for call in played([[solve("warm")], [solve("warm")]]):
        call()
    assert log == ["untouched", "untouched"]


def test_cascade_and_qps_are_timed_side_by_side() -> None:
    (found,) = native_qps(["7_3-3"], quick=True, calls=8, budget=0.002)
    assert found.qps >= 1.0
    assert found.deviation < 1e-7
    assert found.times_slower.value == pytest.approx(found.cascade.median / found.native.median)


def test_a_problem_without_qps_has_an_empty_tape() -> None:
    met = Problem([Level(np.eye(3), -1.0, 1.0)])  # met where the descent starts
    assert [[item for item in tape if item.results is not None] for tape in recorded([met])] == [[]]
    (nothing,) = played([[]])
    nothing()
