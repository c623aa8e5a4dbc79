"""A QP's answer refined on its active rows: exact where the rows are right, untouched where it cannot be improved."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp.core import _native
from hqp_rp.core.qp_backend import SlackQP, make_backend


def polish(qp: SlackQP, t: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`t`, `y` refined; the level's own rows are those of the curvature's square root."""
    n = len(t)
    root = np.sqrt(np.diag(qp.hessian)[:n])
    t, y = t.copy(), y.copy()
    _native.polish(np.diag(root), -qp.gradient[:n] / root, qp.rows, qp.lower, qp.upper, qp.soft, t, y)
    return t, y


def random_qp(seed: int) -> SlackQP:
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((7, 4))
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    centre = rows @ rng.standard_normal(4)
    hessian = np.array([1.0, 1.0, 0.25, 1.0])
    gradient = rng.standard_normal(4)
    bounds = centre - 0.2 * rng.random(7), centre + 0.2 * rng.random(7)
    return SlackQP.of(np.diag(hessian), gradient, rows, bounds, 3)


def gap(qp: SlackQP, t: np.ndarray, y: np.ndarray) -> float:
    """The largest violation of the optimality conditions of `qp`, slacks s = -y on the soft rows."""
    value = qp.rows @ t
    value[: qp.soft] -= y[: qp.soft]
    slack = np.where(y > 0, qp.upper - value, np.where(y < 0, value - qp.lower, 0.0))
    outside = value - np.clip(value, qp.lower, qp.upper)
    n = len(t)
    stationary = qp.hessian[:n, :n] @ t + qp.gradient[:n] + qp.rows.T @ y
    return float(max(np.abs(outside).max(), np.abs(y * slack).max(), np.abs(stationary).max()))


@pytest.mark.parametrize("seed", range(20))
def test_an_answer_near_the_optimum_becomes_exact(seed: int) -> None:
    qp = random_qp(seed)
    answer = make_backend("quadprog", 1e-9, 1000).solve(qp)
    rng = np.random.default_rng(seed)
    t = answer.t[:4] + 1e-9 * rng.standard_normal(4)
    y = answer.y * (1.0 + 1e-9 * rng.standard_normal(7))
    exact_t, exact_y = polish(qp, t, y)
    assert gap(qp, t, y) > 1e-11
    assert gap(qp, exact_t, exact_y) < 1e-12
    np.testing.assert_allclose(exact_t, answer.t[:4], atol=1e-8)


def test_a_wrong_active_row_changes_sides() -> None:
    # min 1/2 (t - 2)^2 with t <= 1, reported as held at t >= -1.
    qp = SlackQP.of(np.eye(1), np.array([-2.0]), np.ones((1, 1)), ([-1.0], [1.0]), 0)
    t, y = polish(qp, np.array([-1.0]), np.array([-3.0]))
    np.testing.assert_allclose((t[0], y[0]), (1.0, 1.0), atol=1e-14)
