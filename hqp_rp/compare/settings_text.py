"""A solver with settings as one word of a command line: `reverse_priority:damping=constant(0.1),form=projector`."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
from typing import Any

from hqp_rp.core.damping import (
    ConstantDamping,
    Damping,
    ManipulabilityDamping,
    NoDamping,
    NumericalFiltering,
    Truncation,
    VariableDamping,
)
from hqp_rp.core.errors import SettingError, unknown_name, unknown_setting
from hqp_rp.core.solver import Solver, all_solvers, get_solver

_POLICIES: dict[str, type[Damping]] = {
    "none": NoDamping,
    "constant": ConstantDamping,
    "variable": VariableDamping,
    "truncation": Truncation,
    "manipulability": ManipulabilityDamping,
    "filtering": NumericalFiltering,
}


def parse_contestant(text: str) -> Solver:
    """The solver that `name` or `name:key=value,key=value` stands for; in place of a name also `package.module:Class`.

    Values are read by the type of the setting's default: numbers, true / false, words, lists of numbers, and damping
    policies as they are printed: none, constant(0.1), variable(delta=0.1, maximum=0.1), truncation(0.01),
    manipulability(threshold=0.01, maximum=0.1), filtering(delta=0.1, maximum=0.1).

    Raises:
        UnknownNameError: no such solver or damping policy; the message lists the ones there are.
        SettingError: an unknown setting, a setting given twice, or a value that it does not allow.
    """
    name, _, rest = text.partition(":")
    name = name.strip()
    if name in all_solvers():
        kind = all_solvers()[name]
    else:
        class_name, _, rest = rest.partition(":")
        if not class_name.strip().isidentifier():
            raise unknown_name("solver", name, all_solvers())
        kind = _imported(name, class_name.strip())
        name = f"{name}:{class_name.strip()}"
    defaults = {field.name: field for field in dataclasses.fields(kind) if field.init}
    settings: dict[str, Any] = {}
    for pair in _split(rest, text):
        key, equals, value = (part.strip() for part in pair.partition("="))
        if key not in defaults:
            raise unknown_setting(name, key, defaults)
        if not equals or not value:
            raise SettingError(f"{text!r}: the setting {key} has no value; write {name}:{key}=VALUE.")
        if key in settings:
            raise SettingError(f"{text!r}: the setting {key} is given twice.")
        settings[key] = _value(defaults[key].default, value, f"{text!r}: {key}")
    return get_solver(kind, **settings)


def _imported(module: str, name: str) -> type[Solver]:
    """A solver class of somebody's own module. Raises `SettingError`."""
    try:
        found = getattr(importlib.import_module(module), name)
    except (Exception, SystemExit) as error:  # whatever somebody's module raises when it is imported
        raise SettingError(
            f"{module}:{name} cannot be imported: {type(error).__name__}: {str(error).rstrip('.')}. Give package.module:Class "
            "of an installed package, or of a file in the folder that you are in."
        ) from error
    if not (inspect.isclass(found) and issubclass(found, Solver)) or inspect.isabstract(found):
        raise SettingError(f"{module}:{name} is {found!r}; it must be a subclass of hqp_rp.Solver.")
    return found


def _split(text: str, whole: str) -> list[str]:
    """The parts between those commas that stand outside brackets."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "([") - (letter in ")]")
        if depth < 0:
            break
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    if depth:
        raise SettingError(f"{whole!r}: its brackets do not match.")
    return [part for part in parts if part.strip()]


def _value(default: object, text: str, what: str) -> object:
    if isinstance(default, Damping):
        return _damping(text, what)
    if isinstance(default, bool):
        if text.lower() not in ("true", "false"):
            raise SettingError(f"{what} is {text!r}; it must be true or false.")
        return text.lower() == "true"
    if isinstance(default, str):
        return text.strip("'\"")
    try:
        value = ast.literal_eval(text)
    except (ValueError, SyntaxError):
        raise SettingError(f"{what} is {text!r}; it must be a number or a list of numbers.") from None
    if isinstance(default, int) and not isinstance(value, int):
        raise SettingError(f"{what} is {text!r}; it must be an integer.")
    if isinstance(default, float) and not isinstance(value, int | float):
        raise SettingError(f"{what} is {text!r}; it must be a number.")
    return value


def _damping(text: str, what: str) -> Damping:
    name, bracket, rest = text.partition("(")
    name = name.strip()
    if name not in _POLICIES:
        raise unknown_name("damping policy", name, _POLICIES)
    if bracket and not rest.endswith(")"):
        raise SettingError(f"{what} is {text!r}; its brackets do not match.")
    policy = _POLICIES[name]
    names = list(inspect.signature(policy).parameters)
    given: dict[str, float] = {}
    arguments = _split(rest[:-1], text) if bracket else []
    for position, argument in enumerate(arguments):
        key, equals, value = (part.strip() for part in argument.partition("="))
        if not equals:
            if position >= len(names):
                raise SettingError(f"{what} is {text!r}; {name} takes {len(names)} number(s): {', '.join(names)}.")
            key, value = names[position], key
        if key not in names:
            raise unknown_setting(f"damping policy {name}", key, names)
        try:
            given[key] = float(value)
        except ValueError:
            raise SettingError(f"{what} is {text!r}; {key} must be a number, not {value!r}.") from None
    missing = [key for key in names if key not in given]
    if missing:
        raise SettingError(f"{what} is {text!r}; {name} needs {' and '.join(missing)}: {name}({', '.join(names)}).")
    return policy(**given)
