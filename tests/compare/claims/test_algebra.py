"""The theorems hold to rounding on random problems, and a wrong one is found out."""

from __future__ import annotations

import pytest

from hqp_rp import get_solver
from hqp_rp.compare.claims import algebra
from hqp_rp.core.damping import ConstantDamping


@pytest.mark.parametrize(
    "theorem", [algebra.first_level_kept, algebra.same_on_two_levels, algebra.same_as_pseudo_inverse]
)
def test_theorems_hold_to_rounding(theorem: type[algebra.Theorem]) -> None:
    found = theorem()  # type: ignore[call-arg]
    assert found.checked
    assert 0.0 < found.largest < algebra.ROUNDING
    assert found.statement
    assert found.proof.endswith(".")


def test_a_method_that_does_not_keep_level_1_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    damped = get_solver("damped_least_squares", damping=ConstantDamping(0.1))
    monkeypatch.setattr(algebra, "get_solver", lambda name: damped)
    assert not algebra.first_level_kept.__wrapped__().checked


def test_the_counterexample_to_53() -> None:
    reverse, null_space = algebra.third_disturbs_second()
    assert reverse == pytest.approx(0.5)
    assert null_space == pytest.approx(0.0, abs=1e-12)
