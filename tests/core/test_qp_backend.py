"""The QP back ends on QPs whose answers are known by hand, cold, warm and with kept workspaces."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import SettingError
from hqp_rp.core.qp_backend import Outcome, QPAnswer, SlackQP, check_backend, installed_backends, make_backend

INF = np.inf
BACKENDS = ("proxqp", "osqp", "daqp", "quadprog", "piqp")


def qp(hessian, gradient, rows, lower, upper, soft) -> SlackQP:
    arrays = [np.array(a, dtype=float) for a in (hessian, gradient)]
    matrix = np.array(rows, dtype=float).reshape(-1, len(arrays[0]))
    return SlackQP.of(np.diag(arrays[0]), arrays[1], matrix, (lower, upper), soft)


def stationarity(problem: SlackQP, answer: QPAnswer) -> float:
    residual = problem.hessian @ answer.t + problem.gradient + problem.slack_rows.T @ answer.y
    return float(np.abs(residual).max())


# min 1/2 |t|^2 - t0 - t1, t0 <= 0.25: t = (0.25, 1), multiplier 0.75.
ACTIVE = qp([1, 1], [-1, -1], [[1, 0]], [-INF], [0.25], 0)
# min 1/2 t^2 + 1/2 s^2, 2 <= t + s: t = s = 1, multiplier -1.
SOFT = qp([1], [0], [[1]], [2], [INF], 1)
# No curvature in t1; t0 + t1 >= 3 with t1 <= 2 forces t0 = 1.
FLAT = qp([1, 0], [0, 0], [[1, 1], [0, 1]], [3, -INF], [INF, 2], 0)


@pytest.mark.parametrize("name", BACKENDS)
def test_answers_and_multipliers_known_by_hand(name: str) -> None:
    backend = make_backend(name, 1e-9, 4000)
    for problem, t, y in ((ACTIVE, [0.25, 1], [0.75]), (SOFT, [1], [-1]), (FLAT, [1, 2], [-1, 1])):
        answer = backend.solve(problem)
        assert answer.outcome is Outcome.CONVERGED, answer.message
        np.testing.assert_allclose(answer.t[: len(t)], t, atol=1e-7)
        np.testing.assert_allclose(answer.y, y, atol=1e-7)
        assert stationarity(problem, answer) < 1e-7


@pytest.mark.parametrize("name", BACKENDS)
def test_without_rows_the_answer_is_the_negative_gradient(name: str, capfd: pytest.CaptureFixture[str]) -> None:
    g = np.array([0.5, -0.25, 0.75])
    answer = make_backend(name, 1e-9, 4000).solve(qp([1, 1, 1], g, [], [], [], 0))
    np.testing.assert_allclose(answer.t, -g, atol=1e-9)
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize("name", ["proxqp", "osqp"])
def test_a_kept_workspace_and_a_guess_change_no_answer(name: str) -> None:
    rng = np.random.default_rng(0)
    kept = make_backend(name, 1e-9, 4000)
    guess = None
    for _ in range(20):
        rows = rng.standard_normal((5, 3))
        centre = rows @ rng.standard_normal(3)
        problem = qp(np.ones(3), rng.standard_normal(3), rows, centre - 0.1, centre + 0.1, 2)
        if guess is not None:
            problem = problem._replace(start=guess[0], y=guess[1])
        warm = kept.solve(problem, guess is not None)
        cold = make_backend(name, 1e-9, 4000).solve(problem)
        assert warm.outcome is cold.outcome is Outcome.CONVERGED
        np.testing.assert_allclose(warm.t, cold.t, atol=1e-7)
        guess = (warm.t.copy(), warm.y.copy())
    assert kept.reused
    kept.reset()
    kept.solve(problem)
    assert not kept.reused


@pytest.mark.parametrize("name", ["proxqp", "osqp"])
def test_too_few_iterations_are_reported(name: str) -> None:
    rng = np.random.default_rng(1)
    rows = rng.standard_normal((12, 6))
    problem = qp(np.ones(6), 10.0 * rng.standard_normal(6), rows, np.full(12, -0.1), np.full(12, 0.1), 0)
    answer = make_backend(name, 1e-9, 1).solve(problem)
    assert answer.outcome is Outcome.LIMIT
    assert answer.message


def test_nan_from_a_back_end_is_a_failure_and_leaves_no_trace() -> None:
    backend = make_backend("proxqp", 1e-9, 100)
    bad = qp([1, 1], [np.nan, 0], [[1, 0]], [-1], [1], 0)
    assert backend.solve(bad).outcome is Outcome.FAILED
    np.testing.assert_allclose(backend.solve(ACTIVE).t, [0.25, 1], atol=1e-7)


def test_osqp_writes_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    backend = make_backend("osqp", 1e-9, 4000)
    for problem in (ACTIVE, SOFT, FLAT, qp([1], [0], [[1]], [-1], [1], 0)):
        backend.solve(problem)
    assert capfd.readouterr().out == ""


def test_an_unknown_back_end_lists_the_installed_ones() -> None:
    assert set(BACKENDS) <= set(installed_backends())
    with pytest.raises(SettingError, match=r"backend is 'gurobbi'.*installed: daqp, .*proxqp"):
        check_backend("gurobbi")
