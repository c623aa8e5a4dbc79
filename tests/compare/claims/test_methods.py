"""The line-up: every damped method over its sweep, each with the damping that its label says."""

from __future__ import annotations

from hqp_rp.compare.claims.methods import DAMPINGS, FIXED, SWEPT, WITHIN_LIMITS, line_up, method


def test_every_method_takes_part_and_no_two_are_alike() -> None:
    found = line_up()
    assert {m.label for m in found} == {*SWEPT, *FIXED} - set(WITHIN_LIMITS)
    assert len({repr(m.solver) for m in found}) == len(found)
    for label in SWEPT:
        own = [m.damping for m in found if m.label == label]
        assert len(own) >= 2
        assert set(own) <= set(DAMPINGS)
        assert all(f"{damping:g}" in repr(method(label, damping).solver) for damping in own)
    assert all(m.damping == 0.0 for m in found if m.label in FIXED)


def test_methods_within_limits_take_hard_rows() -> None:
    assert all(method(label).solver.takes_hard for label in WITHIN_LIMITS)
