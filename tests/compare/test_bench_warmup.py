"""Compilation ahead of time, and what an empty cache costs."""

from __future__ import annotations

import dataclasses
import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from hqp_rp.compare import bench_warmup
from hqp_rp.compare.bench_warmup import Compiled, Warmup, compile_from_nothing


def test_nested_compile_times_are_each_kernels_own() -> None:
    from hqp_rp.compare.bench_warmup import _own_seconds

    def outer() -> None: ...
    def inner() -> None: ...
    def library() -> None: ...

    outer.__module__ = inner.__module__ = "hqp_rp.core.kernels.fake"
    library.__module__ = "numba.np.linalg"

    @dataclasses.dataclass
    class Dispatcher:
        py_func: object

    @dataclasses.dataclass
    class Event:
        is_start: bool
        function: object

        @property
        def data(self) -> dict[str, object]:
            return {"dispatcher": Dispatcher(self.function)}

    events = [(0.0, Event(True, outer)), (1.0, Event(True, inner)), (2.0, Event(True, library)),
              (4.0, Event(False, library)), (5.0, Event(False, inner)), (10.0, Event(False, outer))]  # fmt: skip
    found = {item.name: item.seconds for item in _own_seconds(events)}
    assert found == {"fake.outer": 6.0, "fake.inner": 4.0}


def test_an_empty_cache_is_given_to_a_fresh_process(monkeypatch: pytest.MonkeyPatch) -> None:
    told = Warmup((Compiled("cascade.null_space", 3.5),), 0, 60.0, ())
    caches = []

    def run(command: Sequence[str], **named: Any) -> subprocess.CompletedProcess[str]:
        cache = Path(named["env"]["NUMBA_CACHE_DIR"])
        caches.append(cache)
        assert list(cache.iterdir()) == []
        assert command[1:] == ["-m", "hqp_rp.compare.bench_warmup"]
        return subprocess.CompletedProcess(command, 0, f"a remark\n{json.dumps(dataclasses.asdict(told))}\n", "")

    monkeypatch.setattr(bench_warmup.subprocess, "run", run)
    assert compile_from_nothing() == told
    assert not caches[0].exists()
