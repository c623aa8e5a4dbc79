"""Rows turned by matrix products are the rows that reflectors turn one by one."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp.core.kernels.blocked import WORTHWHILE, turned_rows
from hqp_rp.core.kernels.orthogonal import lq


@pytest.mark.parametrize(("m", "d", "rows"), [(3, 7, 5), (12, 38, 60), (5, 5, 200), (0, 4, 3), (4, 9, 0)])
@pytest.mark.parametrize("turn", [False, True])
def test_many_rows_turn_as_the_factorization_turns_them(m: int, d: int, rows: int, turn: bool) -> None:
    rng = np.random.default_rng(m + d)
    L, R = rng.standard_normal((m, d)), rng.standard_normal((rows, d))
    both, origin = np.concatenate((L, R)), np.zeros(m)
    ref, tau = np.empty(m, np.int64), np.empty(m)
    lq(both, 0, m, 0, m + rows, origin, 0.0, 0, ref, ref.copy(), tau)
    r = lq(L, 0, m, 0, m, origin, 0.0, 0, ref, ref.copy(), tau)
    V = np.linalg.qr(rng.standard_normal((r, r)))[0] if turn else np.empty((0, 0))
    expected = both[m:].copy()
    if turn and r:
        expected[:, :r] = expected[:, :r] @ V
    before = R.copy()
    turned = turned_rows(R, L, r, tau, V)
    np.testing.assert_allclose(turned, expected, atol=1e-13)
    np.testing.assert_array_equal(R, before)
    np.testing.assert_allclose(turned @ turned.T, R @ R.T, atol=1e-12 * d)  # an orthogonal turn keeps every product


def test_both_ways_are_tested() -> None:
    assert 5 * 7 * 3 < WORTHWHILE < 60 * 38 * 12
