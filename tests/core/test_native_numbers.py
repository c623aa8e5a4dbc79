"""What the native core says of numbers, whatever array they come in."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hqp_rp.core._native import is_finite, torque_within

NUMBERS = st.floats(allow_nan=True, allow_infinity=True, width=64)


@given(st.lists(NUMBERS, max_size=40))
def test_finite_as_numpy_has_it(numbers):
    assert is_finite(np.array(numbers)) == bool(np.isfinite(numbers).all())


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_finite_in_every_kind_of_array(value):
    array = np.arange(24.0).reshape(4, 6)
    for view in (array, array.T, array[::2, 1::3], array.astype(np.float32), array.astype(int), array.tolist(), 1e308):
        assert is_finite(view)
    array[3, 5] = value
    assert not is_finite(array)
    assert not is_finite(array.T)
    assert is_finite(array[:3])
    with pytest.raises((TypeError, ValueError)):
        is_finite("text")


@pytest.mark.parametrize("n", [0, 1, 7, 8, 62])
def test_torques_are_cut_and_read_only(n):
    rng = np.random.default_rng(n)
    T, x, offset, limit = (
        rng.normal(size=(5, n)),
        rng.normal(size=n),
        3.0 * rng.normal(size=5),
        rng.uniform(0.5, 2.0, 5),
    )
    found = torque_within(T, x, offset, limit)
    np.testing.assert_allclose(found, np.clip(T @ x + offset, -limit, limit), atol=1e-13)
    assert not found.flags.writeable
    np.testing.assert_array_equal(torque_within(T, np.repeat(x, 2)[::2], offset, limit), found)
    with pytest.raises(ValueError, match="fit"):
        torque_within(T, np.zeros(n + 1), offset, limit)
    with np.errstate(invalid="ignore"):
        assert torque_within(T, x, np.full(5, np.nan), limit) is None
    if n:
        assert torque_within(T, np.full(n, np.inf), offset, limit) is None
