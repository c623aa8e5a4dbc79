"""Every ```python block of README.md and of the pages in docs runs, and prints what the ```text block right behind it says.

The blocks of a file share one namespace, as a reader would type them. In the expected output numbers may differ by one
unit of their last printed digit, by 1e-6 of their size or by 1e-12 (rounding noise); `...` stands for anything, and a
line that has it compares by its text alone. A block whose first line is `# solvers/NAME.py` or `# scenarios/NAME.py` is
a whole file: put into that folder, it is found.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import io
import itertools
import os
import re
import shutil
import subprocess
import sys
import types
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# Reports are written by the tool and hold no code.
PAGES = [ROOT / "README.md", *(p for p in sorted((ROOT / "docs").rglob("*.md")) if "reports" not in p.parts)]
FENCE = re.compile(r"^```(?P<info>[^\n`]*)\n(?P<body>.*?)^```[ \t]*$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w])")
WHOLE_FILE = re.compile(r"# (?P<folder>solvers|scenarios)/(?P<name>\w+)\.py\n")


@dataclasses.dataclass(frozen=True)
class Block:
    """A python block, the line of the page that it starts on, and the output promised right behind it, if any."""

    code: str
    line: int
    output: str | None


def blocks_of(text: str) -> list[Block]:
    fences = list(FENCE.finditer(text))
    found = []
    for fence, after in itertools.zip_longest(fences, fences[1:]):
        if fence["info"].strip() != "python":
            continue
        promised = (
            after is not None and after["info"].strip() == "text" and not text[fence.end() : after.start()].strip()
        )
        line = text.count("\n", 0, fence.start()) + 2
        found.append(Block(fence["body"], line, after["body"] if after is not None and promised else None))
    return found


def mismatch(expected: str, actual: str) -> str | None:
    """The first line where `actual` is not what `expected` promises, as a sentence; None when there is none."""
    wanted, got = expected.strip().splitlines(), actual.strip().splitlines()
    for k in range(max(len(wanted), len(got))):
        want = wanted[k] if k < len(wanted) else "(nothing more)"
        have = got[k] if k < len(got) else "(nothing more)"
        if not _same_line(want, have):
            return f"line {k + 1} of the output is {have!r}, and the page promises {want!r}"
    return None


def _same_line(want: str, have: str) -> bool:
    # Numbers become a mark, so that the text around them compares exactly and they compare by value.
    pattern = re.escape("".join(_marked(want).split())).replace(re.escape("..."), ".*")
    if re.fullmatch(pattern, "".join(_marked(have).split())) is None:
        return False
    if "..." in want:
        return True
    return all(_same_number(a, b) for a, b in zip(NUMBER.findall(want), NUMBER.findall(have), strict=True))


def _marked(line: str) -> str:
    return NUMBER.sub("#", line)


def _same_number(want: str, have: str) -> bool:
    mantissa, _, exponent = want.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    unit = 10.0 ** (int(exponent or 0) - decimals) if "." in mantissa or exponent else 0.0
    return abs(float(want) - float(have)) <= max(1.001 * unit, 1e-6 * abs(float(want)), 1e-12)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_page_runs_and_prints_what_it_says(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    module = types.ModuleType(f"docs_{page.stem}")  # dataclasses look up the module that a class was written in
    monkeypatch.setitem(sys.modules, module.__name__, module)
    for block in blocks_of(page.read_text(encoding="utf-8")):
        printed = io.StringIO()
        code = compile("\n" * (block.line - 1) + block.code, str(page), "exec", dont_inherit=True)
        with contextlib.redirect_stdout(printed):
            exec(code, module.__dict__)
        if block.output is not None:
            wrong = mismatch(block.output, printed.getvalue())
            assert wrong is None, f"{page.name}:{block.line}: {wrong}\n\nthe block printed:\n{printed.getvalue()}"


@pytest.mark.parametrize("page", ["add_a_solver.md", "add_a_scenario.md"])
def test_whole_file_is_found_in_its_folder(page: str, tmp_path: Path) -> None:
    for folder in ("hqp_rp", "solvers", "scenarios"):
        shutil.copytree(ROOT / folder, tmp_path / folder, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    names: dict[str, list[str]] = {"solvers": [], "scenarios": []}
    for block in blocks_of((ROOT / "docs" / page).read_text(encoding="utf-8")):
        head = WHOLE_FILE.match(block.code)
        if head is not None:
            (tmp_path / head["folder"] / f"{head['name']}.py").write_text(block.code, encoding="utf-8")
            names[head["folder"]].append(head["name"])
    assert any(names.values()), f"docs/{page} shows no whole file"
    program = (
        "import hqp_rp, hqp_rp.scenarios.scenario as s\n"
        f"assert hqp_rp.__file__.startswith({str(tmp_path)!r}), hqp_rp.__file__\n"
        f"assert set({names['solvers']!r}) <= set(hqp_rp.all_solvers()), hqp_rp.all_solvers()\n"
        f"assert set({names['scenarios']!r}) <= set(s.all_scenarios()), s.all_scenarios()\n"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_a_block_without_output_right_behind_it_promises_nothing() -> None:
    text = "```python\na\n```\n\n```text\n1\n```\n\n```python\nb\n```\nwords\n```text\n2\n```\n```sh\nc\n```\n"
    assert blocks_of(text) == [Block("a\n", 2, "1\n"), Block("b\n", 10, None)]


@pytest.mark.parametrize(
    ("expected", "actual"),
    [
        ("x = 0.123", "x = 0.124"),  # the last printed digit
        ("[1. 2.]", "[ 1.  2.]"),
        ("error 2.1e-16", "error 0.0"),
        ("took ... s", "took 0.31 s"),
        ("rank 3\n", "\nrank 3"),
    ],
)
def test_output_that_agrees(expected: str, actual: str) -> None:
    assert mismatch(expected, actual) is None


@pytest.mark.parametrize(
    ("expected", "actual"),
    [
        ("x = 0.123", "x = 0.126"),
        ("rank 3", "rank 4"),
        ("1000", "1001"),
        ("level 'a'", "level 'b'"),
        ("1\n2", "1"),
        ("1", "1\n2"),
        ("1 2", "1 2 3"),
        ("took ... s", "took 0.31 h"),
        ("error 2.1e-16", "error 2.1e-06"),
        ("error 2.1e-16", "error nan"),
    ],
)
def test_output_that_does_not_agree(expected: str, actual: str) -> None:
    assert mismatch(expected, actual) is not None


def test_every_place_named_by_the_equation_table_exists() -> None:
    text = (ROOT / "docs" / "equations.md").read_text(encoding="utf-8")
    places = re.findall(r"`(core|robot|control|solvers|scenarios)/(\w+)\.py(?::(\w+))?`", text)
    for header in re.findall(r"`(core/native/[\w/.]+)`", text):
        assert (ROOT / "hqp_rp" / header).exists(), header
    assert len(places) >= 10
    for folder, module, name in places:
        found = importlib.import_module(f"hqp_rp.{folder}.{module}")
        assert not name or hasattr(found, name), f"{folder}/{module}.py has no {name}"


def test_the_code_of_the_readme_passes_mypy_strict(tmp_path: Path) -> None:
    script = tmp_path / "readme.py"
    script.write_text("\n".join(block.code for block in blocks_of(PAGES[0].read_text(encoding="utf-8"))))
    config = tmp_path / "mypy.ini"
    config.write_text("[mypy]\nstrict = True\n[mypy-mujoco.*,pink.*]\nignore_missing_imports = True\n")
    command = ["--config-file", str(config), "--cache-dir", str(tmp_path / "cache"), str(script)]
    done = subprocess.run([sys.executable, "-m", "mypy", *command], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
