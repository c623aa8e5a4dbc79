"""The command line: what it prints and the codes it ends with."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import hqp_rp.compare.comparison.comparison as comparison_module
from hqp_rp import all_solvers
from hqp_rp.compare.command_line import main
from hqp_rp.compare.exit_codes import INTERRUPTED, MISUSE
from hqp_rp.scenarios.scenario import all_scenarios


def test_solvers_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solvers"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    for name, kind in all_solvers().items():
        assert name in printed
        assert " ".join(kind.source.split()) in printed
    assert "equalities, two-sided rows, hard rows" in printed
    assert "damping=none" in printed


def test_scenarios_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenarios"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    for name, kind in all_scenarios().items():
        assert name in printed
        assert kind.question in printed


def test_compare_writes_a_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["compare", "--scenario", "near_singular_family", "--solver", "null_space:variant=basis", "--solver",
                 "reverse_priority:damping=constant(0.2)", "--quick", "--workers", "1", "--output", str(tmp_path)]  # fmt: skip
    assert main(arguments) == 0
    printed = capsys.readouterr()
    assert f"The report: {tmp_path / 'report.html'}" in printed.out
    assert "Accuracy: null space stays within" in printed.out
    text = (tmp_path / "report.md").read_text()
    assert "reverse_priority:damping=constant(0.2)" in text
    assert "near_singular_family" in text
    assert "planar" not in text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--solver", "nul_space"], "Did you mean 'null_space'?"),
        (["--scenario", "family"], "There is no scenario named 'family'."),
        (["--solver", "null_space:damping=constant(x)"], "factor must be a number"),
        (["--seeds", "0"], "seeds is 0"),
        (["--workers", "-1"], "workers is -1"),
    ],
)
def test_wrong_input_is_one_line_and_code_two(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "report"
    assert main(["compare", *arguments, "--quick", "--output", str(folder)]) == MISUSE
    printed = capsys.readouterr().err
    assert words in printed
    assert printed.count("\n") == 1
    assert not (folder / "report.md").exists()


def test_an_interrupt_says_how_to_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(comparison_module, "compare", stopped)
    assert main(["compare", "--output", str(tmp_path)]) == INTERRUPTED
    assert "the same command goes on from there" in capsys.readouterr().err


def test_the_benchmark_says_where_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--quick", "--family", "7_3-3"]) == MISUSE
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert printed.err.startswith("hqp-rp: bench is no subcommand: ")
    assert "python -m tests.bench with the same options (docs/bench.md)" in printed.err


def test_listing_solvers_loads_nothing_heavy() -> None:
    code = (
        "import sys; from hqp_rp.compare.command_line import main; main(['solvers']);"
        "heavy = {'polars', 'plotly', 'matplotlib', 'mujoco', 'joblib'} & set(sys.modules);"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
