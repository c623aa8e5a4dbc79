"""Every figure against one worked out by hand."""

from __future__ import annotations

import functools
import math

import numpy as np
import polars as pl
import pytest

from hqp_rp import Level, Problem, Solution, Solver, Status
from hqp_rp.compare.measure.metrics import (
    SCHEMA,
    distance,
    judged_rows,
    levels_frame,
    measured_frame,
    part_frame,
    parting_frame,
    run_levels_frame,
    runs_frame,
    steps_frame,
)
from hqp_rp.compare.measure.reference import NOT_COMPUTED, TOO_MUCH_WORK, certified_start, reference
from hqp_rp.core import truth_active_set
from hqp_rp.scenarios.scenario import Step
from tests.compare.small import Closing, Fixed


def frame_of(steps: list[Step], solver: Solver, contestant: str = "one", seed: int = 0) -> pl.DataFrame:
    return part_frame(judged_rows(steps, solver, scenario="by hand", contestant=contestant, seed=seed))


def problem() -> Problem:
    """x* = (1, 1)."""
    return Problem(
        [Level.equality([[1.0, 0.0]], [1.0], name="first"), Level.equality([[0.0, 2.0]], [2.0], name="second")]
    )


def step(x: list[float] | None, parameter: float = 0.0, seconds: float = 0.0, status: Status = Status.SOLVED) -> Step:
    point = None if x is None else np.array(x)
    return Step("", parameter, problem(), Solution(problem(), point, status, 3, "why"), seconds, {"error [m]": 0.5})


def test_one_step_by_hand() -> None:
    frame = frame_of([step([1.0, 0.5], seconds=2e-6)], Fixed())
    row = steps_frame(frame).row(0, named=True)
    assert row["distance"] == pytest.approx(0.5 / math.sqrt(2.0), rel=1e-15)
    assert row["optimum_norm"] == pytest.approx(math.sqrt(2.0), rel=1e-15)
    assert row["x"] == [1.0, 0.5]
    assert row["x_norm"] == pytest.approx(math.sqrt(1.25), rel=1e-15)
    assert (row["status"], row["iterations"], row["message"], row["solve_time"]) == ("SOLVED", 3, "why", 2e-6)
    assert (row["certified"], row["lexicographic"], row["ambiguous"]) == (False, False, False)
    assert "'second' is at fault" in row["verdict"]
    first, second = levels_frame(frame).iter_rows(named=True)
    assert (first["residual"], first["excess"], first["rank"], first["sigma_min"]) == (0.0, 0.0, 1, 1.0)
    assert (second["residual"], second["excess"], second["rank"], second["sigma_min"]) == (1.0, 1.0, 1, 2.0)
    assert second["relative_excess"] == pytest.approx(1.0 / (2.0 * math.sqrt(1.25) + 2.0), rel=1e-14)
    assert (second["optimal_residual"], second["name"], second["level"], second["singularity"]) == (
        0.0,
        "second",
        2,
        "NONE",
    )
    measured = measured_frame(frame).row(0, named=True)
    assert (measured["quantity"], measured["value"]) == ("error [m]", 0.5)


def test_an_optimal_answer_is_certified() -> None:
    row = steps_frame(frame_of([step([1.0, 1.0])], Fixed(claims=True))).row(0, named=True)
    assert (row["certified"], row["lexicographic"], row["distance"]) == (True, True, 0.0)


def test_a_step_without_an_answer_keeps_its_row() -> None:
    frame = frame_of([step(None, status=Status.REFUSED)], Fixed())
    assert frame.schema == pl.Schema(SCHEMA)
    row = steps_frame(frame).row(0, named=True)
    assert (row["x"], row["x_norm"], row["distance"], row["certified"]) == (None, None, None, None)
    assert [level["residual"] for level in levels_frame(frame).iter_rows(named=True)] == [None, None]
    assert [level["sigma_min"] for level in levels_frame(frame).iter_rows(named=True)] == [1.0, 2.0]


def test_distance_is_relative_but_not_to_an_optimum_at_rest() -> None:
    assert distance(np.array([3.0, 0.0]), np.array([2.0, 0.0])) == 0.5
    assert distance(np.array([1e-9, 0.0]), np.zeros(2)) == 1.0
    assert distance(None, np.zeros(2)) is None
    assert distance(np.zeros(2), None) is None


def test_a_run_by_hand() -> None:
    path = [[1.0, 1.0], [4.0, 5.0], [4.0, 5.0], None]
    steps = [
        step(x, float(k), seconds, Status.SOLVED if x else Status.NOT_FINITE)
        for k, (x, seconds) in enumerate(zip(path, (1.0, 2.0, 3.0, 4.0), strict=True))
    ]
    row = runs_frame(steps_frame(frame_of(steps, Fixed()))).row(0, named=True)
    assert row["total_variation"] == 5.0
    assert row["distance_max"] == pytest.approx(5.0 / math.sqrt(2.0))
    assert row["distance_median"] == pytest.approx(5.0 / math.sqrt(2.0))
    assert row["x_norm_max"] == pytest.approx(math.sqrt(41.0))
    assert (row["steps"], row["share_solved"], row["share_not_finite"], row["share_refused"]) == (4, 0.75, 0.25, 0.0)
    assert row["time_p50"] in (2.0, 3.0)
    assert row["time_p99"] == 4.0


