"""The history of a benchmark: kept line by line, and when a ratio is called worse."""

from __future__ import annotations

from pathlib import Path

import pytest

from hqp_rp.core.errors import FileError
from tests.bench.history import HISTORY, MARGIN, Entry, compared, keep, load_history
from tests.bench.timing import Ratio


def entry(values: dict[str, float], *, machine: str = "m", quick: bool = False, spread: float = 0.0) -> Entry:
    ratios = {name: Ratio("own", "other", value, spread) for name, value in values.items()}
    return Entry("2026-01-01T00:00:00+00:00", {"quick": quick}, {"processor": machine}, {"hqp_rp": "1"}, ratios)


def test_history_is_kept_line_by_line(tmp_path: Path) -> None:
    entries = [entry({"a": 2.0}), entry({"a": 3.0}, quick=True)]
    keep(tmp_path, entries)
    assert len((tmp_path / HISTORY).read_text().splitlines()) == 2
    assert load_history(tmp_path) == entries
    with (tmp_path / HISTORY).open("a") as file:
        file.write("{}\n")
    with pytest.raises(FileError, match="line 3: not an entry"):
        load_history(tmp_path)


def test_a_ratio_is_worse_only_beyond_the_margin() -> None:
    before = entry({"a": 10.0, "b": 10.0})
    assert "None of 2 ratios is worse" in compared([before], entry({"a": 10.0 * (1.01 - MARGIN), "b": 20.0}))[0]
    told = compared([before], entry({"a": 10.0 * (0.99 - MARGIN), "b": 10.0}))
    assert len(told) == 1
    assert told[0].startswith("Worse than on 2026-01-01")
    assert "a: from 10 to 7.9 (-21%, margin 20%)" in told[0]
    noisy = entry({"a": 10.0 * (0.99 - MARGIN), "b": 10.0}, spread=0.1)
    assert "None of 2" in compared([before], noisy)[0]


def test_runs_that_are_not_alike_are_not_compared() -> None:
    now = entry({"a": 1.0})
    assert "no earlier run" in compared([], now)[0]
    others = [entry({"a": 10.0}, machine="other"), entry({"a": 10.0}, quick=True)]
    assert "not compared" in compared(others, now)[0]
    alike = entry({"a": 10.0, "gone": 1.0})
    told = compared([*others[:1], alike, *others[1:]], now)
    assert "from 10 to 1" in told[0]
    assert "missing now: gone" in told[1]
