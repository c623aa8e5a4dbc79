"""A level is judged row by row: neither a long row nor a far target hides what a short one misses."""

import numpy as np
import pytest

from hqp_rp import Level, Problem, Status, certify, solve
from hqp_rp.core.removable import smaller_parts
from hqp_rp.core.rounding import rounding_at_zero
from hqp_rp.core.verify import fault_of


@pytest.mark.parametrize("ratio", [10.0**k for k in range(2, 12)])
def test_a_short_row_is_judged_in_its_own_size(ratio: float) -> None:
    rows = [[ratio, 0.0], [1.0, 0.0]]
    one_sided = Problem([Level(rows, [0.7 * ratio, 0.9], [np.inf, 0.9])])
    for wrong in ([0.7, 0.0], [0.7 * (1.0 - 1e-16), 0.0], [0.9 - 1e-6, 0.0]):
        verdict = certify(one_sided, wrong)
        assert verdict.fault == "level 1"
        assert fault_of(one_sided, np.array(wrong), None, 1e-9) == verdict.sentence
    assert certify(one_sided, [0.9, 0.0]).ok
    assert fault_of(one_sided, np.array([0.9, 0.0]), None, 1e-9) == ""
    both = Problem([Level.equality(rows, [0.7 * ratio, 0.9])])
    least = 0.7 + 0.2 / (ratio**2 + 1.0)
    assert certify(both, [least, 0.0]).ok
    assert certify(both, [0.9, 0.0]).fault == "level 1"


def test_a_row_that_holds_others_back_by_less_than_rounding_is_no_fault() -> None:
    """The short row presses the long one against its bound: it gives way by 0.2 / 1e8, far below an ulp of its value."""
    problem = Problem([Level([[1e8, 0.0], [1.0, 0.0]], [-np.inf, 0.9], [0.7e8, 0.9])])
    assert certify(problem, [0.7, 0.0]).ok
    assert certify(problem, [0.9, 0.0]).fault == "level 1"
    assert certify(problem, [0.6, 0.0]).fault == "level 1"


def test_rows_between_which_a_level_really_decides_are_judged_together() -> None:
    """Two rows a hundred and one times apart: the long one gives way visibly, and must."""
    problem = Problem([Level([[101.0, 0.0], [1.0, 0.0]], [-np.inf, 0.9], [0.7 * 101.0, 0.9])])
    least = (0.7 * 101.0**2 + 0.9) / (101.0**2 + 1.0)
    assert certify(problem, [least, 0.0]).ok
    assert certify(problem, [0.7, 0.0]).fault == "level 1"


@pytest.mark.parametrize("target", [1e9, 1e12, 1e15, 1e18])
def test_a_far_target_excuses_nothing_elsewhere(target: float) -> None:
    box = Level(np.eye(3), -1.0, 1.0)
    far, near = Level.equality([[1.0, 1.0, 0.0]], [target]), Level.equality([[0.0, 0.0, 1.0]], [0.5])
    beside = Level.equality([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [target, 0.5])
    # In one level rounding of the far target, 1e-16 of it, may be felt by the rows beside it; no other level's rows feel it.
    for levels in ([far, near], [beside])[: 2 if target <= 1e12 else 1]:
        problem = Problem(levels, box)
        assert certify(problem, [1.0, 1.0, 0.5]).ok
        assert not certify(problem, [1.0, 1.0, 0.3]).ok
        assert not certify(problem, [1.0, 0.9, 0.5]).ok
        assert certify(problem, [1.01, 1.0, 0.5]).fault == "hard rows"
    between = Problem([Level.equality([[1.0, 0, 0], [1.0, 0, 0]], [target, -target]), near])
    assert certify(between, [0.0, 0.0, 0.5]).ok
    assert certify(between, [1e-16 * target, 0.0, 0.5]).ok
    assert not certify(between, [0.0, 0.0, 0.3]).ok
    assert not certify(between, [0.0, 0.1, 0.5]).ok


def test_rounding_at_zero_is_along_what_the_far_rows_determine() -> None:
    between = Problem([Level.equality([[1.0, 0.0], [1.0, 0.0]], [1e15, -1e15])])
    directions = rounding_at_zero(between, np.zeros(2))
    assert directions.shape == (2, 1)
    assert np.abs(directions[:, 0]) == pytest.approx([8.0 * np.finfo(float).eps * 1e15, 0.0])
    assert rounding_at_zero(between, np.array([1e4, 0.0])).shape == (2, 0)
    held = Problem([Level.equality([[1.0, 0.0]], [1e15])], Level(np.eye(2), -1.0, 1.0))
    assert rounding_at_zero(held, np.array([1.0, 0.0])).shape == (2, 0)


def test_a_row_of_zeros_leaves_its_rounding_in_x() -> None:
    level = Level.equality([[0.0, 0.0], [-1.0, -1.0], [1.0, -2.0], [0.0, 1.0]], [2.0, 0.0, 0.0, 0.0])
    assert certify(Problem([level]), [9e-17, 1.9e-16]).ok
    assert not certify(Problem([level]), [1e-6, 0.0]).ok


def test_parts_of_a_level() -> None:
    lengths = np.array([1e4, 2e3, 5.0, 0.0, 2.0])
    parts = smaller_parts(lengths, lengths)
    assert [(list(np.flatnonzero(part.rows)), part.by_reach) for part in parts] == [([2, 4], False)]
    damped = smaller_parts(np.array([1e4, 1.0, 1e-3]), np.ones(3), own=2)
    assert [list(part.rows) for part in damped] == [[False, True, True]]
    assert smaller_parts(np.array([1.0, 1.0, 1e-3]), np.ones(3), own=2) == []
    assert smaller_parts(np.array([50.0, 1.0]), np.array([1e5, 1.0])) == []
    far = smaller_parts(np.ones(2), np.array([1e15, 1.0]))
    assert [(list(part.rows), part.by_reach) for part in far] == [([False, True], True)]


def test_daqp_says_where_it_cannot_see_a_short_row() -> None:
    pytest.importorskip("daqp")
    problem = Problem([Level([[1e7, 0.0], [1.0, 0.0]], [0.7e7, 0.9], [np.inf, 0.9])])
    solution = solve(problem, "daqp")
    assert (solution.status is Status.SOLVED) == (abs(solution.x[0] - 0.9) < 1e-6)
