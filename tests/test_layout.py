"""The shape of the project: what may import what, what a wheel holds, what every file must not name."""

from __future__ import annotations

import ast
import importlib
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import hqp_rp
from hqp_rp.scenarios.scenario import all_scenarios

ROOT = Path(__file__).parents[1]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
LINKED = ("solvers", "scenarios")
PARTS = ("hqp_rp", *LINKED)
BENCHMARK = "tests/bench"


def _run(command: list[str], cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    env = dict(os.environ) | environment
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False)


def _copy_package(to: Path) -> None:
    """What a wheel is built from, and the benchmark, which it must leave out."""
    for part in (*PARTS, BENCHMARK):
        shutil.copytree(
            ROOT / part, to / part, symlinks=True, ignore=shutil.ignore_patterns("__pycache__", "_native*.so")
        )
    for name in ("pyproject.toml", "MANIFEST.in", "README.md", "LICENSE", "tests/__init__.py"):
        shutil.copy(ROOT / name, to / name)


def _lint_imports(folder: Path) -> subprocess.CompletedProcess[str]:
    program = "from importlinter.cli import lint_imports_command; lint_imports_command(['--no-cache'])"
    return _run([sys.executable, "-c", program], folder, PYTHONPATH=str(folder))


# --- imports ---------------------------------------------------------------------------------------------------------


def test_imports_run_one_way() -> None:
    done = _lint_imports(ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("file", "line", "chain"),
    [
        ("hqp_rp/core/stray.py", "import hqp_rp.robot.robot", "hqp_rp.core.stray -> hqp_rp.robot.robot"),
        ("hqp_rp/control/stray.py", "import hqp_rp.scenarios.scenario", "control.stray -> hqp_rp.scenarios.scenario"),
        ("scenarios/stray.py", "import hqp_rp.solvers.null_space", "scenarios.stray -> hqp_rp.solvers.null_space"),
        ("solvers/stray.py", "from hqp_rp.robot import robot", "solvers.stray -> hqp_rp.robot.robot"),
        ("hqp_rp/compare/stray.py", "import tests.bench.timing", "hqp_rp.compare.stray -> tests.bench.timing"),
    ],
)
def test_an_import_against_the_direction_is_found(file: str, line: str, chain: str, tmp_path: Path) -> None:
    _copy_package(tmp_path)
    (tmp_path / file).write_text(line + "\n", encoding="utf-8")
    done = _lint_imports(tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    assert chain in done.stdout


def test_no_solver_is_chosen_by_name_below_compare() -> None:
    names = set(hqp_rp.all_solvers())
    folders = [ROOT / "hqp_rp" / part for part in ("core", "robot", "control")] + [ROOT / "scenarios"]
    for path in [file for folder in folders for file in folder.rglob("*.py")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            found = isinstance(node, ast.Constant) and node.value in names
            assert not found, f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 0)} names a solver: be handed one"


@pytest.mark.parametrize("name", LINKED)
def test_a_linked_folder_refuses_its_bare_name(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))
    with pytest.raises(ImportError, match=f"import hqp_rp.{name}, not {name}"):
        importlib.import_module(name)


def test_importing_the_library_stays_light() -> None:
    program = "import sys, hqp_rp; hqp_rp.Problem; print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    done = _run([sys.executable, "-c", program], ROOT)
    assert done.returncode == 0, done.stderr
    own = re.split(r"[>=\[ ]", " ".join(PYPROJECT["project"]["dependencies"]))
    heavy = {"pinocchio", "flint", "mujoco", "polars", "matplotlib", "scipy", *own} - {"numpy"}
    assert not heavy & set(done.stdout.split())


# --- what is installed ----------------------------------------------------------------------------------------------


compiles = pytest.mark.timeout(900)
"""The core is compiled: minutes on a machine that does other work too."""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an sdist, and with a wheel made from that sdist, both built offline."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("built")
    _copy_package(source)
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(source)]
    done = _run(command, source, PIP_NO_INDEX="1")
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def _files_to_ship(native: bool = False) -> set[str]:
    """Every file of the package by the name that an import gives it, the linked folders included.

    native: the C++ sources too, which a wheel does not need.
    """
    found = set()
    for part in PARTS:
        for path in (ROOT / part).rglob("*"):
            built = "__pycache__" in path.parts or path.suffix in {".so", ".pyd"}
            if path.is_file() and not built and (native or "native" not in path.parts):
                name = path.relative_to(ROOT).as_posix()
                found.add(name if part == "hqp_rp" else f"hqp_rp/{name}")
    return found


