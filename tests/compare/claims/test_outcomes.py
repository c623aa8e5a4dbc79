"""Shares, medians and intervals of made-up figures, and what another threshold would say of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hqp_rp.compare.claims.outcomes import outcome, summary


def rows(values: Sequence[float | None], postures: list[int] | None = None) -> pl.DataFrame:
    return pl.DataFrame({"figure": values, "posture": postures or list(range(len(values)))})


def test_shares_and_medians_by_hand() -> None:
    o = outcome("here", rows([1.0, 2.0, 3.0, 10.0]), "figure", 2.5)
    assert (o.runs, o.passed, o.stricter, o.looser, o.median) == (4, 0.5, 0.0, 0.75, 2.5)
    assert o.holds is None
    assert o.turns == ("smaller",)
    assert o.low <= o.passed <= o.high
    assert o.median_low <= o.median <= o.median_high
    assert o.figure("mm", 1e3).startswith("2500 mm (")


def test_a_run_without_the_figure_meets_no_threshold() -> None:
    o = outcome("here", rows([1.0, None, None]), "figure", 2.0)
    assert o.passed == pytest.approx(1.0 / 3.0)
    assert o.median == math.inf
    assert o.holds is False
    o = outcome("here", rows([1.0, 1.0]), np.array([np.nan, 1.0]), 2.0)
    assert o.passed == 0.5


@pytest.mark.parametrize(("good", "state"), [(20, True), (19, True), (18, None), (10, None), (9, False), (0, False)])
def test_it_holds_from_95_percent_on_and_not_below_half(good: int, state: bool | None) -> None:
    assert outcome("", rows([0.0] * good + [9.0] * (20 - good)), "figure", 1.0).holds is state


def test_postures_are_drawn_again_with_all_their_runs() -> None:
    """Equal runs of one posture are one sample: many of them do not narrow the interval."""
    few = outcome("", rows([0.0, 9.0, 0.0, 9.0], [0, 1, 2, 3]), "figure", 1.0)
    many = outcome("", rows([0.0, 9.0, 0.0, 9.0] * 50, [0, 1, 2, 3] * 50), "figure", 1.0)
    assert (few.low, few.high) == (many.low, many.high)
    alone = outcome("", rows([0.0, 9.0], [0, 0]), "figure", 1.0)
    assert (alone.low, alone.passed, alone.high) == (0.5, 0.5, 0.5)


@given(st.lists(st.floats(0.0, 100.0), min_size=1, max_size=30), st.floats(0.1, 50.0))
def test_a_larger_threshold_is_met_by_no_fewer_runs(values: list[float], threshold: float) -> None:
    o = outcome("", rows(list(values)), "figure", threshold)
    assert o.stricter <= o.passed <= o.looser
    assert 0.0 <= o.low <= o.high <= 1.0
    assert min(values) <= o.median_low <= o.median_high <= max(values)


def test_the_summary_says_where_it_holds_and_what_hangs_on_the_threshold() -> None:
    found = [
        outcome("firm", rows([0.1] * 4), "figure", 1.0),
        outcome("loose", rows([0.9] * 4), "figure", 1.0),
        outcome("no", rows([50.0] * 4), "figure", 1.0),
    ]
    words = summary(found)
    assert words.startswith("Holds: firm; loose. Does not hold: no. A threshold 3 times")
    assert words.endswith("would change: loose (smaller).")
