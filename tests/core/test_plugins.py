"""Solvers of other packages: found by entry points, refused in one warning, named on the command line by module and class."""

from __future__ import annotations

import importlib.metadata
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from hqp_rp import SettingError, Solver, UnknownNameError
from hqp_rp.compare.settings_text import parse_contestant
from hqp_rp.core.plugins import plugins
from hqp_rp.solvers.null_space import NullSpace

ROOT = Path(__file__).parents[2]
MODULE = """
import dataclasses
from typing import ClassVar
from hqp_rp.solvers.null_space import NullSpace

@dataclasses.dataclass(frozen=True, kw_only=True)
class Mine(NullSpace):
    name: ClassVar[str] = "mine"

broken = 1 / 0 if __name__ == "never" else 7
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "somebodys_solvers.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    return "somebodys_solvers"


def offered(monkeypatch: pytest.MonkeyPatch, *values: str) -> None:
    entries = [importlib.metadata.EntryPoint(f"entry{i}", value, "hqp_rp.solvers") for i, value in enumerate(values)]
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: entries if group == "hqp_rp.solvers" else [])


def test_a_solver_is_found(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    offered(monkeypatch, f"{module}:Mine")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = plugins("hqp_rp.solvers", Solver, {})  # type: ignore[type-abstract]
    assert list(found) == ["mine"]
    assert found["mine"]().name == "mine"


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("no_such_module:Mine", "cannot be loaded: ModuleNotFoundError"),
        ("somebodys_solvers:Other", "cannot be loaded: AttributeError"),
        ("somebodys_solvers:broken", "is 7, not a Solver with a name"),
        ("hqp_rp.core.solver:Solver", "not a Solver with a name"),
        ("hqp_rp.solvers.null_space:NullSpace", "is named 'null_space', as another is"),
    ],
)
def test_what_cannot_be_used_is_said(module: str, monkeypatch: pytest.MonkeyPatch, value: str, words: str) -> None:
    offered(monkeypatch, value)
    with pytest.warns(UserWarning, match=words):
        assert plugins("hqp_rp.solvers", Solver, {"null_space": NullSpace}) == {}  # type: ignore[type-abstract]


def test_a_class_on_the_command_line(module: str) -> None:
    solver = parse_contestant(f"{module}:Mine:rank_tolerance=1e-9")
    assert (solver.name, solver.rank_tolerance) == ("mine", 1e-9)  # type: ignore[attr-defined]
    assert parse_contestant(f"{module}:Mine").name == "mine"
    with pytest.raises(SettingError, match="somebodys_solvers:Nothing cannot be imported"):
        parse_contestant(f"{module}:Nothing")
    with pytest.raises(SettingError, match=r"somebodys_solvers:broken is 7; it must be a subclass of hqp_rp\.Solver"):
        parse_contestant(f"{module}:broken")
    with pytest.raises(UnknownNameError, match="no solver named 'null_spice'"):
        parse_contestant("null_spice:variant=basis")


def test_a_reader_that_has_enough() -> None:
    command = f"{sys.executable} -m hqp_rp.script scenarios | head -n 1; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.returncode in (0, 141)
    assert len(done.stdout.splitlines()) == 1
