"""Which code a study was made with: a digest of every source that its results can depend on, words and layout aside."""

from __future__ import annotations

import ast
import pathlib
import re
from typing import Any

import hqp_rp
from hqp_rp.compare.claims.methods import solvers
from hqp_rp.compare.run_folder import digest

ROOT = pathlib.Path(hqp_rp.__file__).parent
_BEGINNINGS = ("hqp_rp.compare.claims.trials", "hqp_rp.compare.claims.experiments", "hqp_rp.compare.claims.verdicts")
_WRITES = "hqp_rp.compare"
_MEASURES = "hqp_rp.compare.claims"
_NATIVE = ROOT / "core" / "native"
_WORDS = (
    "hqp_rp.core.conflict",
    "hqp_rp.core.held_back",
    "hqp_rp.core.row_names",
    "hqp_rp.control._row_names",
    "hqp_rp.control._rows_in_words",
    "hqp_rp.control._stack_warnings",
)
"""Modules that put an answer, or a stack, into words and change neither."""

_SHOWS = ("_repr_html_", "plot", "bound_causes", "row_units")
"""Methods that show an object or name rows for messages."""

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)


def sources() -> list[pathlib.Path]:
    """Every file that trials and verdicts are made by: what they import, the solvers that take part, and the native core.

    Of `compare` only what measures and judges: how a report is drawn and written changes no result.
    """
    waiting = [*_BEGINNINGS, *sorted({type(solver).__module__ for solver in solvers()})]
    found: dict[str, pathlib.Path] = {}
    while waiting:
        path = _path(waiting.pop())
        if path is None or str(path) in found:
            continue
        found[str(path)] = path
        for node in ast.walk(_counted(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module:
                waiting += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            elif isinstance(node, ast.Import):
                waiting += [alias.name for alias in node.names]
    native = [path for path in _NATIVE.rglob("*") if path.suffix in (".hpp", ".cpp", ".h")]
    return sorted([*found.values(), *native])


def digest_of_sources() -> str:
    """16 digits that change with the code, and not with its comments, docstrings and layout."""
    return digest(*(text for path in sources() for text in (path.relative_to(ROOT).as_posix(), code_of(path))))


def code_of(path: pathlib.Path) -> str:
    """What a source says to the machine: of Python its syntax tree without strings that nobody uses; of C++ the text without
    comments and line breaks.

    Neither do these count: where in `compare`, outside the claims, a name is imported from (the name does); a class attribute
    `variants`, since a line-up of solvers changes no solver; how an object is shown and how rows are named (`_SHOWS`,
    `_WORDS`); an imported name that nothing else in the file then uses.
    """
    text = path.read_text()
    if path.suffix != ".py":
        return " ".join(_COMMENT.sub("", text).split())
    return repr(_shape(_counted(text)))


def _counted(text: str) -> ast.Module:
    """The syntax tree of what counts, imports one name at a time."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            node.body = [item for item in node.body if not _declares(item, "variants") and not _shows(item)] or [
                ast.Pass()
            ]
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} | _exported(tree)
    _Imports(used).visit(tree)
    return tree


class _Imports(ast.NodeTransformer):
    """Each import split into its names, without those that are not used."""

    def __init__(self, used: set[str]) -> None:
        self.used = used

    def visit_Import(self, node: ast.Import) -> list[ast.Import]:
        return [ast.Import([alias]) for alias in node.names if self._is_used(alias)]

    def visit_ImportFrom(self, node: ast.ImportFrom) -> list[ast.ImportFrom]:
        module = _WRITES if _is_written(node.module or "") else node.module
        return [
            ast.ImportFrom(module, [alias], node.level)
            for alias in node.names
            if node.module == "__future__" or self._is_used(alias)
        ]

    def _is_used(self, alias: ast.alias) -> bool:
        return alias.name == "*" or (alias.asname or alias.name.partition(".")[0]) in self.used


def _declares(node: ast.stmt, name: str) -> bool:
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return any(isinstance(target, ast.Name) and target.id == name for target in targets)


def _shows(node: ast.stmt) -> bool:
    return isinstance(node, ast.FunctionDef) and node.name in _SHOWS


def _exported(tree: ast.Module) -> set[str]:
    """The names in `__all__`."""
    values = [node for statement in tree.body if _declares(statement, "__all__") for node in ast.walk(statement)]
    return {node.value for node in values if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def _is_written(module: str) -> bool:
    """Whether a module of `compare` draws and writes only, or is shared by what does."""
    return f"{module}.".startswith(f"{_WRITES}.") and not f"{module}.".startswith(f"{_MEASURES}.")


def _shape(node: Any) -> Any:
    """A syntax tree as tuples, without what is empty, so that versions of Python agree on it."""
    if isinstance(node, ast.AST):
        fields = [(name, _shape(value)) for name, value in ast.iter_fields(node)]
        return (type(node).__name__, *((name, value) for name, value in fields if value not in (None, ())))
    if isinstance(node, list):
        imports = [item for item in node if isinstance(item, ast.Import | ast.ImportFrom)]
        others = [item for item in node if item not in imports and not _is_words(item)]
        return (*sorted(map(_shape, imports), key=repr), *map(_shape, others))
    return node


def _is_words(node: Any) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _path(module: str) -> pathlib.Path | None:
    """The file of a module of this package; None for another's, and for what is no module."""
    parts = module.split(".")
    if parts[0] != "hqp_rp" or _is_written(module) or module in _WORDS:
        return None
    base = ROOT.joinpath(*parts[1:])
    for path in (base.with_suffix(".py"), base / "__init__.py"):
        if path.exists() and base != ROOT:
            return path
    return None
