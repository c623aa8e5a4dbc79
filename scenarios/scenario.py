"""The scenario protocol: one question put to every solver, as a stream of solved problems that someone else judges."""

from __future__ import annotations

import abc
import dataclasses
import functools
import importlib
import inspect
import pkgutil
import time
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

from hqp_rp.core.errors import SettingError, unknown_name, unknown_setting
from hqp_rp.core.extras import require
from hqp_rp.core.plugins import plugins
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.solver import Solver


@dataclasses.dataclass(frozen=True, slots=True)
class Step:
    """One solved problem of a run, unjudged.

    Attributes:
        case: the variant within the scenario ("two levels", "three levels"); empty when there is one only.
        parameter: the abscissa of the scenario's figures (distance eps, or time in s).
        problem, solution: what was asked and answered.
        solve_time: s, wall clock of the solver's call alone.
        measured: further figures that only the scenario can measure (tracking error in the simulation, m), by name.
    """

    case: str
    parameter: float
    problem: Problem
    solution: Solution
    solve_time: float
    measured: Mapping[str, float] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scenario(abc.ABC):
    """One question. Dataclass fields are its settings; the same seed gives every solver the same problem.

    Class attributes that a scenario declares:
        name: what the command line calls it; the name of its file.
        question: the question, as a sentence.
        cannot_tell: what the test cannot tell, as sentences; printed before its tables.
        abscissa: label of `Step.parameter`, with its unit; `log_abscissa`: whether figures use a log axis.
        by_default: whether a comparison that names no scenario takes it.
    """

    name: ClassVar[str]
    question: ClassVar[str]
    cannot_tell: ClassVar[tuple[str, ...]]
    abscissa: ClassVar[str]
    log_abscissa: ClassVar[bool] = False
    by_default: ClassVar[bool] = True

    @property
    def commands_torques(self) -> bool:
        """Whether the unknown is an acceleration: then solvers that speak of inertia take part by default."""
        return False

    @abc.abstractmethod
    def steps(self, solver: Solver, seed: int) -> Iterator[Step]:
        """Run the scenario with `solver` and yield each step as it is solved.

        When the solver returns no x, the scenario yields that step and ends (a refusal) or holds still (a failure), and
        goes on; it never raises because a solver failed.
        """

    def check(self) -> None:
        """Raise `MissingExtraError`, with the command that installs it, where an optional package is needed and absent."""

    @abc.abstractmethod
    def length(self) -> int:
        """How many steps one run has, for the progress bar."""

    @abc.abstractmethod
    def quick(self) -> Scenario:
        """The same question on fewer or coarser steps, for a first look."""


def timed_solve(solver: Solver, problem: Problem, secondary: FloatArray | None = None) -> tuple[Solution, float]:
    """The solution and the wall-clock seconds of the solver's call alone."""
    start = time.perf_counter()
    solution = solver.solve(problem, secondary)
    return solution, time.perf_counter() - start


def refused_step(solver: Solver, problem: Problem, case: str = "", parameter: float = 0.0) -> Step | None:
    """The only step of a run whose solver refuses its first problem; None where it takes it. Controllers would raise."""
    sentence = solver.refuses(problem)
    if sentence is None:
        return None
    return Step(case, parameter, problem, Solution(problem, None, Status.REFUSED, message=sentence), 0.0)


@functools.cache
def _registry() -> dict[str, type[Scenario]]:
    require("The scenarios", "mujoco")
    package = importlib.import_module("hqp_rp.scenarios")
    found: dict[str, type[Scenario]] = {}
    for info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"hqp_rp.scenarios.{info.name}")
        for item in vars(module).values():
            if (
                inspect.isclass(item)
                and issubclass(item, Scenario)
                and item.__module__ == module.__name__
                and not inspect.isabstract(item)
            ):
                found[item.name] = item
    return found | plugins("hqp_rp.scenarios", Scenario, found)  # type: ignore[type-abstract]


def all_scenarios() -> dict[str, type[Scenario]]:
    """Every scenario in the scenarios folder, and those of other packages' entry points: name -> class, sorted by name."""
    return dict(sorted(_registry().items()))


def get_scenario(scenario: str | Scenario, /, **settings: Any) -> Scenario:
    """The scenario of that name with these settings, or the given one with these settings replaced.

    Raises `UnknownNameError` (lists the scenarios) or `SettingError` (lists the settings).
    """
    if isinstance(scenario, str):
        registry = _registry()
        if scenario not in registry:
            raise unknown_name("scenario", scenario, registry)
        kind = registry[scenario]
    elif isinstance(scenario, Scenario):
        kind = type(scenario)
    else:
        raise SettingError(f"scenario is a {type(scenario).__name__}; give a scenario's name or a Scenario.")
    valid = [field.name for field in dataclasses.fields(kind)]
    for name in settings:
        if name not in valid:
            raise unknown_setting(kind.name, name, valid)
    return kind(**settings) if isinstance(scenario, str) else dataclasses.replace(scenario, **settings)
