"""The directive `public-names`: every public name of one subject, from its docstring.

A page says ```` ```{public-names} tasks ```` and gets whatever the library exports on that subject when the page is built, so a
new task, limit, robot or solver has its place without an edit. `SUBJECTS` says which name belongs where, and
`subject_of` raises for a name that belongs nowhere.

The library's docstrings are plain text with code in single backticks. `as_rst` makes reStructuredText of them.
"""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import hqp_rp
import hqp_rp.control
import hqp_rp.problems
import hqp_rp.robot
from hqp_rp.scenarios.scenario import all_scenarios

# What a solver's, a task's or a tool's author imports beside `hqp_rp` itself.
CORE_MODULES = (
    "closed_form",
    "conflict",
    "level_by_level",
    "level_damping",
    "metric",
    "stacked",
    "tolerances",
    "verify",
)

_MODULE_SUBJECTS = {
    "core.errors": "errors",
    "core.damping": "damping",
    "core.solver": "solvers",
    "core": "problems",
    "problems": "problem_set",
    "compare": "singularities",
    "control.catalogue": "singularities",
    "control.limit": "limits",
    "control.joint_coupling": "limits",
    "control.locked_joints": "limits",
    "control.task": "tasks",
    "control.contact": "stacks",
    "control.joint_limit_potential": "tasks",
    "robot": "robots",
}
# Public, and imported from the module itself.
_BESIDE = {
    "hqp_rp.control.stack_file.load_stack": "stacks",
    "hqp_rp.control.stack_file.parse_stack": "stacks",
    "hqp_rp.control.stack_file.StackFile": "stacks",
    "hqp_rp.robot.named.named_robot": "robots",
    "hqp_rp.scenarios.scenario.Scenario": "scenarios",
    "hqp_rp.scenarios.scenario.Step": "scenarios",
}
# Not classes or functions: they do not know where they come from.
_VALUES = {"Damping": "damping", "LevelDamping": "damping", "DATA": "problem_set", "version": "problem_set"}
_INTERACTION = ("force", "impedance", "hybrid", "reference", "wrench", "interaction_controller", "admittance")


def subject_of(name: str, thing: Any) -> str:
    """The subject, which is a page of docs/reference, that the public `name` is shown under."""
    if name in _VALUES:
        return _VALUES[name]
    module = getattr(thing, "__module__", None) or getattr(thing, "__name__", "")
    module = module.removeprefix("hqp_rp.").removeprefix("builtins")
    if module.startswith("control.") and module.split(".")[1] in _INTERACTION:
        return "interaction"
    for prefix in sorted(_MODULE_SUBJECTS, key=len, reverse=True):
        if module == prefix or module.startswith(prefix + "."):
            return _MODULE_SUBJECTS[prefix]
    if module.endswith("_task"):
        return "tasks"
    if module.endswith("_limit"):
        return "limits"
    if module.startswith("control."):
        return "stacks"
    raise LookupError(f"{name} of {module} belongs to no subject; give its module one in docs/_ext/public_names.py")


def exported() -> dict[str, str]:
    """Every public name as a user imports it, such as "hqp_rp.Stack": its subject."""
    found: dict[str, str] = dict(_BESIDE)
    seen: set[int] = set()
    for package in (hqp_rp, hqp_rp.control, hqp_rp.robot, hqp_rp.problems):
        for name in sorted(package.__all__):
            thing = getattr(package, name)
            if inspect.ismodule(thing) or id(thing) in seen:
                continue
            seen.add(id(thing))
            found[f"{package.__name__}.{name}"] = subject_of(name, thing)
    for kind in hqp_rp.all_solvers().values():
        if kind.__module__.startswith("hqp_rp."):
            found[f"{kind.__module__}.{kind.__name__}"] = "solvers"
    for scenario in all_scenarios().values():
        if scenario.__module__.startswith("hqp_rp."):
            found[f"{scenario.__module__}.{scenario.__name__}"] = "scenarios"
    for module in CORE_MODULES:
        for name, thing in vars(importlib.import_module(f"hqp_rp.core.{module}")).items():
            own = getattr(thing, "__module__", "") == f"hqp_rp.core.{module}"
            if own and not name.startswith("_") and (inspect.isclass(thing) or inspect.isfunction(thing)):
                found[f"hqp_rp.core.{module}.{name}"] = "core"
    return found


def _thing(path: str) -> Any:
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


# --- the directive ---------------------------------------------------------------------------------------------------


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
    more = "   :show-inheritance:" if issubclass(thing, BaseException) else "   :inherited-members: Solver, Scenario, object"
    return [f".. autoclass:: {path}", "   :members:", more, ""]


# --- docstrings ------------------------------------------------------------------------------------------------------

_CODE = re.compile(r"(``[^`]+``|`[^`\n]+`)")
_SECTION = re.compile(r"^(Args|Settings|Attributes|Raises|Returns|Yields|Note|Example|Examples):$")


def _short_names() -> dict[str, str]:
    return {path.rpartition(".")[2]: path for path in reversed(exported())}


def as_rst(lines: list[str], short: dict[str, str]) -> list[str]:
    """The lines of a docstring as reStructuredText: code becomes literals or links, and nothing else is markup."""
    return list(_blocks(lines, lambda line: _inline(line, short)))


def _blocks(lines: list[str], inline: Callable[[str], str]) -> Iterator[str]:
    literal: int | None = None
    section = False
    before = ""
    for line in lines:
        depth = len(line) - len(line.lstrip())
        if literal is not None and (not line.strip() or depth > literal):
            yield line
            continue
        literal = None
        if line.strip() and depth == 0:
            section = bool(_SECTION.match(line))
        if line.rstrip().endswith("::"):
            literal = depth
            yield inline(line)
            continue
        if not section and line.strip() and depth > 0 and not before.strip():
            # A formula or a drawing on lines of its own.
            yield "::"
            yield ""
            yield line
            literal = depth - 1
            continue
        before = line
        yield inline(line)


def _inline(line: str, short: dict[str, str]) -> str:
    def code(text: str) -> str:
        inner = text.strip("`")
        name = inner.removeprefix("hqp_rp.").removesuffix("()")
        if name in short:
            return f":py:obj:`{inner} <{short[name]}>`"
        return f"``{inner}``"

    parts = _CODE.split(line)
    for i, part in enumerate(parts):
        if i % 2:
            parts[i] = code(part)
            if i + 1 < len(parts) and parts[i + 1][:1].isalnum():
                parts[i] += "\\ "
        else:
            plain = re.sub(r"([\\*|])", r"\\\1", part)
            parts[i] = re.sub(r"(?<=\w)_(?!\w)", r"\\_", plain)
    return "".join(parts)


def _process(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    lines[:] = as_rst(lines, _short_names())


def setup(app: Sphinx) -> dict[str, bool]:
    """What Sphinx calls when it loads this file."""
    app.add_directive("public-names", PublicNames)
    # Before napoleon, whose priority is 500: it reads the sections of what this leaves.
    app.connect("autodoc-process-docstring", _process, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