def test_runs_are_kept_apart() -> None:
    frames = [frame_of([step([float(s), 1.0])], Fixed(), seed=s) for s in (1, 2)]
    runs = runs_frame(steps_frame(pl.concat(frames)))
    assert runs["seed"].to_list() == [1, 2]
    assert runs["distance_max"].to_list() == [0.0, pytest.approx(1.0 / math.sqrt(2.0))]
    assert runs["total_variation"].to_list() == [0.0, 0.0]


def test_parting_is_the_first_step_that_leaves() -> None:
    path = [[1.0, 1.0], [1.0, 1.1], [1.0, 1.0], [1.0, 2.0]]
    steps = steps_frame(frame_of([step(x, 10.0 - k) for k, x in enumerate(path)], Fixed()))
    assert parting_frame(steps)["parts_at"].to_list() == [9.0]
    assert parting_frame(steps, threshold=0.5)["parts_at"].to_list() == [7.0]
    assert parting_frame(steps, threshold=2.0)["parts_at"].to_list() == [None]


def test_levels_over_a_run() -> None:
    frame = frame_of([step([1.0, 0.5]), step([0.0, 1.0]), step([1.0, 1.0])], Fixed())
    first, second = run_levels_frame(levels_frame(frame)).iter_rows(named=True)
    assert (first["excess_max"], first["excess_median"]) == (1.0, 0.0)
    assert (second["excess_max"], second["excess_median"]) == (1.0, 0.0)
    assert (first["sigma_min_min"], second["sigma_min_min"]) == (1.0, 2.0)


def test_ambiguous_steps_do_not_count() -> None:
    frame = steps_frame(frame_of([step([1.0, 1.0]), step([9.0, 1.0])], Fixed()))
    marked = frame.with_columns(ambiguous=pl.col("step") == 1)
    assert runs_frame(marked)["distance_max"].to_list() == [0.0]
    assert runs_frame(marked)["ambiguous_steps"].to_list() == [1]
    assert parting_frame(marked)["parts_at"].to_list() == [None]


def test_the_reference_is_the_optimum_and_is_computed_once() -> None:
    steps = list(Closing().steps(Fixed(), seed=1))
    for one in steps:
        found = reference(one.problem)
        assert found.x == pytest.approx([2.0, -2.0 / one.parameter], rel=1e-15)
        assert reference(Problem(one.problem.levels)) is found
    assert reference(steps[0].problem, np.array([1.0, 1.0])) is not reference(steps[0].problem)


def test_an_optimum_that_hinges_on_rounding_is_ambiguous() -> None:
    """The second unknown moves level 1 by rounding noise only: exact ranks let level 1 have it, the rank rule does not."""
    noise = Level([[1.0, 1e-17]], [2.0], [2.0], name="first")
    wish = Level.equality([[0.0, 1.0]], [-3.0], name="second")
    hard = Level(np.eye(2), -1.0, 1.0, name="box")
    found = reference(Problem([noise, wish], hard=hard))
    assert found.x == pytest.approx([1.0, -1.0])
    assert found.ambiguous
    clear = reference(Problem([Level([[1.0, 0.0]], [2.0], [2.0]), wish], hard=hard))
    assert clear.x == pytest.approx([1.0, -1.0])
    assert not clear.ambiguous


def test_large_problems_have_no_exact_reference() -> None:
    found = reference(Problem([Level.equality(np.eye(40), np.ones(40))]))
    assert found.x is None
    assert found.method == NOT_COMPUTED
    assert np.isnan(found.residuals).all()


def test_an_exact_search_that_takes_too_long_leaves_no_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    limited = functools.partial(truth_active_set.solve_active_set, limit=1)
    monkeypatch.setattr("hqp_rp.core.truth_active_set.solve_active_set", limited)
    hinged = Problem(
        [Level.equality([[1.0, 2.0, 3.0]], [4.0]), Level.equality(np.eye(3), [3.0, -1.0, 2.0])],
        hard=Level(np.eye(3), -0.5, 0.5),
    )
    found = reference(hinged)
    assert (found.x, found.method, found.ambiguous) == (None, TOO_MUCH_WORK, False)
    assert np.isnan(found.residuals).all()
    assert reference(hinged) is found
    unsolved = Solution(hinged, None, Status.ITERATION_LIMIT, 1, "")
    frame = steps_frame(frame_of([Step("", 0.0, hinged, unsolved, 0.0, {})], Fixed()))
    assert frame["reference"].to_list() == [TOO_MUCH_WORK]
    assert frame["distance"].to_list() == [None]
    # With an answer that is certified the search is short.
    right = np.array([0.5, 0.5, 0.5])
    start = certified_start(hinged, [np.full(3, np.nan), np.zeros(3), right])
    assert start is right
    assert certified_start(hinged, [np.zeros(3)]) is None
    assert certified_start(Problem(hinged.levels), [right]) is None
    assert reference(hinged, None, start).x == pytest.approx([0.5, 0.5, 0.5])
    assert reference(hinged).method == "exact rational active set"
