"""The closed-form kinematics of a DH arm, its links, and the two arms of the library."""

import dataclasses
import math

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import HqpError, RobotError
from hqp_rp.robot import DHArm, planar_arm, sawyer
from hqp_rp.robot.dh import capsule_inertia
from tests.robot.models import ARMS

seeds = st.integers(0, 2**32 - 1)


def random_arm(rng: np.random.Generator, n: int) -> DHArm:
    return DHArm(
        name="random",
        d=tuple(rng.normal(size=n)),
        a=tuple(rng.normal(size=n)),
        alpha=tuple(rng.uniform(-3.0, 3.0, n)),
        lower=(-3.0,),
        upper=(3.0,),
        velocity_limit=(1.0,),
        mass=(1.0,),
        radius=(0.1,),
    )


def dh_matrix(theta: float, d: float, a: float, alpha: float) -> np.ndarray:
    """The textbook matrix of one row, written out: Siciliano et al. 2009, (2.52)."""
    c, s, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0.0, sa, ca, d], [0.0, 0.0, 0.0, 1.0]])


@given(seed=seeds, n=st.integers(1, 8))
@settings(max_examples=50, deadline=None)
def test_pose_is_the_product_of_the_textbook_matrices(seed, n):
    rng = np.random.default_rng(seed)
    arm, q = random_arm(rng, n), rng.uniform(-3.0, 3.0, n)
    expected = np.eye(4)
    for i in range(n):
        rotation, origin = arm.pose(q, f"link{i + 1}")
        np.testing.assert_allclose(origin, expected[:3, 3], atol=1e-12)
        np.testing.assert_allclose(rotation[:, 2], expected[:3, 2], atol=1e-12)  # the joint's axis is z of frame i-1
        expected = expected @ dh_matrix(q[i], arm.d[i], arm.a[i], arm.alpha[i])
    rotation, origin = arm.pose(q)
    np.testing.assert_allclose(rotation, expected[:3, :3], atol=1e-12)
    np.testing.assert_allclose(origin, expected[:3, 3], atol=1e-12)


@given(seed=seeds, n=st.integers(1, 8))
@settings(max_examples=50, deadline=None)
def test_jacobian_is_the_derivative_of_the_pose(seed, n):
    rng = np.random.default_rng(seed)
    arm, q = random_arm(rng, n), rng.uniform(-3.0, 3.0, n)
    step = 1e-5
    for frame in arm.frame_names:
        jacobian, rotation = arm.jacobian(q, frame), arm.pose(q, frame)[0]
        for k in range(n):
            offset = step * np.eye(n)[k]
            (r1, p1), (r0, p0) = arm.pose(q + offset, frame), arm.pose(q - offset, frame)
            spin = (r1 - r0) @ rotation.T / (2.0 * step)
            np.testing.assert_allclose(jacobian[:3, k], (p1 - p0) / (2.0 * step), atol=1e-7)
            np.testing.assert_allclose(jacobian[3:, k], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-7)


@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: arm.name)
def test_many_configurations_at_once_equal_one_at_a_time(arm):
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (4, 5, arm.n))
    for frame in arm.frame_names:
        rotations, origins = arm.pose(q, frame)
        jacobians = arm.jacobian(q, frame)
        assert rotations.shape == (4, 5, 3, 3)
        assert origins.shape == (4, 5, 3)
        assert jacobians.shape == (4, 5, 6, arm.n)
        for index in np.ndindex(4, 5):
            np.testing.assert_array_equal(rotations[index], arm.pose(q[index], frame)[0])
            np.testing.assert_array_equal(origins[index], arm.pose(q[index], frame)[1])
            np.testing.assert_array_equal(jacobians[index], arm.jacobian(q[index], frame))


def test_no_configuration_at_all_is_legal():
    assert sawyer().jacobian(np.zeros((0, 7))).shape == (0, 6, 7)


