"""Solvers of other packages: found by entry points, refused in one warning, named on the command line by module and class."""

from __future__ import annotations

import importlib.metadata
import os
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from hqp_rp import Level, Problem, SettingError, Solver, UnknownNameError, save_problem
from hqp_rp.compare.contestants import choose_contestants
from hqp_rp.compare.settings_text import parse_contestant
from hqp_rp.compare.stress.worst import spelled
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


@pytest.mark.parametrize(("module_text", "told"), [("1 / 0", "ZeroDivisionError"), ("def (", "SyntaxError")])
def test_a_module_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module_text: str, told: str) -> None:
    name = f"fails_with_{told.lower()}"
    (tmp_path / f"{name}.py").write_text(module_text)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(SettingError, match=rf"{name}:Mine cannot be imported: {told}: .* Give package\.module:Class"):
        parse_contestant(f"{name}:Mine")


SCENARIO = """
from collections.abc import Iterator
import dataclasses
from typing import ClassVar
from hqp_rp.scenarios.scenario import Scenario, Step

@dataclasses.dataclass(frozen=True, kw_only=True)
class Asks(Scenario):
    name: ClassVar[str] = "asks"
    question: ClassVar[str] = "Is it found?"
    cannot_tell: ClassVar[tuple[str, ...]] = ()
    abscissa: ClassVar[str] = "step"
    def steps(self, solver, seed):
        yield from ()
    def length(self):
        return 0
    def quick(self):
        return self
"""


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A folder with an installed package: a solver, a scenario, and two entry points that are broken."""
    (tmp_path / "somebodys_solvers.py").write_text(MODULE)
    (tmp_path / "somebodys_scenarios.py").write_text(SCENARIO)
    (tmp_path / "leaves.py").write_text("raise SystemExit(3)")
    info = tmp_path / "somebodys-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: somebodys\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[hqp_rp.solvers]\nmine = somebodys_solvers:Mine\ngone = no_such_module:Gone\nleaves = leaves:Mine\n"
        "[hqp_rp.scenarios]\nasks = somebodys_scenarios:Asks\n"
    )
    return tmp_path


def program(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Python with these arguments in `folder`, which is on no path by itself."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-P", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_an_installed_package(installed: Path) -> None:
    code = f"""
import sys, warnings
sys.path.append({str(installed)!r})
warnings.simplefilter("error")
import hqp_rp
assert "somebodys_solvers" not in sys.modules
with warnings.catch_warnings(record=True) as told:
    warnings.simplefilter("always")
    solver = hqp_rp.get_solver("mine", rank_tolerance=1e-9)
    hqp_rp.all_solvers()
from hqp_rp.scenarios.scenario import get_scenario
print(solver.name, "null_space" in hqp_rp.all_solvers(), get_scenario("asks").question)
for warning in told:
    print(warning.message)
"""
    done = program(installed, "-c", code)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "mine True Is it found?",
        "The entry point 'gone' of hqp_rp.solvers (no_such_module:Gone) cannot be loaded: ModuleNotFoundError: No module named "
        "'no_such_module'; it is left out. Mend or uninstall its package.",
        "The entry point 'leaves' of hqp_rp.solvers (leaves:Mine) cannot be loaded: SystemExit: 3; it is left out. Mend or "
        "uninstall its package.",
    ]


def test_a_class_of_a_file_beside_the_user(module: str, tmp_path: Path) -> None:
    problem = Problem([Level.equality([[1.0, 2.0]], [3.0])])
    save_problem(problem, tmp_path / "case.npz")
    done = program(tmp_path, "-m", "hqp_rp.script", "replay", "case.npz", "--solver", f"{module}:Mine")
    assert done.returncode == 0, done.stderr
    assert "Mine(" in done.stdout
    assert "SOLVED" in done.stdout
    done = program(tmp_path, "-m", "hqp_rp.script", "replay", "case.npz", "--solver", f"{module}:None_of_it")
    assert done.returncode == 2
    assert done.stderr.startswith("hqp-rp: somebodys_solvers:None_of_it cannot be imported: AttributeError")


def test_a_class_is_spelled_as_the_command_line_takes_it(module: str) -> None:
    solver = parse_contestant(f"{module}:Mine:rank_tolerance=1e-09")
    assert spelled(solver) == f"{module}:Mine:rank_tolerance=1e-09"
    assert parse_contestant(spelled(solver)) == solver
    assert spelled(NullSpace()) == "null_space"
    (chosen,) = choose_contestants([f"{module}:Mine"])
    assert (chosen.label, chosen.solver.name) == (f"{module}:Mine", "mine")


@pytest.mark.parametrize("command", ["scenarios", "solvers", "--help", "compare --help"])
@pytest.mark.parametrize("lines", [0, 1])
def test_a_reader_that_has_enough(command: str, lines: int) -> None:
    line = f"{sys.executable} -m hqp_rp.script {command} | head -n {lines}; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", line], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.returncode in (0, 141)
    assert len(done.stdout.splitlines()) == lines
