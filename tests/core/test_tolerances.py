"""Every tolerance stands in one place on each side, with its meaning."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from hqp_rp.core import tolerances

ROOT = Path(__file__).parents[2]
NATIVE = ROOT / "hqp_rp" / "core" / "native"
HEADER = NATIVE / "include" / "hqp_rp" / "tolerances.hpp"
SMALL = re.compile(r"(?<![\w.])\d+(?:\.\d+)?e-(\d+)")


def test_each_python_tolerance_says_what_it_means() -> None:
    body = ast.parse(Path(tolerances.__file__).read_text(encoding="utf-8")).body
    assigned = [i for i, node in enumerate(body) if isinstance(node, ast.Assign)]
    assert len(assigned) > 10
    for i in assigned:
        following = body[i + 1]
        assert isinstance(following, ast.Expr), ast.unparse(body[i])
        assert isinstance(following.value, ast.Constant)
        assert len(str(following.value.value)) > 30


def test_each_native_tolerance_says_what_it_means() -> None:
    lines = HEADER.read_text(encoding="utf-8").splitlines()
    named = [i for i, line in enumerate(lines) if line.startswith("constexpr double")]
    assert len(named) > 30
    for i in named:
        above = next(line for line in reversed(lines[:i]) if not line.startswith("constexpr"))
        assert above.startswith("//"), lines[i]


@pytest.mark.parametrize("path", sorted([*NATIVE.rglob("*.hpp"), *NATIVE.rglob("*.cpp")]), ids=lambda path: path.name)
def test_no_bare_tolerance_in_native_code(path: Path) -> None:
    if path == HEADER or "examples" in path.parts:
        return
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        code = line.partition("//")[0]
        found = [
            m.group() for m in SMALL.finditer(code) if int(m.group(1)) < 60
        ]  # beyond: where squares would underflow
        assert not found, f"{path.name}:{number}: {line.strip()}"
