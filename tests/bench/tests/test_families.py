"""The families: they are what they say, and a path is a path."""

from __future__ import annotations

import numpy as np
import pytest

import hqp_rp
from tests.bench.families import FAMILIES, family


@pytest.mark.parametrize("name", FAMILIES)
def test_families_are_what_they_say_and_have_an_answer(name: str) -> None:
    made = family(name, quick=True)
    again = family(name, quick=True)
    assert np.array_equal(made.problems[-1].matrix, again.problems[-1].matrix)
    rows = {"7_3-3": (3, 3), "7_1-5": (1, 5), "7_6-1-7": (6, 1, 7), "30": (6, 6, 3, 12, 30), "100": (15,) * 6}
    expected = rows.get(name, (12, 3, 6, 38) if name.startswith("humanoid") else (3, 3, 7))
    for problem in (made.problems[0], made.problems[-1]):
        assert tuple(np.diff(problem.offsets)) == expected
        if name.startswith("humanoid"):
            assert problem.hard is not None
            assert problem.hard.m == int(name.split("_")[1])
        assert hqp_rp.solve(problem, "hierarchical_active_set").status.ok


def test_neighbours_on_a_path_are_near_and_it_closes() -> None:
    problems = family("7_limits_path").problems
    steps = [np.abs(a.matrix - b.matrix).max() for a, b in zip(problems, problems[1:] + problems[:1], strict=True)]
    assert max(steps) < 0.1
