"""Problems: what they hold, and the error for each way to state one wrongly."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import HqpError, Level, Problem, ProblemError
from hqp_rp.core.row_names import LEVEL_ROW_NAMES, ROW_NAMES, RowName, has_row_names, level_row_names, row_names
from tests.problems import independent, over_constrained, two_sided


def test_stacked_arrays_and_views() -> None:
    problem = Problem(
        [Level.equality([[1, 2, 3]], [4], name="first"), Level(np.eye(3)[:2], [-1, -np.inf], 1)],
        hard=Level(np.eye(3), -2, 2, name="box"),
    )
    np.testing.assert_array_equal(problem.matrix, [[1, 2, 3], [1, 0, 0], [0, 1, 0]])
    np.testing.assert_array_equal(problem.lower, [4, -1, -np.inf])
    np.testing.assert_array_equal(problem.upper, [4, 1, 1])
    assert problem.offsets.tolist() == [0, 1, 3]
    assert (problem.n, problem.p, problem.names) == (3, 2, ("first", "level 2"))
    assert not problem.is_equality
    assert [level.is_equality for level in problem.levels] == [True, False]
    assert [(level.m, level.n) for level in problem.levels] == [(1, 3), (2, 3)]
    for level in problem.levels:
        assert np.shares_memory(level.A, problem.matrix)
        assert np.shares_memory(level.lower, problem.lower)
    assert problem.levels is problem.levels
    assert problem.hard is not None
    assert problem.hard.upper.tolist() == [2, 2, 2]
    assert repr(problem) == "Problem(1 + 2 rows on 3 unknowns, 3 hard rows)"
    assert repr(problem.levels[1]) == "Level('level 2', 2 x 3, two-sided)"
    assert problem.matrix.flags.c_contiguous
    assert problem.offsets.dtype == np.int64


def test_stored_arrays_are_copies_and_read_only() -> None:
    A, b = np.eye(2), np.ones(2)
    problem = Problem([Level.equality(A, b)])
    A[0, 0], b[0] = 9.0, 9.0
    assert problem.matrix[0, 0] == 1.0
    assert problem.lower[0] == 1.0
    for array in (problem.matrix, problem.lower, problem.upper, problem.offsets):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    with pytest.raises(AttributeError, match="Problem is read-only"):
        problem.n = 3


def test_levels_may_be_empty() -> None:
    empty = Problem([Level(np.zeros((0, 3)), [], []), Level.equality(np.zeros((0, 3)), [])])
    assert empty.is_equality
    assert empty.matrix.shape == (0, 3)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.lists(st.integers(0, 3), min_size=1, max_size=4))
def test_stacked_round_trip(seed: int, rows: list[int]) -> None:
    problem = two_sided(seed, 3, rows, box=1.0)
    arrays = (problem.matrix, problem.lower, problem.upper, problem.offsets)
    for other in (
        Problem.from_stacked(*arrays, names=problem.names, hard=problem.hard),
        Problem.from_stacked(*arrays, names=problem.names, hard=problem.hard, check=False),
        pickle.loads(pickle.dumps(problem)),
        Problem(problem.levels, problem.hard),
    ):
        for name in ("matrix", "lower", "upper", "offsets"):
            np.testing.assert_array_equal(getattr(other, name), getattr(problem, name))
        assert other.names == problem.names
        assert other.is_equality == problem.is_equality
        for a, b in zip(other.levels, problem.levels, strict=True):
            np.testing.assert_array_equal(a.A, b.A)


COPIES = [copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))]


@pytest.mark.parametrize("copied", COPIES)
def test_names_of_rows_survive_a_copy(copied: Callable[[Any], Any]) -> None:
    levels = [Level.equality(np.eye(2), [0, 1], name="a", row_names=["x", "y"]), Level(np.eye(2)[:1], -1, 1)]
    plain = Problem(levels, hard=Level(np.eye(2), -2, 2, name="box", row_names=["left", "right"]))
    other = copied(copied(plain))
    assert [level.row_names for level in other.levels] == [("x", "y"), ()]
    assert level_row_names(other) == level_row_names(plain)
    assert [str(name) for name in row_names(other)] == ["left", "right"]

    stated = Problem(levels, hard=Level(np.eye(2), -2, 2))
    hard = [RowName("limit", f"joint {i}", "rad/s", "velocity 1", "velocity 2", keep=True) for i in range(2)]
    rows = [RowName("task", f"row {i}", "m/s", turned=True) for i in range(3)]
    stated.kept = {ROW_NAMES: lambda: hard, LEVEL_ROW_NAMES: lambda: rows}  # as a stack does: what no pickle can hold
    other = copied(copied(stated))
    assert (row_names(other), level_row_names(other)) == (hard, rows)


def test_a_copy_of_a_problem_without_names_has_none() -> None:
    other = copy.deepcopy(Problem([Level.equality(np.eye(2), [0, 1])], hard=Level(np.eye(2), -2, 2)))
    assert not has_row_names(other)
    assert [str(name) for name in row_names(other)] == ["hard row 0", "hard row 1"]

    def fails() -> list[RowName]:
        raise RuntimeError("a limit of one's own")

    other.kept = {**(other.kept or {}), ROW_NAMES: fails}
    assert [str(name) for name in row_names(copy.deepcopy(other))] == ["hard row 0", "hard row 1"]


def test_fast_path_copies_nothing() -> None:
    matrix, b, offsets = np.eye(3), np.ones(3), np.array([0, 1, 3])
    problem = Problem.from_stacked(matrix, b, b, offsets, check=False)
    assert problem.stacked[0] is matrix
    assert np.shares_memory(problem.matrix, matrix)
    assert not problem.matrix.flags.writeable
    assert problem.lower is problem.upper
    assert problem.is_equality
    assert problem.names == ("level 1", "level 2")
    assert not Problem.from_stacked(matrix, b, b + 1, offsets, check=False).is_equality


eye = np.eye(2)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Problem([]), "at least one level"),
        (lambda: Problem(Level(eye, 0, 1)), r"takes a list of levels.*Problem\(\[level\]\)"),
        (lambda: Problem([eye]), r"Level 1 is a ndarray: build it with Level\(...\)"),
        (lambda: Problem([Level(np.zeros((2, 0)), 0, 1, "t")]), r"Level 1 \('t'\) has no unknowns: A is \(2, 0\)"),
        (
            lambda: Problem([Level(eye, 0, 1, "a"), Level([[1.0, 2, 3]], 0, 1, "b")]),
            r"Level 2 \('b'\) has 3 columns and Level 1 \('a'\) has 2",
        ),
        (lambda: Problem([Level(eye, 0, 1)], hard=eye), "hard is a ndarray"),
        (
            lambda: Problem([Level(eye, 0, 1)], hard=Level([[1.0]], 0, 1)),
            "hard rows have 1 columns and the levels have 2",
        ),
        (
            lambda: Problem.from_stacked(eye, np.zeros(3), np.zeros(2), [0, 2]),
            r"stacked arrays do not fit: .*lower \(3,\)",
        ),
        (
            lambda: Problem.from_stacked(eye, np.zeros(2), np.zeros(2), [0.0, 2.0]),
            "offsets must be a vector of integers",
        ),
        (lambda: Problem.from_stacked(eye, np.zeros(2), np.zeros(2), [0, 1]), r"offsets = \[0, 1\] must rise from 0"),
        (lambda: Problem.from_stacked(eye, np.zeros(2), np.zeros(2), [0, 2, 1, 2]), "must rise from 0"),
        (lambda: Problem.from_stacked(eye, np.zeros(2), np.zeros(2), [0]), "must rise from 0"),
        (lambda: Problem.from_stacked(eye, np.zeros(2), np.zeros(2), [0, 2], names=["a", "b"]), "2 names for 1 levels"),
    ],
)
def test_each_error_says_what_is_wrong(make: object, text: str) -> None:
    with pytest.raises(ProblemError, match=text) as error:
        make()  # type: ignore[operator]
    assert isinstance(error.value, HqpError)
    assert isinstance(error.value, ValueError)


def test_equal_bounds_make_an_equality_problem() -> None:
    assert independent(0).is_equality
    assert over_constrained(0).lower is not None
    assert Problem([Level(eye, [1, 2], [1, 2])]).is_equality
    assert not Problem([Level(eye, [1, 2], [1, 3])]).is_equality
