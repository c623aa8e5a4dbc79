"""Allocations of a solve, counted in a process of its own."""

from __future__ import annotations

import subprocess
from typing import Any

import pytest

from tests.bench.allocations import ALLOCATING, allocations


def test_what_a_solve_allocates_is_counted() -> None:
    rows, sentence = allocations(
        ["null space", "reverse priority", "QP ProxQP"], ["7_3-3", "7_limits", "humanoid_40", "100"]
    )
    assert sentence == ""
    found = {(row.label, row.family): row for row in rows}
    assert set(found) == {
        ("null space", "7_3-3"), ("null space", "100"),
        ("reverse priority", "7_3-3"), ("reverse priority", "100"),
        ("QP ProxQP", "7_3-3"), ("QP ProxQP", "7_limits"), ("QP ProxQP", "humanoid_40"), ("QP ProxQP", "100"),
    }  # fmt: skip
    for (_, family), row in found.items():
        assert row.kept >= 8 * {"100": 100, "humanoid_40": 38}.get(family, 7)  # x itself
        assert row.arrays >= 0
        assert row.beyond >= 0
    assert found["null space", "7_3-3"].arrays == found["reverse priority", "7_3-3"].arrays == 0
    # The cascade works in the workspace it keeps between calls; what Python holds inside a call is no matrix.
    assert found["QP ProxQP", "100"].arrays == found["QP ProxQP", "7_3-3"].arrays == 0
    assert found["QP ProxQP", "100"].beyond < 8 * 100
    assert found["QP ProxQP", "7_limits"].arrays == 0
    assert found["QP ProxQP", "humanoid_40"].arrays == 0
    assert max(row.beyond for row in rows if row.label == "QP ProxQP") < 8 * 38 * 38


@pytest.mark.parametrize(
    ("code", "output", "words"),
    [
        (1, "", "ended with 'RuntimeError: no runtime'"),
        (0, "[[0.0, 5000.0, 0.0], []]\n", "does not report those of a probe"),
        (0, "[[3.0, 500.0, 0.0], []]\n", "does not report those of a probe"),
    ],
)
def test_what_is_not_counted_is_said(monkeypatch: pytest.MonkeyPatch, code: int, output: str, words: str) -> None:
    def run(*arguments: Any, **named: Any) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess([], code, output, "Traceback\nRuntimeError: no runtime\n")

    monkeypatch.setattr(subprocess, "run", run)
    rows, sentence = allocations(ALLOCATING, ["7_3-3"])
    assert rows == ()
    assert words in sentence
