"""What a benchmark measured, as plain data."""

from __future__ import annotations

import dataclasses
import pathlib

from tests.bench.history import Entry
from tests.bench.measure import Measured


@dataclasses.dataclass(frozen=True, slots=True)
class Bench:
    """A finished benchmark.

    Attributes:
        measured: all figures. against: sentences on the last kept run. entry: what was added to the history.
        folder: where the report was written.
    """

    measured: Measured
    against: tuple[str, ...]
    entry: Entry
    folder: pathlib.Path
