"""Which code a study was made with: a digest of every source that its results can depend on, comments and docstrings aside."""

from __future__ import annotations

import ast
import io
import pathlib
import re
import tokenize

import hqp_rp
from hqp_rp.compare.run_folder import digest

ROOT = pathlib.Path(hqp_rp.__file__).parent
_BEGINNINGS = ("hqp_rp.compare.claims.trials", "hqp_rp.compare.claims.experiments", "hqp_rp.compare.claims.verdicts")
_LOADED_BY_NAME = "solvers"
_WRITES = "hqp_rp.compare"
_MEASURES = "hqp_rp.compare.claims"
_NATIVE = ROOT / "core" / "native"
_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)


def sources() -> list[pathlib.Path]:
    """Every file that trials and verdicts are made by: what they import, all solvers, and the native core.

    Of `compare` only what measures and judges: how a report is drawn and written changes no result.
    """
    waiting = [*_BEGINNINGS, *(f"hqp_rp.solvers.{path.stem}" for path in (ROOT / _LOADED_BY_NAME).glob("*.py"))]
    found: dict[str, pathlib.Path] = {}
    while waiting:
        path = _path(waiting.pop())
        if path is None or str(path) in found:
            continue
        found[str(path)] = path
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module:
                waiting += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            elif isinstance(node, ast.Import):
                waiting += [alias.name for alias in node.names]
    native = [path for path in _NATIVE.rglob("*") if path.suffix in (".hpp", ".cpp", ".h")]
    return sorted([*found.values(), *native])


def digest_of_sources() -> str:
    """16 digits that change with the code, and not with its comments, docstrings and blank lines."""
    return digest(*(text for path in sources() for text in (path.relative_to(ROOT).as_posix(), code_of(path))))


def code_of(path: pathlib.Path) -> str:
    """A source without comments, docstrings, other strings that nobody uses, and blank lines."""
    text = path.read_text()
    if path.suffix != ".py":
        text = _COMMENT.sub("", text)
    else:
        lines = text.encode().splitlines(keepends=True)
        cuts = [
            (node.lineno, node.col_offset, node.end_lineno or node.lineno, node.end_col_offset or 0)
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        ]
        for token in tokenize.tokenize(io.BytesIO(text.encode()).readline):
            if token.type == tokenize.COMMENT:
                row, column = token.start
                before = len(token.line[:column].encode())
                cuts.append((row, before, row, before + len(token.string.encode())))
        for first, begin, last, end in sorted(cuts, reverse=True):
            rest = lines[last - 1][end:]
            lines[first - 1 : last] = [lines[first - 1][:begin] + rest]
        text = b"".join(lines).decode()
    return "\n".join(line.rstrip() for line in text.splitlines() if line.strip())


def _path(module: str) -> pathlib.Path | None:
    """The file of a module of this package; None for another's, and for what is no module."""
    parts = module.split(".")
    if parts[0] != "hqp_rp" or (module.startswith(_WRITES) and not module.startswith(_MEASURES)):
        return None
    base = ROOT.joinpath(*parts[1:])
    for path in (base.with_suffix(".py"), base / "__init__.py"):
        if path.exists() and base != ROOT:
            return path
    return None
