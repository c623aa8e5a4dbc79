"""The speed at which a limit is approached: what it is in closed form, and that it needs no more than its deceleration."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hqp_rp.control._approach import Approach, braking_step

shares = st.floats(1e-3, 1.0)
distances = st.floats(0.0, 1e3)


@given(d=distances, share=shares, a=st.floats(1e-4, 10.0))
def test_every_step_is_at_most_a_shorter_than_the_one_before_and_none_passes_the_limit(d, share, a) -> None:
    before = None
    for _ in range(200):
        step = float(braking_step(np.array([d]), share, a)[0])
        assert 0.0 <= step <= d
        if before is not None:
            assert step <= before + 1e-9
            assert before - step <= a * (1.0 + 1e-9) + 1e-11 * before
        before, d = step, d - step


@given(near=distances, far=distances, share=shares, a=st.floats(1e-4, 10.0))
def test_the_step_grows_with_the_distance_and_is_no_more_than_its_share(near, far, share, a) -> None:
    near, far = sorted((near, far))
    steps = braking_step(np.array([near, far]), share, a)
    assert steps[0] <= steps[1] + 1e-9
    assert (steps <= share * np.array([near, far]) + 1e-9).all()
    np.testing.assert_array_equal(braking_step(np.array([near]), share, np.inf), share * near)


def test_the_continuous_form() -> None:
    approach, dt = Approach(2.0, 1.5, np.inf, "test"), 1e-5
    d = np.array([0.0, 0.1, 1.5 / 4, 0.5, 1.0, 10.0, np.inf])
    expected = np.where(4 * d <= 1.5, 2 * d, np.sqrt(np.maximum(2 * 1.5 * d - 1.5**2 / 4, 0.0)))
    np.testing.assert_allclose(approach.least_rate(d, dt), -expected, rtol=1e-4)
    np.testing.assert_allclose(approach.least_rate(-d, dt), expected, rtol=1e-4)
    assert Approach(2.0, 1.5, 0.7, "test").least_rate(np.array([-10.0]), dt)[0] == pytest.approx(0.7)
