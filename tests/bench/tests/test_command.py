"""The command of the benchmark: what it prints, and the codes it ends with."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import tests.bench.bench as bench_module
from hqp_rp.compare.exit_codes import INTERRUPTED, MISUSE
from tests.bench import ROOT
from tests.bench.command import main


def test_it_runs_as_a_module() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.bench", "--family", "none"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == MISUSE
    assert done.stdout == ""
    assert done.stderr.startswith("python -m tests.bench: There is no family of the benchmark named 'none'.")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--peer", "minkk"], "Did you mean 'mink'?"),
        (["--peer-python", "no/such/python"], "peer_python is 'no/such/python', which does not exist"),
        (["--lexls", "no/such/checkout"], "give a checkout"),
        (["--eigen", "no/such/folder"], "give lexls too"),
    ],
)
def test_wrong_input_is_one_line_and_code_two(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*arguments, "--quick", "--output", str(tmp_path / "bench")]) == MISUSE
    printed = capsys.readouterr().err
    assert words in printed
    assert printed.count("\n") == 1
    assert not (tmp_path / "bench").exists()


def test_a_folder_with_other_files_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.txt").write_text("kept")
    assert main(["--family", "7_3-3", "--quick", "--output", str(tmp_path)]) == MISUSE
    assert "holds files that no benchmark wrote; give an empty or a new folder as --output" in capsys.readouterr().err


def test_an_interrupt_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(bench_module, "bench", stopped)
    assert main(["--output", str(tmp_path)]) == INTERRUPTED
    assert capsys.readouterr().err == "Stopped.\n"
