"""The directive `public-names`: every public name of one subject, from its docstring.

A page says ```` ```{public-names} tasks ```` and gets whatever the library exports on that subject when the page is built, so a
new task, limit, robot or solver has its place without an edit. `subjects.py` says which name belongs where.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import re
from typing import Any

from docstrings import as_rst
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.inspect import TypeAliasForwardRef
from subjects import exported


def _thing(path: str) -> Any:
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


@functools.cache
def _short_names() -> dict[str, str]:
    return {path.rpartition(".")[2]: path for path in reversed(exported())}


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


def _process(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    lines[:] = as_rst(lines, _short_names())
    if what in ("property", "attribute", "data"):
        lines.insert(0, "")  # or napoleon takes what stands before a colon in the first line for a type


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
    # Before napoleon, whose priority is 500: it reads the sections of what this leaves.
    app.connect("autodoc-process-docstring", _process, priority=400)
    # Sphinx writes the repr of an alias in a union.
    TypeAliasForwardRef.__repr__ = lambda self: self.name.rpartition(".")[2]  # type: ignore[method-assign]
    app.connect("autodoc-process-signature", _short_types)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
