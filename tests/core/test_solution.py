"""Solutions: an honest status, and levels that are judged only when asked for."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hqp_rp import Level, Problem, Solution, Status, all_solvers, get_solver
from tests.problems import independent


def test_defaults() -> None:
    solution = Solution(independent(0), np.ones(7))
    assert solution.status is Status.SOLVED
    assert solution.status.ok
    assert (solution.iterations, solution.message, solution.secondary) == (0, "", None)
    assert repr(Solution(independent(0), None, Status.INFEASIBLE)) == "Solution(INFEASIBLE, x=None, iterations=0)"


def test_only_solved_is_ok_and_every_status_is_a_sentence() -> None:
    assert [status for status in Status if status.ok] == [Status.SOLVED]
    for status in Status:
        assert status.value.endswith(".")
        assert " " in status.value


def test_levels_are_computed_once_from_problem_and_x() -> None:
    solution = Solution(independent(0), np.zeros(7))
    levels = solution.levels
    assert solution.levels is levels
    for report, level in zip(levels, independent(0).levels, strict=True):
        np.testing.assert_array_equal(report.violation, -level.lower)
        assert report.residual == pytest.approx(np.linalg.norm(level.lower), rel=1e-15)


def test_no_x_no_levels() -> None:
    solution = Solution(independent(0), None, Status.REFUSED, message="Because.")
    with pytest.raises(ValueError, match=r"no x to judge: The solver cannot take this problem\. Because\."):
        _ = solution.levels


class Noted(Solution):
    """A class of one's own, with a slot and an attribute."""

    __slots__ = ("__dict__", "note")
    note: str


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))])
def test_a_copy_says_what_the_original_says(copied: Callable[[Any], Any]) -> None:
    problem = independent(0)
    given = Noted(problem, np.arange(7.0), Status.INACCURATE, 3, "Because.", np.ones(7))
    given.held, given.note, given.other = np.zeros(problem.rows, dtype=np.int8), "slot", "attribute"
    other = copied(given)
    assert type(other) is Noted
    assert (other.status, other.iterations, other.message) == (Status.INACCURATE, 3, "Because.")
    assert (other.note, other.other) == ("slot", "attribute")
    for name in ("x", "secondary", "held", "active"):
        np.testing.assert_array_equal(getattr(other, name), getattr(given, name))
    assert [level.residual for level in other.levels] == [level.residual for level in given.levels]
    assert copied(Solution(problem, None, Status.REFUSED)).x is None


@pytest.mark.parametrize("solver", [name for name, kind in all_solvers().items() if kind.takes_hard])
def test_answers_and_conflicts_of_every_solver_with_limits_can_be_copied(solver: str) -> None:
    box = Level(np.eye(2), [-1, -1], [1, 1], name="box", row_names=["left", "right"])
    reached = get_solver(solver).solve(Problem([Level.equality(np.eye(2), [3.0, 0.5])], hard=box))
    other = pickle.loads(pickle.dumps(reached))
    assert (other.active_rows, other.held_back) == (reached.active_rows, reached.held_back)
    np.testing.assert_array_equal(other.x, reached.x)
    apart = Level([[1, 0], [1, 0]], [1, -2], [2, 0], row_names=["near", "far"])
    failed = get_solver(solver).solve(Problem([Level.equality(np.eye(2), [3.0, 0.5])], hard=apart))
    assert pickle.loads(pickle.dumps(failed)).conflict == failed.conflict
