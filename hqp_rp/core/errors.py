"""Every error the library raises: each derives from `HqpError` and from the builtin that fits it."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class HqpError(Exception):
    """Root of every error that hqp_rp raises on misuse. A hard problem is no misuse: it ends in a `Status`."""


class ProblemError(HqpError, ValueError):
    """A level or a problem that has no meaning (shapes, NaN, crossed bounds); the message names the level."""


class UnknownNameError(HqpError, LookupError):
    """A solver, scenario, policy or form that does not exist; the message lists the ones that do."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class SettingError(HqpError, TypeError, ValueError):
    """A setting that a solver does not have, or a value that it does not allow."""


class NoSolutionError(HqpError, RuntimeError):
    """`Solution.require` of a solve that gave no x, or none that may be used; the message is the status in words."""


class WorkLimitError(HqpError, RuntimeError):
    """An exact search that reached the bound of its work; the message names the bound and what shortens the search."""


class FileError(HqpError, ValueError):
    """A file that cannot be read as what it should be; the message names the file."""


class RobotError(HqpError, ValueError):
    """A robot model, frame or configuration that does not exist or does not fit."""


class MissingExtraError(HqpError, ImportError):
    """An optional package is needed and absent; the message names the command that installs it."""


def unknown_name(kind: str, name: object, valid: Iterable[str]) -> UnknownNameError:
    """The error for an unknown name: names the value, suggests the nearest valid name and lists them all."""
    return UnknownNameError(_unknown(kind, name, valid))


def unknown_setting(owner: str, name: str, valid: Iterable[str]) -> SettingError:
    """The error for an unknown setting of `owner`, with the nearest valid one suggested."""
    return SettingError(_unknown(f"setting of {owner}", name, valid))


def _unknown(kind: str, name: object, valid: Iterable[str]) -> str:
    names = sorted(valid)
    near = difflib.get_close_matches(str(name), names, n=1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    return f"There is no {kind} named {name!r}.{hint} Valid: {', '.join(names) or 'none'}."
