"""What the native core says of numbers, whatever array they come in."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hqp_rp.core._native import finite_numbers, is_finite, take_configuration, torque_within

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


@given(st.lists(NUMBERS, max_size=20), st.integers(0, 20))
def test_a_finite_vector_is_taken_as_it_is_and_nothing_else_is(numbers, size):
    array = np.array(numbers)
    assert (finite_numbers(array, size) is array) == (len(numbers) == size and bool(np.isfinite(numbers).all()))


def test_other_numbers_become_a_vector_and_what_is_none_is_refused():
    wide = np.arange(12.0).reshape(3, 4)
    for given_, meant in (([1, 2, 3], [1, 2, 3]), (wide[:, 1], [1, 5, 9]), (np.float32([0.5, 0, 1]), [0.5, 0, 1])):
        found = finite_numbers(given_, 3)
        assert found.dtype == np.float64
        assert found.flags.c_contiguous
        np.testing.assert_array_equal(found, meant)
    for refused in (
        "abc",
        None,
        3.0,
        [[1.0, 2.0, 3.0]],
        [1.0, "x", 2.0],
        [1j, 0.0, 0.0],
        np.zeros((3, 1)),
        object(),
        np.zeros(3, object),
    ):
        assert finite_numbers(refused, 3) is None


def test_a_masked_array_becomes_a_plain_one_and_what_interrupts_is_not_swallowed():
    assert finite_numbers(np.zeros(3, object), 3) is None
    assert type(finite_numbers(np.ma.masked_array([1.0, 2.0]), 2)) is np.ndarray

    class Interrupting:
        def __array__(self, *_, **__):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        finite_numbers(Interrupting(), 2)


def test_a_configuration_is_copied_whole_or_not_at_all():
    places, out = np.array([1], dtype=np.int64), np.full(6, 7.0)
    q = np.array([0.5, 1.0, 0.0, 0.0, 0.0, -2.0])
    for refused in (
        q[:5],
        q.astype(np.float32),
        q.tolist(),
        None,
        np.repeat(q, 2)[::2],
        np.where(np.arange(6) == 5, np.nan, q),
        np.where(np.arange(6) == 0, np.inf, q),
        np.where(np.arange(6) == 1, 1e-9, q),
    ):
        assert not take_configuration(refused, out, places, 1e-10)
        np.testing.assert_array_equal(out, 7.0)
    assert take_configuration(q, out, places, 1e-10)
    np.testing.assert_array_equal(out, q)
    assert take_configuration(np.zeros(6), out, np.zeros(0, dtype=np.int64), 1e-10)
    fixed = np.zeros(6)
    fixed.flags.writeable = False
    with pytest.raises(TypeError, match="out must be writable"):
        take_configuration(q, fixed, places, 1e-10)
