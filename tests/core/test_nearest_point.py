"""The certificate's own least-squares search: against a QP solver, and where only one point is left."""

from __future__ import annotations

import numpy as np
import pytest
import qpsolvers

from hqp_rp.core.diagnostics import one_sided
from hqp_rp.core.nearest_point import nearest_point


@pytest.mark.parametrize("seed", range(30))
def test_against_a_qp_solver(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 7)), int(rng.integers(0, 12))
    x, A = rng.standard_normal(n), rng.standard_normal((m, n))
    lower, upper = A @ x - rng.uniform(0, 1, m), A @ x + rng.uniform(0, 1, m)
    lower[rng.random(m) < 0.3] = -np.inf
    Z = np.linalg.qr(rng.standard_normal((n, n)))[0][:, : int(rng.integers(1, n + 1))]
    B, c = rng.standard_normal((Z.shape[1] + 2, Z.shape[1])), rng.standard_normal(Z.shape[1] + 2)
    G, h, rows, sides = one_sided(A, lower, upper)
    assert (np.where(sides > 0, upper[rows], -lower[rows]) < np.inf).all()
    found = nearest_point(x, Z, G, h, B, c)
    assert (G @ found <= h + 1e-12).all()
    y = qpsolvers.solve_qp(
        B.T @ B, B.T @ c, G @ Z if len(G) else None, h - G @ x if len(G) else None, solver="quadprog"
    )
    np.testing.assert_allclose(found, x + Z @ y, atol=1e-9)


def test_where_one_point_is_left() -> None:
    G, h = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]), np.array([0.3, -0.3, 0.1, -0.1])
    x = np.array([0.3, 0.1])
    np.testing.assert_array_equal(nearest_point(x, np.eye(2), G, h, np.eye(2), x), x)


def test_one_bound_a_row() -> None:
    found = one_sided(
        np.array([[3.0, 4.0], [0.0, 0.0], [0.0, 2.0]]), np.array([-5.0, 0.0, 1.0]), np.array([10.0, 1.0, np.inf])
    )
    np.testing.assert_allclose(found.G, [[0.6, 0.8], [-0.6, -0.8], [0.0, -1.0]])
    np.testing.assert_allclose(found.h, [2.0, 1.0, -0.5])
    assert found.rows.tolist() == [0, 0, 2]
    assert found.sides.tolist() == [1, -1, -1]
