"""The directives `public-names`, every public name of one subject from its docstring, and `registry`.

A page says ```` ```{public-names} tasks ```` and gets whatever the library exports on that subject when the page is built, so a
new task, limit, robot or solver has its place without an edit. `subjects.py` says which name belongs where.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import re
from typing import Any

from docstrings import as_rst, has_sections
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.inspect import TypeAliasForwardRef
from subjects import exported

import hqp_rp
from hqp_rp.scenarios.scenario import all_scenarios


def _thing(path: str) -> Any:
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


@functools.cache
def _short_names() -> dict[str, str]:
    """What code in a docstring is linked by its short name: classes, and what `hqp_rp` itself exports."""
    names = {path.rpartition(".")[2]: path for path in reversed(exported())}
    return {short: path for short, path in names.items() if short[0].isupper() or path == f"hqp_rp.{short}"}


class PublicNames(SphinxDirective):
    """Everything exported on the subject that the argument names."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        subject = self.arguments[0]
        names = [name for name, own in exported().items() if own == subject]
        if not names:
            raise self.error(f"no public name is about {subject!r}")
        text = "\n".join(["```{eval-rst}", *(line for name in names for line in _entry(name)), "```"])
        return self.parse_text_to_nodes(text)


class Registry(SphinxDirective):
    """Every solver, or every scenario, as a table: the name that the command line takes, and what it says of itself."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        if self.arguments[0] == "solvers":
            rows = ["| name | what it computes | takes | source |", "|---|---|---|---|"]
            for name, kind in hqp_rp.all_solvers().items():
                takes = [
                    what
                    for what, able in (
                        ("bounds", kind.takes_inequalities),
                        ("hard rows", kind.takes_hard),
                        ("damped levels", kind.takes_damping),
                        ("a metric", kind.takes_metric),
                    )
                    if able
                ]
                rows.append(
                    f"| {_link(kind, name)} | {kind.summary} | {', '.join(takes) or 'equalities'} | {kind.source} |"
                )
        else:
            rows = ["| name | question |", "|---|---|"]
            rows += [f"| {_link(kind, name)} | {kind.question} |" for name, kind in all_scenarios().items()]
        return self.parse_text_to_nodes("\n".join(rows))


def _link(kind: type, name: str) -> str:
    return f"{{py:class}}`{name} <{kind.__module__}.{kind.__name__}>`"


def _entry(path: str) -> list[str]:
    thing = _thing(path)
    if not inspect.isclass(thing):
        return [f".. auto{'function' if callable(thing) else 'data'}:: {path}", ""]
    more = (
        "   :show-inheritance:"
        if issubclass(thing, BaseException)
        else "   :inherited-members: Solver, Scenario, object"
    )
    return [f".. autoclass:: {path}", "   :members:", more, ""]


_INLINE: dict[str, list[str]] = {}


def _process(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    lines[:] = as_rst(lines, _short_names())
    if what in ("property", "attribute", "data") and not has_sections(lines):
        _INLINE[name] = list(lines)


def _restore(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Napoleon takes what stands before a colon in the first line of a property for its type."""
    lines[:] = _INLINE.pop(name, lines)


def _short_types(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, signature: str | None, returned: str | None
) -> tuple[str | None, str | None]:
    """The signature with numpy's array types as the code writes them."""
    return tuple(None if text is None else _shortened(text) for text in (signature, returned))  # type: ignore[return-value]


def _shortened(text: str) -> str:
    return re.sub(
        r"(?:numpy\.)?ndarray\[tuple\[Any, \.\.\.\], (?:numpy\.)?dtype\[(?:numpy\.)?(\w+)\]\]", r"NDArray[\1]", text
    )


def setup(app: Sphinx) -> dict[str, bool]:
    """What Sphinx calls when it loads this file."""
    app.add_directive("public-names", PublicNames)
    app.add_directive("registry", Registry)
    # Before napoleon, whose priority is 500: it reads the sections of what this leaves.
    app.connect("autodoc-process-docstring", _process, priority=400)
    app.connect("autodoc-process-docstring", _restore, priority=600)
    # Sphinx writes the repr of an alias in a union.
    TypeAliasForwardRef.__repr__ = lambda self: self.name.rpartition(".")[2]  # type: ignore[method-assign]
    app.connect("autodoc-process-signature", _short_types)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
