"""Settings moved down and up: which number of which solver, and none where there is none."""

from __future__ import annotations

import pytest

from hqp_rp import ConstantDamping, VariableDamping, get_solver
from hqp_rp.compare.contestants import Contestant, default_contestants
from hqp_rp.compare.statistics.settings import moved, setting_of, variants_of


def test_a_policy_is_moved_as_a_whole() -> None:
    solver = moved(get_solver("null_space", damping=VariableDamping(0.3, 0.1)), 3.0)
    assert solver.damping == VariableDamping(3.0 * 0.3, 3.0 * 0.1)
    assert moved(get_solver("reverse_priority", damping=ConstantDamping(0.3)), 0.5).damping == ConstantDamping(0.15)


@pytest.mark.parametrize(
    ("name", "field"),
    [
        ("jparse", "gamma"),
        ("selectively_damped", "gamma_max"),
        ("incremental_projector", "largest_step"),
        ("weighted", "ratio"),
    ],
)
def test_the_number_that_bounds_steps_is_moved(name: str, field: str) -> None:
    solver = get_solver(name)
    assert getattr(moved(solver, 3.0), field) == pytest.approx(3.0 * getattr(solver, field))
    assert field in setting_of(solver)


def test_a_method_without_a_setting_is_run_once() -> None:
    for name in ("null_space", "hierarchical_active_set", "pseudo_inverse", "qp_cascade"):
        assert moved(get_solver(name), 3.0) is None
        assert setting_of(get_solver(name)) == ""
        assert len(variants_of(Contestant(name, get_solver(name), "exact in theory"))) == 1


def test_every_contestant_can_be_moved_and_solves_still() -> None:
    for contestant in default_contestants(limits=False, torques=False, transitions=False):
        factors = [factor for factor, _ in variants_of(contestant)]
        assert factors in ([1.0], [1.0, 1.0 / 3.0, 3.0])
