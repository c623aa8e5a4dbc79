"""Damping policies as values: what they accept, how they print, what a kernel is handed."""

import math

import numpy as np
import pytest

from hqp_rp import (
    ConstantDamping,
    Damping,
    ErrorDamping,
    Level,
    ManipulabilityDamping,
    NoDamping,
    NumericalFiltering,
    Problem,
    SettingError,
    Truncation,
    VariableDamping,
    solve,
)
from hqp_rp.core.damping import checked_damping, damping_of


def test_kinds_and_parameters() -> None:
    policies = [
        NoDamping(),
        ConstantDamping(0.1),
        VariableDamping(0.2, 0.3),
        Truncation(0.4),
        ManipulabilityDamping(0.5, 0.6),
        NumericalFiltering(0.7, 0.8),
    ]
    assert [policy.kind for policy in policies] == [0, 1, 2, 3, 5, 6]
    assert [policy.parameters for policy in policies[:4]] == [(0.0, 0.0), (0.1, 0.0), (0.2, 0.3), (0.4, 0.0)]
    for policy in [*policies[1:], ErrorDamping(0.1), ErrorDamping(0.1, 1, "rest")]:
        assert damping_of(policy.kind, policy.parameters) == policy
    assert damping_of(0, (0.0, 0.0)) is None
    with pytest.raises(SettingError, match="damping of kind 9"):
        damping_of(9, (0.0, 0.0))
    assert [repr(policy) for policy in policies] == [
        "none",
        "constant(0.1)",
        "variable(delta=0.2, maximum=0.3)",
        "truncation(0.4)",
        "manipulability(threshold=0.5, maximum=0.6)",
        "filtering(delta=0.7, maximum=0.8)",
    ]
    for policy in policies:
        assert checked_damping(policy) is policy
        assert all(type(value) is float for value in policy.parameters)


def test_policies_are_values() -> None:
    assert ConstantDamping(1) == ConstantDamping(1.0)
    assert hash(ConstantDamping(1)) == hash(ConstantDamping(1.0))
    assert ConstantDamping(0.0).parameters == (0.0, 0.0)
    assert ConstantDamping(1) != Truncation(1)
    with pytest.raises(AttributeError):
        ConstantDamping(1.0).factor = 2.0  # type: ignore[misc]


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf, "0.1", None])
def test_bad_values(bad: object) -> None:
    with pytest.raises(SettingError, match=r"factor is .*; it must be a finite number >= 0\."):
        ConstantDamping(bad)  # type: ignore[arg-type]
    with pytest.raises(SettingError, match="threshold is "):
        Truncation(bad)  # type: ignore[arg-type]
    with pytest.raises(SettingError, match="maximum is "):
        VariableDamping(0.1, bad)  # type: ignore[arg-type]
    with pytest.raises(SettingError, match=r"delta is .*; it must be a finite number > 0\."):
        VariableDamping(bad, 0.1)  # type: ignore[arg-type]
    with pytest.raises(SettingError, match=r"threshold is .*; it must be a finite number > 0\."):
        ManipulabilityDamping(bad, 0.1)  # type: ignore[arg-type]
    with pytest.raises(SettingError, match="maximum is "):
        NumericalFiltering(0.1, bad)  # type: ignore[arg-type]


def test_delta_must_be_positive() -> None:
    with pytest.raises(SettingError, match=r"delta is 0\.0; it must be a finite number > 0\."):
        VariableDamping(0.0, 0.1)


@pytest.mark.parametrize("bad", [0.1, None, "constant", NoDamping])
def test_what_is_no_policy(bad: object) -> None:
    with pytest.raises(SettingError, match=r"damping is .*; give NoDamping\(\), ConstantDamping\(factor\)"):
        checked_damping(bad)


POLICIES = [
    NoDamping(),
    ConstantDamping(0.3),
    VariableDamping(0.9, 0.4),
    Truncation(0.5),
    ManipulabilityDamping(2.0, 0.5),
    NumericalFiltering(0.9, 0.4),
]


