"""Integer rows, and which rows a point in double precision is thought to lie on."""

import numpy as np

from hqp_rp import Level
from hqp_rp.core.truth_exact import Unit
from hqp_rp.core.truth_rows import IntegerRows, guessed


def test_guessed_rows_and_sides() -> None:
    inf = np.inf
    level = Level(
        np.ones((8, 1)), [1, 0, 2, -inf, 1 - 1e-12, -inf, -inf, 1 - 2e-12], [1, 2, 3, 0.5, 5, inf, 1 + 1e-12, 1 + 1e-12]
    )
    # equality, inside, below, above, at its lower bound, without bounds, at its upper bound, between two near bounds
    assert guessed(level, np.array([1.0])) == ([0, 2, 3, 4, 6, 7], [True, False, True, False, True, True])
    assert guessed(Level(np.zeros((0, 2)), [], []), np.zeros(2)) == ([], [])


def test_guessed_is_free_of_scale() -> None:
    level = Level([[1.0, 2.0], [3.0, -1.0]], [-1.0, -1.0], [1.0, 1.0])
    x = np.array([1.0, 0.0])
    for scale in (2.0**-1000, 1.0, 2.0**1000):
        assert guessed(Level(scale * level.A, scale * level.lower, scale * level.upper), x) == guessed(level, x)


def test_a_row_beyond_the_floats_is_not_guessed() -> None:
    assert guessed(Level([[1e308, 1e308]], -1.0, 1.0), np.array([10.0, 10.0])) == ([], [])


def test_equalities_at_their_sides_keep_the_level_s_unit() -> None:
    """The second row alone would have a larger unit than the level has: its bounds are still those of the level."""
    level = Level([[0.125, 0.0], [0.0, 1024.0]], [-0.5, -4096.0], [0.25, 2048.0])
    rows = IntegerRows.of(level, Unit.fitting([(level.A, np.array([-0.5, 0.25, -4096.0, 2048.0]))], np.zeros(2)))
    at = rows.at([1, 0], [True, False])
    matrix = np.array([[int(e) for e in row] for row in at.matrix.table()], dtype=float)
    target = np.array([int(e) for e in at.target.entries()], dtype=float)
    np.testing.assert_array_equal(target / matrix.max(axis=1), np.array([2.0, -4.0]) * target[0] / matrix[0, 1] / 2.0)
    assert at.denominator == 1
