"""Classes of other packages, found by their entry points."""

from __future__ import annotations

import importlib.metadata
import inspect
from typing import TypeVar

from hqp_rp.core.warned import warn

_T = TypeVar("_T")


def plugins(group: str, kind: type[_T], known: dict[str, type[_T]]) -> dict[str, type[_T]]:
    """name -> class of the entry points of that group: subclasses of `kind` that are not abstract.

    A package that cannot be imported, one that gives something else, and a name that is taken are one warning each.

    Args:
        group: such as "hqp_rp.solvers". known: the names that are taken.
    """
    found: dict[str, type[_T]] = {}
    for entry in importlib.metadata.entry_points(group=group):
        where = f"The entry point {entry.name!r} of {group} ({entry.value})"
        try:
            item = entry.load()
        except (Exception, SystemExit) as error:  # whatever another package raises when it is imported
            warn(
                f"{where} cannot be loaded: {type(error).__name__}: {error}; it is left out. Mend or uninstall its package."
            )
            continue
        name = getattr(item, "name", None)
        if (
            not (inspect.isclass(item) and issubclass(item, kind))
            or inspect.isabstract(item)
            or not isinstance(name, str)
        ):
            warn(f"{where} is {item!r}, not a {kind.__name__} with a name; it is left out.")
        elif name in known or name in found:
            warn(f"{where} is named {name!r}, as another is; it is left out.")
        else:
            found[name] = item
    return found
