"""Levels: what they hold, and the error for each way to state one wrongly."""

import pickle

import numpy as np
import pytest

from hqp_rp import HqpError, Level, ProblemError

eye = np.eye(2)


def test_accepted_forms() -> None:
    assert Level([[1, 2]], 0, 1).A.dtype == np.float64
    assert Level(np.array([[True, False]]), 0, 1).A.tolist() == [[1.0, 0.0]]
    assert Level(np.asfortranarray(np.ones((2, 3))), 0, 1).A.flags.c_contiguous
    assert Level(np.eye(2, dtype=np.float32), 0, 1).A.dtype == np.float64


def test_stored_arrays_are_copies_and_read_only() -> None:
    A, b = np.eye(2), np.ones(2)
    level = Level.equality(A, b)
    A[0, 0], b[0] = 9.0, 9.0
    assert level.A[0, 0] == 1.0
    assert level.lower[0] == 1.0
    for array in (level.A, level.lower, level.upper):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    with pytest.raises(AttributeError, match="Level is read-only"):
        level.name = "other"


def test_level_pickles() -> None:
    level = Level([[1.0, 2.0]], -np.inf, 3.0, name="one")
    other = pickle.loads(pickle.dumps(level))
    assert (other.name, other.A.tolist(), other.lower.tolist(), other.upper.tolist()) == (
        "one",
        [[1, 2]],
        [-np.inf],
        [3],
    )


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Level([1.0, 2.0], 0, 1, "tool"), r"level 'tool': A has 1 dimension.*write A\[None, :\]"),
        (lambda: Level([[1.0], [1.0, 2.0]], 0, 1), "a level: A is ragged"),
        (lambda: Level([["a"]], 0, 1), "A has dtype <U1; it must hold real numbers"),
        (lambda: Level([[1j]], 0, 1), "A has dtype complex128"),
        (lambda: Level([[1.0, np.nan]], 0, 1, "t"), r"level 't': A\[0, 1\] is nan; every entry must be finite"),
        (lambda: Level([[np.inf, 0]], 0, 1), r"A\[0, 0\] is inf"),
        (lambda: Level.equality(eye, [1, np.nan], "t"), r"level 't': b\[1\] is nan; every entry must be finite"),
        (lambda: Level.equality(eye, [1, np.inf]), r"b\[1\] is inf"),
        (lambda: Level(eye, [0, np.nan], 1), r"lower\[1\] is nan; every bound must be a number"),
        (lambda: Level(eye, [0, 0, 0], 1), r"lower has shape \(3,\); A has 2 rows, so it must be \(2,\) or one number"),
        (lambda: Level(eye, 0, [[1, 1]]), r"upper has shape \(1, 2\)"),
        (
            lambda: Level(eye, [0, 2], 1, "t"),
            r"level 't': lower\[1\] = 2 > upper\[1\] = 1; lower must not exceed upper",
        ),
        (lambda: Level(eye, [0, np.inf], np.inf), r"lower\[1\] is inf, which no x can meet"),
        (lambda: Level(eye, -np.inf, [-np.inf, 0]), r"upper\[0\] is -inf, which no x can meet"),
    ],
)
def test_each_error_says_what_is_wrong(make: object, text: str) -> None:
    with pytest.raises(ProblemError, match=text) as error:
        make()  # type: ignore[operator]
    assert isinstance(error.value, HqpError)
    assert isinstance(error.value, ValueError)
