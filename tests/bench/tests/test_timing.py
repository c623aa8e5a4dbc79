"""Timing in turns, and its statistics. Nothing here asserts a time."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.bench.timing import TURN, interleaved, ratio, timing


@dataclasses.dataclass
class Scripted:
    """A runner whose every call takes `ns`, and that writes its name into a shared log."""

    label: str
    ns: int
    log: list[tuple[str, int, int]]

    def turn(self, first: int, count: int) -> list[int]:
        self.log.append((self.label, first, count))
        return [self.ns] * count


def test_statistics_of_known_times() -> None:
    found = timing("a", np.array([1000] * 98 + [5000, 9000]))
    assert found.calls == 100
    assert found.median == pytest.approx(1e-6)
    assert found.p99 == pytest.approx(np.quantile([1e-6] * 98 + [5e-6, 9e-6], 0.99))
    assert found.parts == pytest.approx([1e-6] * 5)


def test_ratio_and_its_spread() -> None:
    own = timing("own", np.repeat([1000], 50))
    other = timing("other", np.repeat([2000, 2000, 4000, 2000, 2000], 10))
    found = ratio(own, other)
    assert found.value == pytest.approx(2.0)
    assert found.spread == pytest.approx(0.5)  # the parts go from 2 to 4
    assert ratio(other, own).value == pytest.approx(0.5)


def test_runners_take_turns_and_a_slow_one_takes_fewer() -> None:
    log: list[tuple[str, int, int]] = []
    fast, slow = Scripted("fast", 1000, log), Scripted("slow", 10_000_000, log)
    timings = interleaved([fast, slow], calls=10 * TURN, budget=0.2)
    assert [item.calls for item in timings] == [80, 24]  # 0.2 s are 20 calls, three turns
    turns = [entry for entry in log if entry[2] == TURN]
    own = [first for label, first, _ in turns if label == "fast"][-10:]
    assert own == list(range(0, 80, TURN))  # each keeps its own place
    names = [label for label, _, _ in turns]
    assert names[-1] == "slow"  # spread over the run
    assert "fast" in names[names.index("slow", 2) + 1 :]
