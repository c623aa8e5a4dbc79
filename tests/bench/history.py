"""The history of a benchmark: one line of JSON for each run, and what got worse since the last one."""

from __future__ import annotations

import dataclasses
import json
import math
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.run_folder import write_atomically
from hqp_rp.core.errors import FileError
from tests.bench.timing import Ratio

say = Sentences(__file__)

HISTORY = "history.jsonl"

MARGIN = 0.2
"""A ratio is worse only when it fell by more than this share plus what it spread within either run."""


@dataclasses.dataclass(frozen=True, slots=True)
class Entry:
    """One run: when (ISO 8601), what it was asked and on which machine (compared only when both agree), versions, ratios."""

    time: str
    asked: Mapping[str, Any]
    machine: Mapping[str, str]
    versions: Mapping[str, str]
    ratios: Mapping[str, Ratio]

    def line(self) -> str:
        """The entry as one line of JSON."""
        return json.dumps(dataclasses.asdict(self), ensure_ascii=False)


def key(family: str, ratio: Ratio) -> str:
    """What a ratio is called in the history."""
    return f"{family}: {ratio.label} over {ratio.than}"


def load_history(folder: pathlib.Path) -> list[Entry]:
    """Every entry kept in `folder`, oldest first. Raises `FileError` when a line is damaged."""
    path = folder / HISTORY
    if not path.exists():
        return []
    entries = []
    try:
        lines = path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: cannot be read ({error}).") from error
    for number, line in enumerate(lines, start=1):
        try:
            content = json.loads(line)
            ratios = {name: Ratio(**ratio) for name, ratio in content.pop("ratios").items()}
            entries.append(Entry(**content, ratios=ratios))
        except (ValueError, TypeError, AttributeError, KeyError) as error:
            raise FileError(
                f"{path}, line {number}: not an entry of the history; delete the line, or the file to begin anew."
            ) from error
    return entries


def keep(folder: pathlib.Path, entries: Sequence[Entry]) -> None:
    """Write the history; the file appears whole or not at all."""
    write_atomically(folder / HISTORY, "".join(entry.line() + "\n" for entry in entries).encode())


def last_alike(entries: Sequence[Entry], now: Entry) -> Entry | None:
    """The latest entry of the same machine that was asked the same."""
    return next((e for e in reversed(entries) if e.machine == now.machine and e.asked == now.asked), None)


def compared(entries: Sequence[Entry], now: Entry) -> tuple[str, ...]:
    """Sentences: which ratios got worse since the last run alike by more than the noise margin, or that none did."""
    before = last_alike(entries, now)
    if before is None:
        return (say("runs_not_alike") if entries else say("no_earlier_run"),)
    common = [name for name in now.ratios if name in before.ratios]
    worse = []
    for name in common:
        old, new = before.ratios[name], now.ratios[name]
        margin = margin_of(old, new)
        if new.value < old.value * (1.0 - margin):
            worse.append((new.value / old.value, name, margin))
    sentences = [
        say(
            "worse",
            time=before.time,
            name=name,
            before=before.ratios[name].value,
            now=now.ratios[name].value,
            margin=margin,
        )
        for _, name, margin in sorted(worse)
    ]
    sentences += [say("gone", time=before.time, name=name) for name in before.ratios if name not in now.ratios]
    if not worse:
        sentences.insert(0, say("none_worse", count=len(common), time=before.time, margin=MARGIN))
    return tuple(sentences)


def margin_of(before: Ratio, now: Ratio) -> float:
    """By which share a ratio may fall without being called worse: `MARGIN` and both spreads, below 90 %."""
    spread = sum(ratio.spread for ratio in (before, now) if math.isfinite(ratio.spread))
    return min(MARGIN + spread, 0.9)
