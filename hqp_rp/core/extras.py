"""Optional packages: what needs one says so in a sentence, with the command that installs it."""

from __future__ import annotations

import functools
import importlib.util
from typing import Any, NoReturn

from hqp_rp.core.errors import MissingExtraError
from hqp_rp.core.words import listing


def _alike(names: str) -> dict[str, str]:
    """Modules that are called as their packages are."""
    return {name: name for name in names.split()}


PACKAGES = {
    "qp": _alike("qpsolvers proxsuite osqp scipy daqp quadprog piqp"),
    "mujoco": _alike("mujoco"),
    "pinocchio": {"pinocchio": "pin"},
    "mink": _alike("mink"),
    "pink": {"pink": "pin-pink"},
    "truth": {"flint": "python-flint"},
    "cli": _alike("tyro"),
    "report": _alike("jinja2 joblib matplotlib plotly polars rich cloudpickle"),
    "humanoid": {"jvrc_description": "jvrc-description"},
    "torch": _alike("torch"),
    "jax": _alike("jax"),
    "play": _alike("viser"),
    "cluster": _alike("dask distributed"),
}
"""Of each extra of hqp-rp: module -> the package that has it."""


REPORT = (*PACKAGES["report"], "scipy", "mujoco", "qpsolvers", "flint")
"""What reports need."""


def require(what: str, *modules: str) -> None:
    """Raises `MissingExtraError` where some of these modules are not installed; it names all of them.

    Args:
        what: what needs them, as the beginning of a sentence. modules: by the name that an import gives them.
    """
    missing = missing_of(modules)
    if not missing:
        return
    extra = next(extra for extra, packages in PACKAGES.items() if missing[0] in packages)
    known = {module: package for packages in PACKAGES.values() for module, package in packages.items()}
    install = " ".join(known[module] for module in missing)
    are = "is" if len(missing) == 1 else "are"
    raise MissingExtraError(
        f"{what} needs {listing(missing)}, which {are} not installed: pip install {install}, or install hqp-rp with "
        f'its extra "{extra}"'
    )


def require_report(what: str) -> None:
    """The same for everything that reports need."""
    require(what, *REPORT)


def missing_of(modules: tuple[str, ...]) -> list[str]:
    """Those of the modules that are not installed."""
    return [module for module in modules if importlib.util.find_spec(module) is None]


class _Absent(type):
    """The type of a public name whose package is not installed: there for `import *`, `help` and `dir`, an error when used."""

    _needs: tuple[str, tuple[str, ...]]

    def __new__(mcs, name: str, bases: tuple[type, ...], namespace: dict[str, Any]) -> _Absent:
        for base in bases:
            if isinstance(base, _Absent):
                base._refuse()
        return super().__new__(mcs, name, bases, namespace)

    def __call__(cls, *_: Any, **__: Any) -> NoReturn:
        cls._refuse()

    def __getattr__(cls, name: str) -> Any:
        if name.startswith("_"):  # what inspect and pydoc ask of anything
            raise AttributeError(name)
        cls._refuse()

    def _refuse(cls) -> NoReturn:
        what, modules = cls._needs
        require(what, *modules)
        raise MissingExtraError(f"{what}: what it needs was installed after it was imported; start Python again.")


@functools.cache
def absent(what: str, *modules: str) -> Any:
    """What stands in for the public name `what`, such as "hqp_rp.truth", while one of `modules` is not installed.

    A lazy package hands it out, so that `from package import *`, `help(package)` and `inspect.getmembers` go on. A call, a
    subclass, and an attribute raise `MissingExtraError`; nothing is an instance of it.
    """
    package, _, name = what.rpartition(".")
    try:
        require(what, *modules)
        told = f"{what} needs {', '.join(modules)}."
    except MissingExtraError as error:
        told = f"{error}."
    return _Absent(name, (), {"__doc__": told, "__module__": package, "_needs": (what, modules)})