def test_planar_arm_has_the_formula_of_its_docstring():
    arm = planar_arm(4, (0.5, 0.4, 0.3, 0.2))
    q = np.array([0.3, -0.7, 1.1, 0.2])
    absolute = np.cumsum(q)
    expected = [arm.a @ np.cos(absolute), arm.a @ np.sin(absolute), 0.0]
    np.testing.assert_allclose(arm.pose(q)[1], expected, atol=1e-15)
    np.testing.assert_array_equal(arm.jacobian(q)[[2, 3, 4]], 0.0)
    np.testing.assert_array_equal(arm.jacobian(q)[5], 1.0)


def test_sawyer_is_the_one_of_the_paper():
    arm = sawyer()
    half = math.pi / 2.0
    rows = np.column_stack([arm.d, arm.a, arm.alpha])
    expected = [
        [0.317, -0.081, -half],
        [-0.1925, 0.0, half],
        [0.4, 0.0, -half],
        [-0.1685, 0.0, half],
        [0.4, 0.0, -half],
        [-0.1363, 0.0, half],
        [0.13375, 0.0, half],
    ]
    np.testing.assert_array_equal(rows, expected)
    assert set(arm.lower) == {-math.pi}
    assert set(arm.upper) == {math.pi}
    assert arm.total_mass == pytest.approx(11.0, abs=1e-12)
    assert sawyer(total_mass=5.0).total_mass == pytest.approx(5.0)
    assert arm.velocity_limit == (1.74, 1.328, 1.957, 1.957, 3.485, 3.485, 4.545)


def test_sawyer_in_the_distal_convention_stands_as_the_robot_does():
    arm = sawyer()
    rotation, origin = arm.pose(np.zeros(7), "link1")
    np.testing.assert_array_equal(rotation[:, 2], [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(origin, 0.0)
    rotation, origin = arm.pose(np.zeros(7), "link2")
    assert rotation[2, 2] == pytest.approx(0.0, abs=1e-15)
    assert origin[2] == 0.317
    assert math.hypot(origin[0], origin[1]) == pytest.approx(0.081)


# Origins of right_j0 ... right_j6 in the link before, of Rethink Robotics' sawyer_description: m, and quaternions w, x, y, z.
_ROOT = math.sqrt(0.5)
_TEN = math.radians(10.0) / 2.0
_RETHINK = (
    ((0.0, 0.0, 0.08), (1.0, 0.0, 0.0, 0.0)),
    ((0.081, 0.05, 0.237), (0.5, -0.5, 0.5, 0.5)),
    ((0.0, -0.14, 0.1425), (_ROOT, _ROOT, 0.0, 0.0)),
    ((0.0, -0.042, 0.26), (_ROOT, -_ROOT, 0.0, 0.0)),
    ((0.0, -0.125, -0.1265), (_ROOT, _ROOT, 0.0, 0.0)),
    ((0.0, 0.031, 0.275), (_ROOT, -_ROOT, 0.0, 0.0)),
    (
        (0.0, -0.11, 0.1053),
        (math.sin(_TEN) * _ROOT, math.sin(_TEN) * _ROOT, -math.cos(_TEN) * _ROOT, math.cos(_TEN) * _ROOT),
    ),
)


def rethink(q):
    """Orientation and origin of right_l6 at the manufacturer's joints q (7,)."""
    R, p = np.eye(3), np.zeros(3)
    for (origin, quaternion), angle in zip(_RETHINK, q, strict=True):
        p = p + R @ np.array(origin)
        turned = np.empty(9)
        mujoco.mju_quat2Mat(turned, np.array(quaternion))
        c, s = math.cos(angle), math.sin(angle)
        R = R @ turned.reshape(3, 3) @ np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))
    return R, p


def test_table_1_is_the_chain_of_the_manufacturer():
    arm, rng = sawyer(), np.random.default_rng(0)
    sign = np.array((1, -1, 1, 1, 1, -1, 1))
    zero = math.pi * np.array((1.0, 1.5, 1.0, 0.0, 1.0, 0.0, 0.0))
    turns = []
    for q in rng.uniform(-3.0, 3.0, (20, 7)):
        R, p = rethink(q)
        own_R, own_p = arm.pose(zero + sign * q, "tool")
        np.testing.assert_allclose(own_p + own_R @ (0.0, -0.02375, 0.0), p, atol=1e-14)
        turns.append(own_R.T @ R)
    np.testing.assert_allclose(turns, [turns[0]] * 20, atol=1e-14)


