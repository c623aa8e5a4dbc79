"""How a solver is shown beside others, as it declares it: variants, each with a label, settings, a group and a reason."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal

from hqp_rp.core.errors import SettingError, unknown_name

EXACT = "exact in theory"
DAMPED = "damped or robust priority"
BOUNDED = "priority with bounded steps"
SOFT = "no strict priority"
QP = "QP cascade and active set"
WITHIN = "closed form within hard rows"
GROUPS = (EXACT, DAMPED, BOUNDED, SOFT, QP, WITHIN)
"""The groups, in the order in which figures and tables show them."""

Occasion = Literal["limits", "torques", "transitions"]
"""What makes a solver differ from others: hard rows; a metric; priorities that change."""
OCCASIONS: tuple[Occasion, ...] = ("limits", "torques", "transitions")


@dataclasses.dataclass(frozen=True, slots=True)
class Variant:
    """A solver with settings, as comparisons show it.

    Attributes:
        label: short, stable and without a comma; figures and tables speak of the variant by it.
        settings: what differs from the solver's defaults.
        group: one of `GROUPS`: what it is drawn beside.
        why: what the variant is there to show.

    Raises:
        SettingError: a label that is empty or has a comma. UnknownNameError: no such group.
    """

    label: str
    settings: Mapping[str, Any]
    group: str
    why: str

    def __post_init__(self) -> None:
        if not self.label or "," in self.label:
            raise SettingError(
                f"label is {self.label!r}; a variant's label stands in sentences: give one without commas."
            )
        if self.group not in GROUPS:
            raise unknown_name("group of variants", self.group, GROUPS)


@dataclasses.dataclass(frozen=True, slots=True)
class LineUp:
    """A solver's variants, and when and where they are shown.

    Attributes:
        variants: the first is the solver as it is usually taken.
        place: within a group solvers stand in the order of their places, those of one place by their names.
        only_with: left out of a default line-up where this does not occur, since the solver is then the same as another.

    Raises:
        SettingError: two variants of one label. UnknownNameError: no such occasion.
    """

    variants: tuple[Variant, ...] = ()
    place: int = 1000
    only_with: Occasion | None = None

    def __post_init__(self) -> None:
        labels = [variant.label for variant in self.variants]
        twice = next((label for label in labels if labels.count(label) > 1), None)
        if twice is not None:
            raise SettingError(f"Two variants are labelled {twice!r}; give each a label of its own.")
        if self.only_with is not None and self.only_with not in OCCASIONS:
            raise unknown_name("occasion of a line-up", self.only_with, OCCASIONS)
