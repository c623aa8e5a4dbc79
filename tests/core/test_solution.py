"""Solutions: an honest status, and levels that are judged only when asked for."""

import numpy as np
import pytest

from hqp_rp import Solution, Status
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
