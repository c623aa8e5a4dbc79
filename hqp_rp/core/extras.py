"""Optional packages: what needs one says so in a sentence, with the command that installs it."""

from __future__ import annotations

import importlib.util

from hqp_rp.core.errors import MissingExtraError


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
    "report": _alike("jinja2 joblib matplotlib plotly polars rich tyro cloudpickle"),
    "humanoid": {"jvrc_description": "jvrc-description"},
    "torch": _alike("torch"),
    "jax": _alike("jax"),
    "play": _alike("viser"),
    "cluster": _alike("dask distributed"),
}
"""Of each extra of hqp-rp: module -> the package that has it."""


def require(what: str, *modules: str) -> None:
    """Raises `MissingExtraError` where some of these modules are not installed; it names all of them.

    Args:
        what: what needs them, as the beginning of a sentence. modules: by the name that an import gives them.
    """
    missing = [module for module in modules if importlib.util.find_spec(module) is None]
    if not missing:
        return
    extra = next(extra for extra, packages in PACKAGES.items() if missing[0] in packages)
    known = {module: package for packages in PACKAGES.values() for module, package in packages.items()}
    listed = missing[0] if len(missing) == 1 else f"{', '.join(missing[:-1])} and {missing[-1]}"
    install = " ".join(known[module] for module in missing)
    raise MissingExtraError(
        f"{what} needs {listed}, which {'is' if len(missing) == 1 else 'are'} not installed: pip install {install}, or install "
        f'hqp-rp with its extra "{extra}"'
    )


def require_report(what: str) -> None:
    """The same for everything that reports and the command line need."""
    require(what, *PACKAGES["report"], "scipy", "mujoco", "qpsolvers", "flint")
