"""The study from end to end: files, resuming, wrong input, and the command."""

from __future__ import annotations

import pathlib

import pytest

from hqp_rp import SettingError, UnknownNameError
from hqp_rp.compare.command_line import main
from hqp_rp.compare.exit_codes import MISUSE
from hqp_rp.compare.statistics import Design, statistics
from hqp_rp.compare.statistics import study as module
from hqp_rp.compare.statistics.trials import run_unit
from hqp_rp.compare.statistics.verdicts import NO, YES

DESIGN = Design(configurations=2, paths=2, samples=21)
SOLVERS = ("null_space:damping=constant(0.2)", "hierarchical_active_set", "reverse_priority_in_order")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("statistics") / "report"
    statistics(DESIGN, arms=["planar4"], solvers=SOLVERS, output=folder, workers=1)
    return folder


def test_a_report_with_its_picture_is_written(folder: pathlib.Path) -> None:
    text = (folder / "report.md").read_text()
    assert (folder / "report.html").exists()
    assert (folder / "figures" / "passages.png").read_bytes().startswith(b"\x89PNG")
    assert text.index("figures/passages.png") < text.index("## What was asked")
    for words in ("4**: paths", "planar arm of 4 joints", "Keeps level 2", "reverse in order", "What this cannot tell"):
        assert words in text


def test_verdicts_are_those_of_the_methods(folder: pathlib.Path) -> None:
    found = statistics(DESIGN, arms=["planar4"], solvers=SOLVERS, output=folder, workers=1)
    words = {result.contestant: [verdict.word for verdict in result.verdicts.values()] for result in found.results}
    assert words["active set"][:2] == [YES, YES]
    assert words["active set"][2] != YES
    assert words["reverse in order"][0] == words["reverse in order"][2] == YES
    assert words["null_space:damping=constant(0.2)"][0] == NO


def test_what_is_finished_is_not_run_again(folder: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = sorted((folder / "parts").glob("*.parquet"))
    assert [part.stem for part in parts] == ["planar4-000", "planar4-001"]
    parts[0].unlink()
    ran = []
    monkeypatch.setattr(module, "run_unit", lambda unit: ran.append(unit.key) or run_unit(unit))
    statistics(DESIGN, arms=["planar4"], solvers=SOLVERS, output=folder, workers=1)
    assert ran == ["planar4-000"]


def test_workers_change_no_row() -> None:
    one, two = (
        statistics(DESIGN, arms=["planar4"], solvers=["null_space:variant=basis"], workers=workers)
        for workers in (1, 2)
    )
    assert one.rows.drop("time").equals(two.rows.drop("time"))
    assert one.folder is None


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"design": 3}, SettingError, "design is a int"),
        ({"workers": 0}, SettingError, "workers is 0"),
        ({"arms": "sawyer"}, SettingError, "give a list of names"),
        ({"arms": ["sawjer"]}, UnknownNameError, "sawyer"),
        ({"design": Design(configurations=100_000)}, SettingError, "at most"),
    ],
)
def test_wrong_input_is_told_before_any_work(
    given: dict[str, object], error: type[Exception], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "run_unit", lambda unit: pytest.fail("it ran"))
    if "design" in given and isinstance(given["design"], Design):
        monkeypatch.setattr("hqp_rp.compare.statistics.passages.search_singularities", lambda *a, **k: [])
    with pytest.raises(error, match=words):
        statistics(**{"arms": ["planar4"], **given})


def test_the_command(folder: pathlib.Path, tmp_path: pathlib.Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["statistics", "--arm", "planar4", "--configurations", "1", "--paths", "1", "--solver", "pseudo_inverse"]
    assert main([*asked, "--quick", "--workers", "1", "--output", str(tmp_path / "a")]) == 0
    assert f"The report: {tmp_path / 'a' / 'report.html'}" in capsys.readouterr().out
    assert main(["statistics", "--arm", "planar", "--output", str(tmp_path / "b")]) == MISUSE
    assert "planar4" in capsys.readouterr().err
    assert not (tmp_path / "b").exists()
