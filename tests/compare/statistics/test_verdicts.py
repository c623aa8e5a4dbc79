"""Verdicts by hand: words, shares, intervals, and what each of them hangs on."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from hqp_rp.compare.statistics.verdicts import (
    BOUNDED,
    KEPT_FIRST,
    KEPT_SECOND,
    NO,
    PARTLY,
    QUESTIONS,
    SETTING,
    YES,
    results,
    spread,
    word_of,
)

PLACES, PATHS = 10, 10
FIRST, SECOND, THIRD = QUESTIONS


def rows(**given: object) -> pl.DataFrame:
    """100 paths of one contestant that is exact and bounded, but for the columns given (scalars or arrays of 100)."""
    count = PLACES * PATHS
    values = dict.fromkeys(("error_1", "error_2", "jump"), 0.0)
    for name in ("", "_nearer", "_farther"):
        values |= {f"error_2_far{name}": 0.0, f"error_3_far{name}": 0.0, f"growth{name}": 1.0}
    values |= {"setting": 1.0, "nearest": 1e-3, "answered": 1.0, "time": 1e-6} | given
    columns = {name: np.broadcast_to(np.asarray(value, dtype=float), count) for name, value in values.items()}
    place = np.repeat(np.arange(PLACES), PATHS)
    return pl.DataFrame(
        {
            "arm": ["sawyer"] * count,
            "place": place,
            "path": np.tile(np.arange(PATHS), PLACES),
            "contestant": ["a"] * count,
        }
        | columns
    )


def test_a_perfect_method_is_told_so_and_nothing_hangs() -> None:
    (found,) = results(rows(), ["a"])
    assert {verdict.word for verdict in found.verdicts.values()} == {YES}
    assert not any(verdict.hangs_on for verdict in found.verdicts.values())
    assert found.answered == 1.0


@pytest.mark.parametrize(
    ("share", "word"), [(1.0, YES), (0.95, YES), (0.94, PARTLY), (0.06, PARTLY), (0.05, NO), (0.0, NO)]
)
def test_words(share: float, word: str) -> None:
    assert word_of(share) == word


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_value_within_the_factor_of_a_threshold_is_marked(factor: float) -> None:
    (found,) = results(
        rows(
            error_1=factor * KEPT_FIRST,
            **{f"error_2_far{n}": factor * KEPT_SECOND for n in ("", "_nearer", "_farther")},
            **{f"growth{n}": factor * BOUNDED for n in ("", "_nearer", "_farther")},
        ),
        ["a"],
    )
    assert {v.word for v in found.verdicts.values()} == {YES if factor < 1.0 else NO}
    assert found.verdicts[FIRST].hangs_on == ("the level-1 tolerance",)
    assert found.verdicts[SECOND].hangs_on == ("the level-2 tolerance",)
    assert found.verdicts[THIRD].hangs_on == ("the bound on ||x||",)


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_a_value_beyond_the_factor_is_not(factor: float) -> None:
    (found,) = results(rows(error_1=factor * KEPT_FIRST), ["a"])
    assert found.verdicts[FIRST].hangs_on == ()


def test_what_counts_as_far_is_marked_where_it_decides() -> None:
    (found,) = results(rows(error_2_far_nearer=1.0), ["a"])
    assert found.verdicts[SECOND].word == YES
    assert found.verdicts[SECOND].hangs_on == ("what counts as far",)


def test_the_draw_of_configurations_is_marked_where_it_decides() -> None:
    """One configuration of ten loses on all its paths: 90 % in all, but a resample without it says yes."""
    (found,) = results(rows(error_1=np.repeat([1.0] + [0.0] * 9, PATHS)), ["a"])
    assert found.verdicts[FIRST].word == PARTLY
    assert found.verdicts[FIRST].share == pytest.approx(0.9)
    assert found.verdicts[FIRST].hangs_on == ("configurations",)


def test_a_method_whose_own_setting_decides_is_marked() -> None:
    """As it is it keeps level 1; with three times its setting it does not, and with a third it does."""
    frames = [rows(setting=factor, error_1=error) for factor, error in ((1.0, 0.0), (1.0 / 3.0, 0.0), (3.0, 1.0))]
    (found,) = results(pl.concat(frames), ["a"])
    assert found.verdicts[FIRST].word == YES
    assert found.verdicts[FIRST].hangs_on == (SETTING,)
    assert found.verdicts[SECOND].hangs_on == ()
    assert [found.word(FIRST, factor) for factor in (1.0 / 3.0, 1.0, 3.0)] == [YES, YES, NO]


def test_paths_without_an_answer_keep_nothing_and_are_not_bounded() -> None:
    lost = dict.fromkeys(("error_1", "error_2_far", "growth", "growth_nearer", "growth_farther", "jump"), np.inf)
    (found,) = results(rows(answered=0.0, **lost), ["a"])
    assert {verdict.word for verdict in found.verdicts.values()} == {NO}
    assert found.spreads["growth"].median == found.spreads["growth"].high == np.inf
    assert found.answered == 0.0


def test_an_interval_is_wider_where_configurations_differ_than_where_paths_do() -> None:
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, PLACES, (1000, PLACES))
    values = rng.normal(size=PLACES)
    between = spread(np.repeat(values[:, None], PATHS, axis=1), drawn)
    within = spread(rng.permuted(np.repeat(values[:, None], PATHS, axis=1).ravel()).reshape(PLACES, PATHS), drawn)
    assert between.median == pytest.approx(within.median)
    assert between.low <= between.median <= between.high
    assert between.high - between.low > 2.0 * (within.high - within.low)
    assert np.isnan(spread(np.full((PLACES, PATHS), np.nan), drawn).median)
