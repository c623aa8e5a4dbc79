"""The logarithm of SO(3) against Rodrigues' formula, at every angle."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hqp_rp.control._rotations import nearest_rotation, quaternion_to_matrix, rotation_log, skew
from tests.control.chain import expm_so3, random_rotation

unit = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array).filter(lambda a: np.linalg.norm(a) > 1e-3)


@given(axis=unit, angle=st.floats(0, np.pi - 1e-6))
def test_log_inverts_exp(axis, angle):
    r = angle * axis / np.linalg.norm(axis)
    np.testing.assert_allclose(rotation_log(expm_so3(r)), r, atol=2e-15 + 1e-14 * angle)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-160, 1e-12, 1e-9, 1e-6])
def test_log_near_identity_is_the_skew_part(angle):
    axis = np.array([0.6, -0.64, 0.48])
    R = np.eye(3) + skew(angle * axis)  # exact to O(angle^2), which is below rounding for angle <= 1e-9
    np.testing.assert_allclose(rotation_log(R), angle * axis, rtol=1e-12, atol=1e-320)


@given(axis=unit, gap=st.sampled_from([0.0, 1e-15, 1e-12, 1e-9, 1e-7]))
def test_log_near_pi(axis, gap):
    axis = axis / np.linalg.norm(axis)
    r = rotation_log(expm_so3((np.pi - gap) * axis))
    assert np.linalg.norm(r) == pytest.approx(np.pi - gap, abs=1e-14)
    assert abs(abs(r @ axis) - (np.pi - gap)) < 1e-13


@pytest.mark.parametrize("axis", np.eye(3))
def test_log_at_pi_takes_the_positive_axis(axis):
    half_turn = 2.0 * np.outer(axis, axis) - np.eye(3)
    np.testing.assert_array_equal(rotation_log(half_turn), np.pi * axis)


def test_quaternion_order_is_wxyz():
    half = np.sqrt(0.5)
    np.testing.assert_allclose(
        quaternion_to_matrix(np.array([half, 0.0, 0.0, half])), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15
    )


@given(axis=unit, angle=st.floats(-np.pi, np.pi))
def test_quaternion_of_a_rotation_vector(axis, angle):
    axis = axis / np.linalg.norm(axis)
    quaternion = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
    np.testing.assert_allclose(quaternion_to_matrix(quaternion), expm_so3(angle * axis), atol=1e-14)


def test_nearest_rotation_removes_a_stretch():
    R = random_rotation(np.random.default_rng(1))
    np.testing.assert_allclose(nearest_rotation(R * (1 + 1e-7)), R, atol=1e-14)
