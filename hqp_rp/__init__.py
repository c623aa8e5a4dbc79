"""One prioritized robot task stack, every hierarchical controller, and the truth about each."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from hqp_rp.core.damping import (
    ConstantDamping,
    Damping,
    ErrorDamping,
    LevelDamping,
    NoDamping,
    Truncation,
    VariableDamping,
)
from hqp_rp.core.errors import (
    FileError,
    HqpError,
    MissingExtraError,
    NoSolutionError,
    ProblemError,
    RobotError,
    SettingError,
    UnknownNameError,
    WorkLimitError,
)
from hqp_rp.core.extras import require
from hqp_rp.core.problem import Level, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver, all_solvers, get_solver, solve

if TYPE_CHECKING:
    from hqp_rp import problems
    from hqp_rp.control.catalogue import Catalogue, find_singularities
    from hqp_rp.core.batch import BatchSolution, solve_batch
    from hqp_rp.core.certificate import Certificate, certify
    from hqp_rp.core.diagnostics import LevelReport, Singularity, diagnose
    from hqp_rp.core.distance import Distance, distance
    from hqp_rp.core.io import load_problem, save_problem
    from hqp_rp.core.truth import Truth, truth

__version__ = "0.1.0"

__all__ = [
    "BatchSolution",
    "Catalogue",
    "Certificate",
    "ConstantDamping",
    "Damping",
    "Distance",
    "ErrorDamping",
    "FileError",
    "HqpError",
    "Level",
    "LevelDamping",
    "LevelReport",
    "MissingExtraError",
    "NoDamping",
    "NoSolutionError",
    "Problem",
    "ProblemError",
    "RobotError",
    "SettingError",
    "Singularity",
    "Solution",
    "Solver",
    "Status",
    "Truncation",
    "Truth",
    "UnknownNameError",
    "VariableDamping",
    "WorkLimitError",
    "all_solvers",
    "certify",
    "diagnose",
    "distance",
    "find_singularities",
    "get_solver",
    "load_problem",
    "problems",
    "save_problem",
    "solve",
    "solve_batch",
    "truth",
]

# `import hqp_rp` stays light: what needs more than numpy is imported when it is first used.
_LAZY = {
    "Catalogue": "control.catalogue",
    "find_singularities": "control.catalogue",
    "BatchSolution": "core.batch",
    "solve_batch": "core.batch",
    "Certificate": "core.certificate",
    "certify": "core.certificate",
    "Distance": "core.distance",
    "distance": "core.distance",
    "LevelReport": "core.diagnostics",
    "Singularity": "core.diagnostics",
    "diagnose": "core.diagnostics",
    "load_problem": "core.io",
    "save_problem": "core.io",
    "Truth": "core.truth",
    "truth": "core.truth",
}


def __getattr__(name: str) -> Any:
    if name == "problems":
        return importlib.import_module("hqp_rp.problems")
    if name not in _LAZY:
        raise AttributeError(f"module 'hqp_rp' has no attribute {name!r}")
    if name in ("Truth", "truth"):
        require("hqp_rp.truth", "flint")
    return getattr(importlib.import_module(f"hqp_rp.{_LAZY[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
