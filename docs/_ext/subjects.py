"""Which public name is shown on which page of docs/reference. Nothing of Sphinx is needed here: a test asks too.

A name that belongs nowhere is a `LookupError`: give its module a subject in `_MODULE_SUBJECTS`.
"""

from __future__ import annotations

import importlib
import inspect
from typing import Any

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
    module = str(getattr(thing, "__module__", None) or getattr(thing, "__name__", ""))
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
    raise LookupError(f"{name} of {module} belongs to no subject; give its module one in docs/_ext/subjects.py")


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
