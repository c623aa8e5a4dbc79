"""Optional packages: what needs one says so in a sentence, with the command that installs it."""

from __future__ import annotations

import importlib.util

from hqp_rp.core.errors import MissingExtraError

_EXTRA_OF = {
    "flint": "truth",
    "mink": "mink",
    "mujoco": "mujoco",
    "pink": "pink",
    "pinocchio": "pinocchio",
}
_REPORT = ("jinja2", "joblib", "matplotlib", "plotly", "polars", "rich", "tyro", "cloudpickle")


def require(what: str, *modules: str) -> None:
    """Raises `MissingExtraError` for the first of these modules that is not installed.

    Args:
        what: what needs them, as the beginning of a sentence. modules: by the name that an import gives them.
    """
    for module in modules:
        if importlib.util.find_spec(module) is None:
            extra = "report" if module in _REPORT else _EXTRA_OF.get(module, "qp")
            raise MissingExtraError(f'{what} needs {module}, which is not installed: pip install "hqp-rp[{extra}]"')


def require_report(what: str) -> None:
    """The same for everything that reports and the command line need."""
    require(what, *_REPORT, "scipy", "mujoco", "qpsolvers", "flint")
