"""Damping policies as values: what they accept, how they print, what a kernel is handed."""

import math

import pytest

from hqp_rp import ConstantDamping, NoDamping, SettingError, Truncation, VariableDamping
from hqp_rp.core.damping import checked_damping


def test_kinds_and_parameters() -> None:
    policies = [NoDamping(), ConstantDamping(0.1), VariableDamping(0.2, 0.3), Truncation(0.4)]
    assert [policy.kind for policy in policies] == [0, 1, 2, 3]
    assert [policy.parameters for policy in policies] == [(0.0, 0.0), (0.1, 0.0), (0.2, 0.3), (0.4, 0.0)]
    assert [repr(policy) for policy in policies] == [
        "none",
        "constant(0.1)",
        "variable(delta=0.2, maximum=0.3)",
        "truncation(0.4)",
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


def test_delta_must_be_positive() -> None:
    with pytest.raises(SettingError, match=r"delta is 0\.0; it must be a finite number > 0\."):
        VariableDamping(0.0, 0.1)


@pytest.mark.parametrize("bad", [0.1, None, "constant", NoDamping])
def test_what_is_no_policy(bad: object) -> None:
    with pytest.raises(SettingError, match=r"damping is .*; give NoDamping\(\), ConstantDamping\(factor\)"):
        checked_damping(bad)
