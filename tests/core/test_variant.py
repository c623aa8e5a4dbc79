"""What a solver may declare about its variants, and the sentence for what it may not."""

from __future__ import annotations

import pytest

from hqp_rp import SettingError, UnknownNameError
from hqp_rp.core.variant import EXACT, GROUPS, LineUp, Variant

PLAIN = Variant("plain", {}, EXACT, "as it is")


@pytest.mark.parametrize("label", ["", "plain, damped"])
def test_a_label_that_cannot_stand_in_a_sentence_is_refused(label: str) -> None:
    with pytest.raises(SettingError, match=f"label is {label!r}; .* without commas"):
        Variant(label, {}, EXACT, "")


def test_an_unknown_group_lists_those_there_are() -> None:
    with pytest.raises(UnknownNameError, match="sturdy") as told:
        Variant("plain", {}, "sturdy", "")
    assert all(group in str(told.value) for group in GROUPS)


def test_an_unknown_occasion_lists_those_there_are() -> None:
    with pytest.raises(UnknownNameError, match=r"'rain'.*limits.*torques.*transitions"):
        LineUp((PLAIN,), only_with="rain")  # type: ignore[arg-type]


def test_a_label_stands_for_one_variant() -> None:
    with pytest.raises(SettingError, match="Two variants are labelled 'plain'; give each a label of its own"):
        LineUp((PLAIN, PLAIN))