@compiles
def test_wheel_holds_every_file(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    held = set(zipfile.ZipFile(wheel).namelist())
    assert {"hqp_rp/py.typed", "hqp_rp/solvers/__init__.py", "hqp_rp/scenarios/scenario.py"} <= held
    assert not _files_to_ship() - held
    assert [name for name in held if name.startswith("hqp_rp/core/_native") and not name.endswith(".pyi")]
    assert not [name for name in held if name.startswith("hqp_rp/core/native/")]
    assert not {name for name in held if name.split("/")[0] not in {"hqp_rp", f"hqp_rp-{hqp_rp.__version__}.dist-info"}}


@compiles
def test_wheel_holds_nothing_of_the_benchmark(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    held = zipfile.ZipFile(wheel).namelist()
    library = {path.name for part in PARTS for path in (ROOT / part).rglob("*")}
    own = {path.name for path in (ROOT / BENCHMARK).rglob("*") if path.is_file() and path.suffix != ".pyc"} - library
    assert {"cascade.c", "peer_worker.py", "entrants.py"} <= own
    assert not own & {name.rpartition("/")[2] for name in held}
    assert not [name for name in held if "bench" in name.split("/")]


@compiles
def test_sdist_holds_every_file(built: Path) -> None:
    (sdist,) = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        held = {member.name.partition("/")[2] for member in archive.getmembers() if member.isfile()}
    assert not _files_to_ship(native=True) - held
    assert {"LICENSE", "README.md", "pyproject.toml"} <= held


@compiles
def test_wheel_works(built: Path, tmp_path: Path) -> None:
    (wheel,) = built.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(tmp_path)
    # Files where folders would have to be made: even a superuser cannot write there, and nothing has to.
    (tmp_path / "no_home").touch()
    program = (
        "import hqp_rp, numpy as np, hqp_rp.scenarios.scenario as scenario\n"
        f"assert hqp_rp.__file__.startswith({str(tmp_path)!r}), hqp_rp.__file__\n"
        f"assert list(hqp_rp.all_solvers()) == {list(hqp_rp.all_solvers())!r}\n"
        f"assert list(scenario.all_scenarios()) == {list(all_scenarios())!r}\n"
        "problem = hqp_rp.Problem([hqp_rp.Level.equality(np.eye(2, 3), [1.0, 2.0])])\n"
        "assert np.allclose(hqp_rp.solve(problem, 'qp_cascade').x, [1.0, 2.0, 0.0])\n"
        "assert np.allclose(hqp_rp.solve(problem, 'hierarchical_active_set').x, [1.0, 2.0, 0.0])\n"
    )
    nowhere = str(tmp_path / "no_home")
    command = [sys.executable, "-B", "-c", program]
    done = _run(command, tmp_path, PYTHONPATH=str(tmp_path), HOME=nowhere, XDG_CACHE_HOME=nowhere)
    assert done.returncode == 0, done.stdout + done.stderr
    smoke = [sys.executable, str(ROOT / "tests" / "wheel_smoke.py")]
    done = _run(smoke, tmp_path, PYTHONPATH=str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr


@compiles
def test_numpy_is_all_that_is_required(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    archive = zipfile.ZipFile(wheel)
    (metadata,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
    required = re.findall(r"^Requires-Dist: ([^;\n]+?)(;.*)?$", archive.read(metadata).decode(), re.MULTILINE)
    assert [name for name, condition in required if not condition] == ["numpy>=2.0"]


def test_one_version_everywhere() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert PYPROJECT["project"]["version"] == hqp_rp.__version__
    assert re.findall(r"^version: (.*)$", citation, re.MULTILINE) == [hqp_rp.__version__]
    assert re.findall(r"^## \[?([^\s\]]+)", changes, re.MULTILINE)[0] == hqp_rp.__version__


def test_tested_versions_cover_every_requirement() -> None:
    text = (ROOT / "constraints.txt").read_text(encoding="utf-8")
    pinned = dict(line.split("==") for line in text.lower().splitlines() if line and not line.startswith("#"))
    extras = PYPROJECT["project"]["optional-dependencies"].values()
    wanted = [*PYPROJECT["project"]["dependencies"], *(one for extra in extras for one in extra)]
    for requirement in map(Requirement, wanted):
        if requirement.name == "hqp-rp":
            continue
        assert requirement.name.lower() in pinned, f"constraints.txt pins no version of {requirement.name}"
        assert requirement.specifier.contains(pinned[requirement.name.lower()]), requirement


# --- what is in git --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def in_git() -> list[tuple[str, str]]:
    """(mode, path) of every file that git knows here."""
    done = _run(["git", "ls-files", "--stage", "-z"], ROOT)
    if done.returncode != 0:
        pytest.skip("this copy is no git checkout: " + done.stderr.strip())
    return [(entry.split()[0], entry.partition("\t")[2]) for entry in done.stdout.split("\0") if entry]


@pytest.mark.parametrize("name", LINKED)
def test_linked_folders_are_relative_links(name: str, in_git: list[tuple[str, str]]) -> None:
    assert ("120000", f"hqp_rp/{name}") in in_git
    assert os.readlink(ROOT / "hqp_rp" / name) == f"../{name}"


def test_no_file_names_a_registry_or_a_machine(in_git: list[tuple[str, str]]) -> None:
    # The hosts are put together here, so that this file does not name them either.
    hosts = [
        "py" + "pi.org",
        "python" + "hosted",
        "ana" + "conda.org",
        "npm" + "js",
        "crates" + ".io",
        "index" + "-url",
    ]
    absolute = re.compile(r"(?<![\w.}$])/(?:home|root|work|Users|opt|tmp|mnt)/[\w.]|[A-Z]:\\\\?Users")
    for mode, name in in_git:
        path = ROOT / name
        if mode == "120000" or not path.is_file():
            continue
        data = path.read_bytes()
        if b"\0" in data:
            continue
        for number, line in enumerate(data.decode("utf-8").splitlines(), 1):
            assert not [host for host in hosts if host in line.lower()], f"{name}:{number} names a package registry"
            assert not absolute.search(line), f"{name}:{number} names a folder of one machine: {line.strip()[:120]}"


# --- the Makefile ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("python", "said"), [("echo 'Python 3.9.2'; exit 1", "Python 3.9.2"), (None, "not found")])
def test_set_up_without_a_new_enough_python_says_so(python: str | None, said: str, tmp_path: Path) -> None:
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)
    fake = tmp_path / "fake-python"
    if python is not None:
        fake.write_text(f"#!/bin/sh\n{python}\n", encoding="utf-8")
        fake.chmod(0o755)
    done = _run(["make", "setup", f"PYTHON={fake}"], tmp_path)
    assert done.returncode != 0
    assert "hqp_rp needs Python 3.11 or later" in done.stderr
    assert said in done.stderr
    assert "PYTHON=/path/to/python3.11" in done.stderr
    assert not (tmp_path / ".venv").exists()
