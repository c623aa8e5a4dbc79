"""How a sentence lists things."""

from __future__ import annotations

from collections.abc import Iterable


def listing(items: Iterable[str], last: str = "and", most: int | None = None) -> str:
    """Items as a sentence has them: "a, b and c", "a" or "".

    Args:
        items: in their order. last: the word before the last one.
        most: how many are told, >= 1; of more, these and their number: "a, b and 3 more". None for all.
    """
    words = list(items)
    if most is not None and len(words) > most:
        words = [*words[:most], f"{len(words) - most} more"]
    return "".join(words) if len(words) < 2 else f"{', '.join(words[:-1])} {last} {words[-1]}"
