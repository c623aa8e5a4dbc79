"""Settings that are numbers in [0, 1], one or a table of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from hqp_rp.core.errors import SettingError


def checked_shares(value: Any, name: str, each: str, meant: str, *, depth: int) -> Any:
    """`value` itself where it is one number in [0, 1], else its numbers in tuples.

    Args:
        value: a number, or lists, tuples or an array of numbers. depth: 1 for a list of numbers, 2 for a list of lists.
        name: of the setting. each: what one number is called. meant: what the setting must be, for the error.

    Raises `SettingError` for something else, or a number outside [0, 1].
    """
    found = value
    if isinstance(value, list | tuple | np.ndarray):
        try:
            found = tuple(tuple(map(float, row)) for row in value) if depth == 2 else tuple(map(float, value))
        except (TypeError, ValueError):
            raise SettingError(f"{name} is {value!r}; it must be {meant}.") from None
    numbers = (
        [found] if not isinstance(found, tuple) else [a for row in found for a in (row if depth == 2 else (row,))]  # pyright: ignore[reportGeneralTypeIssues]
    )
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, int | float) or not 0.0 <= number <= 1.0:
            raise SettingError(f"{name} holds {number!r}; every {each} must be a number in [0, 1].")
    return found
