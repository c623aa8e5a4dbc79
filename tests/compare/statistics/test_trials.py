"""One unit: what a row says of a path, by hand and against the solvers' own answers."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import ConstantDamping, get_solver
from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.statistics.passages import Design, Passage
from hqp_rp.compare.statistics.trials import Unit, measures, run_unit

DESIGN = Design(configurations=1, paths=2, samples=21)
CONTESTANTS = (
    Contestant("exact", get_solver("null_space"), "exact in theory"),
    Contestant("damped", get_solver("null_space", damping=ConstantDamping(0.2)), "damped or robust priority"),
    Contestant("reverse", get_solver("reverse_priority"), "exact in theory"),
)


def test_measures_by_hand() -> None:
    """Two samples on three unknowns: level 1 is x_1 = 1, level 2 x_2 = 1, level 3 x_3 = 1."""
    A = np.tile(np.eye(3), (2, 1, 1))
    b = np.ones((2, 3))
    passage = Passage(np.zeros((2, 3)), A, b, np.array([0, 1, 2, 3]), np.array([1.0, 0.2]))
    x = np.array([[1.0, 0.9, 1.0], [0.5, 3.0, 1.0]])
    found = measures(passage, x, np.ones((2, 3)))
    assert found["error_1"] == pytest.approx(0.5)
    assert found["error_2"] == pytest.approx(2.0)
    assert found["error_2_far"] == pytest.approx(0.1)  # sample 2 has 0.2 of the largest distance: not far
    assert found["error_2_far_nearer"] == pytest.approx(2.0)  # from 0.1 on it is
    assert found["error_3_far"] == 0.0
    assert found["growth"] == pytest.approx(np.linalg.norm(x[1]) / np.sqrt(3.0))
    assert found["jump"] == pytest.approx(np.linalg.norm(x[1] - x[0]))


def test_a_path_with_a_sample_without_an_answer_is_lost() -> None:
    A, b = np.tile(np.eye(3), (2, 1, 1)), np.ones((2, 3))
    passage = Passage(np.zeros((2, 3)), A, b, np.array([0, 1, 2, 3]), np.array([1.0, 0.2]))
    found = measures(passage, np.ones((2, 3)), np.ones((2, 3)), np.array([1.0, 0.0]))
    assert set(found.values()) == {np.inf}
    assert measures(passage, np.ones((2, 3)), np.ones((2, 3)), np.ones(2))["error_1"] == 0.0


def test_rows_tell_exact_damped_and_reverse_apart() -> None:
    rows = run_unit(Unit(DESIGN, "planar4", 0, CONTESTANTS))
    assert rows.height == 2 * (3 + 2)  # the damped one at three settings
    damped = rows.filter(rows["contestant"] == "damped").sort("setting")
    assert damped["setting"].unique().sort().to_list() == [1.0 / 3.0, 1.0, 3.0]
    assert damped["error_1"][0] < damped["error_1"][-1]
    rows = rows.filter(rows["setting"] == 1.0)
    by = {label: rows.filter(rows["contestant"] == label) for label in ("exact", "damped", "reverse")}
    assert by["exact"]["error_1"].max() < 1e-9
    assert by["exact"]["error_2_far"].max() < 1e-9
    assert by["exact"]["growth"].min() > by["damped"]["growth"].max()
    assert by["damped"]["error_1"].min() > 1e-3
    assert by["reverse"]["error_1"].max() < 1e-9
    assert by["reverse"]["error_2_far"].min() > 1e-3
    assert (rows["answered"] == 1.0).all()
    assert (rows["time"] > 0.0).all()


def test_the_same_unit_gives_the_same_rows() -> None:
    first, second = (run_unit(Unit(DESIGN, "planar4", 0, CONTESTANTS)).drop("time") for _ in range(2))
    assert first.equals(second)
