"""Lists in sentences."""

import pytest

from hqp_rp.core.words import listing


@pytest.mark.parametrize(
    ("items", "settings", "words"),
    [
        ([], {}, ""),
        (["a"], {}, "a"),
        (["a", "b"], {}, "a and b"),
        (["a", "b", "c"], {}, "a, b and c"),
        (["a", "b", "c"], {"last": "or"}, "a, b or c"),
        (["a", "b"], {"most": 2}, "a and b"),
        (["a", "b", "c", "d"], {"most": 2}, "a, b and 2 more"),
        (["a", "b"], {"most": 1}, "a and 1 more"),
        (map(repr, ["a", "b"]), {}, "'a' and 'b'"),
    ],
)
def test_a_list_in_a_sentence(items: list[str], settings: dict, words: str) -> None:
    assert listing(items, **settings) == words