def inverse(A: np.ndarray, policy: object) -> np.ndarray:
    """A^# by the formulas in the policies' docstrings, from matrices where they are so stated."""
    m, n = A.shape
    U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
    last = sigma[-1]
    if isinstance(policy, ConstantDamping):
        return A.T @ np.linalg.inv(A @ A.T + policy.factor**2 * np.eye(m))
    if isinstance(policy, ManipulabilityDamping):
        w = np.sqrt(np.linalg.det(A @ A.T)) if m <= n else np.sqrt(np.linalg.det(A.T @ A))
        lam = policy.maximum**2 * max(0.0, 1.0 - w / policy.threshold) ** 2
        return Vt.T @ np.diag(sigma / (sigma**2 + lam)) @ U.T
    if isinstance(policy, NumericalFiltering):
        beta = max(0.0, 1.0 - (last / policy.delta) ** 2) * policy.maximum**2
        return A.T @ np.linalg.inv(A @ A.T + beta * np.outer(U[:, -1], U[:, -1])) if m <= n else np.linalg.pinv(A)
    if isinstance(policy, VariableDamping):
        lam = max(0.0, 1.0 - (last / policy.delta) ** 2) * policy.maximum**2
        return Vt.T @ np.diag(sigma / (sigma**2 + lam)) @ U.T
    if isinstance(policy, Truncation):
        return Vt.T @ np.diag(np.where(sigma > policy.threshold, 1.0 / sigma, 0.0)) @ U.T
    return np.linalg.pinv(A)


@pytest.mark.parametrize("policy", POLICIES, ids=repr)
@pytest.mark.parametrize("smallest", [1.3, 0.6, 0.2, 1e-3])
@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_the_inverse_of_one_level_natively_and_in_numpy(policy: Damping, smallest: float, scale: float) -> None:
    rng = np.random.default_rng(5)
    U, V = np.linalg.qr(rng.normal(size=(3, 3)))[0], np.linalg.qr(rng.normal(size=(5, 5)))[0]
    A, b = U @ np.diag([2.0, 1.5, smallest]) @ V[:3], rng.normal(size=3)
    numbers = policy.parameters
    powers = {ManipulabilityDamping: (scale**3, scale), Truncation: (scale,), ConstantDamping: (scale,), NoDamping: ()}
    scaled = type(policy)(*(n * s for n, s in zip(numbers, powers.get(type(policy), (scale, scale)), strict=False)))
    expected = inverse(scale * A, scaled) @ b
    np.testing.assert_allclose(expected, inverse(A, policy) @ b / scale, rtol=1e-9)
    problem = Problem([Level.equality(scale * A, b)])
    for variant in ("basis", "projector"):
        x = solve(problem, "null_space", damping=scaled, variant=variant).x
        np.testing.assert_allclose(x, expected, rtol=1e-8, atol=1e-12)
    x = solve(problem, "singularity_robust", damping=scaled).x
    np.testing.assert_allclose(x, expected, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("policy", POLICIES[1:], ids=repr)
def test_every_policy_is_bounded_and_continuous_through_a_singularity(policy: Damping) -> None:
    """|x| <= |b| / (2 eta) + |b| / sigma_2; between neighbouring singular values x moves as little as they do."""
    if isinstance(policy, Truncation):
        pytest.skip("truncation jumps where a singular value passes its threshold: that is what it does")
    answers = []
    for smallest in np.linspace(0.0, 1.2, 1201):
        problem = Problem([Level.equality(np.diag([2.0, 1.5, smallest]), np.ones(3))])
        answers.append(solve(problem, "null_space", damping=policy).x)
    jumps = np.linalg.norm(np.diff(answers, axis=0), axis=1)
    assert np.linalg.norm(answers, axis=1).max() < 4.0
    assert jumps[1:].max() < 0.05


def test_filtering_damps_the_last_direction_alone() -> None:
    problem = Problem([Level.equality(np.diag([1.0, 0.1, 1e-3]), np.ones(3))])
    x = solve(problem, "null_space", damping=NumericalFiltering(0.5, 0.2)).x
    np.testing.assert_allclose(x[:2], [1.0, 10.0], rtol=1e-12)
    assert 0.0 < x[2] < 0.1
    with pytest.raises(SettingError, match="T_k is regularized as a whole"):
        solve(problem, "reverse_priority", damping=NumericalFiltering(0.5, 0.2))