def test_sawyer_neutral_is_what_its_docstring_says():
    arm = sawyer()
    rotation, origin = arm.pose(arm.neutral)
    np.testing.assert_allclose(origin, [0.45275, -0.4973, 0.7172], atol=2e-4)
    np.testing.assert_allclose(rotation[:, 1], [1.0, 0.0, 0.0], atol=1e-12)  # y of the tool is z of joint 7
    sigma = np.linalg.svd(arm.jacobian(arm.neutral), compute_uv=False)
    assert sigma[-1] == pytest.approx(0.187, abs=5e-4)


def test_capsule_inertia_is_the_integral_over_its_volume():
    mass, radius, axis = 2.0, 0.3, np.array([0.3, -0.5, 0.4])
    unit, half = axis / np.linalg.norm(axis), 0.5 * float(np.linalg.norm(axis))
    count = 120
    grid = np.linspace(-half - radius, half + radius, count, endpoint=False) + (half + radius) / count
    points = np.stack(np.meshgrid(grid, grid, grid), axis=-1).reshape(-1, 3)
    along = np.clip(points @ unit, -half, half)
    points = points[np.linalg.norm(points - along[:, None] * unit, axis=1) <= radius]
    second = points.T @ points * (mass / len(points))
    expected = np.trace(second) * np.eye(3) - second
    np.testing.assert_allclose(capsule_inertia(mass, radius, axis), expected, atol=2e-3 * np.trace(expected))


def test_a_capsule_without_length_is_a_sphere():
    np.testing.assert_allclose(capsule_inertia(2.0, 0.3, np.zeros(3)), 0.4 * 2.0 * 0.09 * np.eye(3), rtol=1e-15)


def test_an_arm_is_plain_data():
    assert sawyer() == sawyer()
    assert hash(sawyer()) == hash(sawyer())
    assert dataclasses.replace(sawyer(), neutral=(0.0,)).neutral == (0.0,) * 7
    with pytest.raises(dataclasses.FrozenInstanceError):
        sawyer().d = (1.0,)  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        sawyer().links[0].inertia[0, 0] = 1.0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: planar_arm(0), "n_joints is 0; it must be an integer of at least 1."),
        (lambda: planar_arm(2, (1.0, 2.0, 3.0)), r"link_length is \(1.0, 2.0, 3.0\); it must be one number > 0, or 2"),
        (lambda: planar_arm(2, -1.0), "link_length is -1.0"),
        (lambda: planar_arm(2, link_mass=0.0), "arm 'planar2': mass of joint 1 is 0; it must be > 0."),
        (lambda: planar_arm(2, velocity_limit=(1.0, 2.0, 3.0)), "velocity_limit has 3 numbers; it must have 2."),
        (lambda: planar_arm(2, radius=math.nan), "radius is .*; every number must be finite."),
        (lambda: planar_arm(2, gravity=(0.0,)), "gravity has 1 numbers; it must have 3."),
        (lambda: sawyer(-1.0), "mass of joint 1 is .*; it must be > 0."),
        (
            lambda: dataclasses.replace(sawyer(), neutral=(4.0,)),
            "joint 1 has lower -3.14159, neutral 4, upper 3.14159; it must hold that lower <= neutral <= upper.",
        ),
        (lambda: dataclasses.replace(sawyer(), d=("x",) * 7), "d is .*; it must be numbers."),
        (lambda: dataclasses.replace(sawyer(), d=(), a=(), alpha=()), "has no joint"),
        (lambda: sawyer().pose(np.zeros(6)), r"q has shape \(6,\); the arm 'sawyer' takes \(..., 7\)."),
        (lambda: sawyer().jacobian([0, 0, np.nan, 0, 0, 0, 0]), r"q\[2\] is nan; every joint angle must be finite."),
        (
            lambda: sawyer().pose(np.zeros(7), "tol"),
            "no frame of arm 'sawyer' named 'tol'. Did you mean 'tool'. Valid: link1",
        ),
    ],
)
def test_misuse_gets_one_clear_error(call, message):
    with pytest.raises(RobotError, match=message) as caught:
        call()
    assert isinstance(caught.value, HqpError)
