"""A whole run: what it may be asked, what the report must hold, what it writes."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hqp_rp.core.errors import SettingError, UnknownNameError
from tests.bench import measure as bench_measure
from tests.bench.accuracy import Accuracy
from tests.bench.bench import EVERY_FAMILY, bench, checked
from tests.bench.entrants import our_entrants
from tests.bench.history import HISTORY, Entry
from tests.bench.inside import Inside
from tests.bench.measure import Asked, Measured, Result, Row, headline_ratios
from tests.bench.ratios_report import ratios_section
from tests.bench.record import Bench
from tests.bench.report import answer, bench_report
from tests.bench.timing import Ratio, timing


def entry(values: dict[str, float], *, machine: str = "m", quick: bool = False, spread: float = 0.0) -> Entry:
    ratios = {name: Ratio("own", "other", value, spread) for name, value in values.items()}
    return Entry("2026-01-01T00:00:00+00:00", {"quick": quick}, {"processor": machine}, {"hqp_rp": "1"}, ratios)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"families": ["7_3-4"]}, UnknownNameError, "7_3-3"),
        ({"peers": ["minkk"]}, UnknownNameError, "mink"),
        ({"peer_python": ["/no/such/python"]}, SettingError, "does not exist"),
        ({"lexls": "/no/such/checkout"}, SettingError, "give a checkout"),
    ],
)
def test_wrong_input_names_the_remedy(
    arguments: dict[str, Any], error: type[Exception], words: str, tmp_path: Path
) -> None:
    with pytest.raises(error, match=words):
        bench(tmp_path / "out", **arguments)
    assert not (tmp_path / "out").exists()


def test_all_families_and_peers_without_a_choice() -> None:
    assert checked(None, None, (), False).families == EVERY_FAMILY
    assert checked(["100", "7_3-3"], ["mink"], (), True) == Asked(("7_3-3", "100"), ("mink",), (), True)


def synthetic() -> Measured:
    def row(label: str, peer: bool, ns: int, certified: int) -> Row:
        accuracy = Accuracy(4, 4, certified, 1e-12 if certified == 4 else 0.3, 1e-13, "" if certified == 4 else "fault")
        return Row(label, peer, f"settings of {label}", timing(label, np.repeat([ns], 20)), accuracy)

    rows = (
        row("null space", False, 2000, 4),
        row("reverse priority", False, 1000, 0),
        row("DAQP, accurate", True, 8000, 4),
        row("DAQP, defaults", True, 500, 0),
    )
    result = Result("7_3-3", "7 joints, 3+3", "A and b normal", rows, {"weighted": "It refuses."})
    return Measured(
        (result,), ("pink is not installed.",), {}, {"levels": {"null space": [(1.0, 1e-6), (2.0, 2e-6)]}},
        (("null_space", 1, 1e6),), {"import": 0.1, "null_space": 0.4}, {}, "No counts here.",
    )  # fmt: skip


def test_only_certified_solvers_of_ours_get_ratios() -> None:
    found = {(item.label, item.than): item.value for _, item in headline_ratios(synthetic())}
    assert found == {
        ("null space", "DAQP, accurate"): pytest.approx(4.0),
        ("null space", "DAQP, defaults"): pytest.approx(0.25),
    }


def test_what_is_wrong_with_a_peer_is_said() -> None:
    def row(label: str, peer: bool, accuracy: Accuracy) -> Row:
        return Row(label, peer, "", timing(label, np.repeat([1000], 20)), accuracy)

    rows = (
        row("null space", False, Accuracy(16, 16, 16, 1e-12, 1e-13)),
        row("a", True, Accuracy(16, 16, 12, 0.25, 0.1, "fault")),
        row("b", True, Accuracy(16, 13, 13, 8e-10, 1e-9, "There is no answer.")),
        row("c", True, Accuracy(16, 13, 12, 0.25, 0.1, "fault")),
    )
    measured = dataclasses.replace(synthetic(), results=(Result("7_3-3", "7 joints", "", rows, {}),))
    (table,) = ratios_section(measured).sections[0].tables
    assert table.caption == (
        "Peers that were not certified: a (error 0.25), b (no answer on 3 of 16) and c (no answer on 3 of 16, error 0.25)."
    )


def test_the_answer_compares_certified_with_certified() -> None:
    told = answer(synthetic())
    assert (
        told[0] == "7 joints, 3+3: null space, 2 us, is 4 times as fast as the fastest certified peer, DAQP, accurate."
    )
    assert "at most 0.4 s (null_space)" in told[-1]


def test_the_report_holds_what_it_must(tmp_path: Path) -> None:
    done = Bench(synthetic(), ("Nothing to compare with.",), entry({"a": 1.0}), tmp_path)
    report = bench_report(done)
    titles = [section.title for section in report.sections]
    assert titles[:3] == ["The answer", "Ratios", "Against the last run"]
    groups = report.sections[1].sections
    assert [(group.title, [table.title for table in group.tables]) for group in groups] == [
        ("7 joints", ["7 joints, 3+3"])
    ]
    assert "How cost grows" in titles
    text = repr(report)
    for words in ("Nothing to compare with.", "pink is not installed.", "settings of DAQP, accurate", "It refuses.",
                  "No counts here.", "processor", "fault", "Not certified, so without ratios: reverse priority."):  # fmt: skip
        assert words in text
    assert [chart.name for chart in report.charts()] == ["ratios_7", "growth_levels"]


def test_a_run_writes_report_and_history(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Asked, "budget", property(lambda self: 0.002))
    monkeypatch.setattr(bench_measure, "start_up", lambda runs: {"import": 0.1, "null_space": 0.2})
    monkeypatch.setattr(bench_measure, "instruction_counts", lambda labels, calls: ({}, "No counts."))
    monkeypatch.setattr(bench_measure, "measure_inside", lambda families, **settings: Inside())
    monkeypatch.setattr(bench_measure, "our_entrants", lambda: [e for e in our_entrants() if e.label == "null space"])
    folder = tmp_path / "bench"
    for runs in (1, 2):
        found = bench(folder, families=["7_3-3"], peers=["numpy"], quick=True, fresh_process=False)
        lines = (folder / HISTORY).read_text().splitlines()
        assert len(lines) == runs
        assert list(json.loads(lines[-1])["ratios"]) == ["7_3-3: null space over numpy SVD cascade"]
    assert "no earlier run" not in found.against[0]
    assert (folder / "report.html").exists()
    assert (folder / "figures" / "ratios_7.png").exists()
    text = (folder / "report.md").read_text()
    assert "numpy SVD cascade" in text
    assert "**hqp" not in text
