"""What a result was made by: the sources that count, wherever they are kept."""

from __future__ import annotations

import pathlib

import pytest

import hqp_rp
from hqp_rp.compare import machine as module

ROOT = pathlib.Path(hqp_rp.__file__).parent


def test_what_runs_and_judges_counts_and_reports_do_not() -> None:
    names = {path.relative_to(ROOT).as_posix() for path in module._sources(ROOT)}
    assert {"core/problem.py", "solvers/null_space.py", "scenarios/scenario.py"} <= names
    assert {"compare/measure/units.py", "compare/stress/judge.py"} <= names
    assert not any("report" in name for name in names)


def test_the_digest_follows_a_judge_and_a_missing_one_is_an_error(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge = tmp_path / "compare" / "judge.py"
    judge.parent.mkdir()
    monkeypatch.setattr(hqp_rp, "__file__", str(tmp_path / "__init__.py"))
    monkeypatch.setattr(module, "_JUDGES", ("judge.py",))
    digest = module.source_digest.__wrapped__
    with pytest.raises(FileNotFoundError):
        digest()
    judge.write_text("x = 1\n")
    before = digest()
    judge.write_text("x = 2\n")
    assert digest() != before
