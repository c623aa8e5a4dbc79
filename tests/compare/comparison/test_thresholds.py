"""Verdicts that hang on a threshold are named, with which one; the others are not."""

from __future__ import annotations

import dataclasses

import pytest

from hqp_rp.compare.comparison.thresholds import BOUND, EXACT, KEEPS, fragile, fragile_sentences
from hqp_rp.compare.measure.cases import BOUNDED, KEPT, PARTING
from tests.compare.comparison.test_findings import CARELESS, GENTLE, GOOD, case


def names(found: object) -> list[tuple[str, bool, str]]:
    return [(item.question, item.holds, item.threshold) for item in found]


def test_clear_verdicts_hang_on_nothing() -> None:
    assert fragile([case(GOOD, GENTLE, CARELESS)]) == ()
    assert fragile_sentences([case(GOOD)])[-1] == "No verdict changes."


@pytest.mark.parametrize(("factor", "holds"), [(0.4, True), (2.5, False)])
def test_a_value_near_its_threshold_is_named(factor: float, holds: bool) -> None:
    near = dataclasses.replace(
        GOOD,
        proven=(factor * KEPT, 0.0),
        x_max=factor * BOUNDED * 2.0,
        clear_distance=factor * PARTING,
        clear_distance_moved=(factor * PARTING, factor * PARTING),
    )
    assert names(fragile([case(near)])) == [
        (KEEPS, holds, "KEPT"),
        (BOUND, holds, "BOUNDED"),
        (EXACT, holds, "PARTING"),
    ]
    text = fragile_sentences([case(near)])
    assert len(text) == 4
    assert "hangs on KEPT for null space in" in text[1]
    assert ("here yes" if holds else "here no") in text[1]


@pytest.mark.parametrize("factor", [0.2, 4.0])
def test_a_value_beyond_the_factor_is_not(factor: float) -> None:
    assert fragile([case(dataclasses.replace(GENTLE, proven=(factor * KEPT, 0.0)))]) == ()


def test_where_far_and_clear_begin_is_moved_too() -> None:
    outcome = dataclasses.replace(GENTLE, x_max=15.0, clear_distance=1e-9, clear_distance_moved=(1.0, 1e-9))
    moved = dataclasses.replace(case(outcome), far_norm_moved=(2.0, 0.5))
    found = names(fragile([moved]))
    assert (BOUND, True, "FAR") in found
    assert (EXACT, True, "CLEAR") in found
    unknown = dataclasses.replace(outcome, clear_distance_moved=(None, 1e-9))
    assert EXACT not in [item.question for item in fragile([case(unknown)])]
