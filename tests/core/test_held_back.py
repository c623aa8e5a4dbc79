"""What holds a level back, on problems typed in."""

from __future__ import annotations

import numpy as np

from hqp_rp import Level, Problem, solve

SOLVER = "hierarchical_active_set"


def test_a_band_narrower_than_the_tolerance_holds_from_both_sides() -> None:
    hard = Level([[1.0, 0.0]], -1e-12, 1e-12, name="band")
    for side in (-1.0, 1.0):
        problem = Problem([Level(np.eye(2), [side, 1.0], [side, 1.0], name="task")], hard=hard)
        (told,) = solve(problem, SOLVER).held_back
        assert told.by == ("band[0]",)
        assert told.rest < 1e-9


def test_a_short_row_beside_a_met_long_one_is_held_back_by_what_holds_it() -> None:
    level = Level([[1e4, 0.0], [0.0, 1e-3]], [1e4, 1e-3], [1e4, 1e-3], name="task")
    problem = Problem([level], hard=Level([[0.0, 1.0]], -np.inf, 0.5, name="limit"))
    (told,) = solve(problem, SOLVER).held_back
    assert not told.alone
    assert told.by[0] == "limit[0] at its upper bound"


def test_a_level_at_odds_with_itself_is_held_back_by_nothing_else() -> None:
    problem = Problem([Level([[1.0, 0.0], [1.0, 0.0]], [0.0, 1.0], [0.0, 1.0], name="task")])
    (told,) = solve(problem, SOLVER).held_back
    assert told.alone


def test_names_that_cannot_be_given_stop_no_solve() -> None:
    problem = Problem([Level(np.eye(1), 0.0, 0.0)], hard=Level([[1.0], [1.0]], [1.0, -np.inf], [np.inf, 0.0]))

    def names() -> list[tuple[str, ...]]:
        raise AttributeError("a robot of one's own")

    problem.kept = {**(problem.kept or {}), "hard row names": names}
    solution = solve(problem, SOLVER)
    assert solution.conflict is not None
    assert "hard row 0" in str(solution.conflict)
