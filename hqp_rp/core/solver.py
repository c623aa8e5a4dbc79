"""The solver protocol, the registry that finds solvers by scanning their folder, and `solve`."""

from __future__ import annotations

import abc
import dataclasses
import functools
import importlib
import inspect
import pkgutil
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hqp_rp.core.errors import ProblemError, SettingError, unknown_name, unknown_setting
from hqp_rp.core.plugins import plugins
from hqp_rp.core.problem import FloatArray, IntArray, Problem
from hqp_rp.core.solution import Solution, Status
from hqp_rp.core.tolerances import RANK, SOLVED
from hqp_rp.core.variant import LineUp

RANK_TOLERANCE = RANK
"""A singular value of A_k restricted to the remaining null space counts as zero when it is <= this * ||A_k||_2."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Solver(abc.ABC):
    """One method. Its dataclass fields are its settings, and its repr is its label in reports.

    Class attributes that a solver declares:
        name: what `solve(problem, name)` and the command line call it; the name of its file.
        summary: one line on what it computes.
        source: where it comes from (paper and equation).
        takes_inequalities, takes_hard: whether it accepts two-sided rows and hard rows.
        takes_damping: whether it accepts damping of single levels (`hqp_rp.core.level_damping`).
        takes_metric: whether it accepts a metric on the unknown (`hqp_rp.core.metric`).
        variants: how it is shown beside others; without it, once, with its defaults. Not inherited.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    source: ClassVar[str]
    takes_inequalities: ClassVar[bool] = False
    takes_hard: ClassVar[bool] = False
    takes_damping: ClassVar[bool] = False
    takes_metric: ClassVar[bool] = False
    variants: ClassVar[LineUp] = LineUp()

    @property
    def tolerance(self) -> float:
        """What `SOLVED` promises: each level's avoidable residual is at most this times `||A_k|| ||x|| + ||b_k||`.

        For closed forms it is a bound on rounding error. A hard row is violated by at most the same relative amount.
        """
        return SOLVED

    def is_lexicographic(self, problem: Problem) -> bool:
        """Whether the method, with these settings, returns this problem's lexicographic optimum in exact arithmetic."""
        return False

    def refuses(self, problem: Problem) -> str | None:
        """A sentence that says what in `problem` the solver cannot take, or None. Nothing is ever silently dropped."""
        if problem.hard is not None and problem.hard.m and not self.takes_hard:
            return (
                f"{self.name} is a closed form without hard rows; use a solver that takes them, such as "
                "hierarchical_active_set."
            )
        if not problem.is_equality and not self.takes_inequalities:
            return (
                f"{self.name} solves equalities only; use a solver that takes two-sided rows, such as "
                "hierarchical_active_set."
            )
        if problem.damping is not None and not self.takes_damping:
            return (
                f"{self.name} knows no damping of single levels; give the solver its own damping where it has one, or use one "
                "that takes it, such as hierarchical_active_set."
            )
        if problem.metric is not None and not self.takes_metric:
            return f"{self.name} knows no metric on the unknown; use a solver that takes it, such as hierarchical_active_set."
        return None

    @abc.abstractmethod
    def solve(self, problem: Problem, secondary: FloatArray | None = None) -> Solution:
        """Solve `problem`. Never raises for a hard problem: it returns a status.

        Args:
            problem: any `Problem`; one that the solver `refuses` comes back with `Status.REFUSED` and the sentence.
            secondary: (n,) free vector (zeta-dot of equations (5), (10), (11)): what the freedom that all levels leave
                is used for. Among the answers equally good at every level the solver takes the nearest to it; None
                means 0, the answer of least norm.
        """

    def solve_many(
        self,
        matrix: FloatArray,
        lower: FloatArray,
        upper: FloatArray | None,
        offsets: IntArray,
        secondary: FloatArray,
        x: FloatArray,
        codes: NDArray[np.uint8],
    ) -> None:
        """What `solve_batch` calls with checked arrays: (N, M, n), (N, M), (N, M) or None for equalities, (p + 1,).

        `secondary` is (N, n) or (1, n). Fills x (N, n), nan where there is no answer, and codes (N,), the position of each
        status in `list(Status)`. Calls `solve` for each problem; a solver that has a faster way overrides it. May be called
        from several threads at once, on parts of one batch.
        """
        statuses = list(Status)
        single = dataclasses.replace(self)  # nothing kept between calls is shared between threads
        for i in range(len(matrix)):
            bound = lower[i] if upper is None else upper[i]
            problem = Problem.from_stacked(matrix[i], lower[i], bound, offsets, check=False)
            free = secondary[i % len(secondary)]
            solution = single.solve(problem, free if free.any() else None)
            x[i] = np.nan if solution.x is None else solution.x
            codes[i] = statuses.index(solution.status)

    def reset(self) -> None:
        """Forget what was kept between calls (warm starts, workspaces). A closed form keeps nothing."""

    def _refusal(self, problem: Problem) -> Solution | None:
        sentence = self.refuses(problem)
        return None if sentence is None else Solution(problem, None, Status.REFUSED, message=sentence)


@functools.cache
def _registry() -> dict[str, type[Solver]]:
    package = importlib.import_module("hqp_rp.solvers")
    found: dict[str, type[Solver]] = {}
    for info in pkgutil.iter_modules(package.__path__):
        if info.name.startswith("_"):
            continue
        module = importlib.import_module(f"hqp_rp.solvers.{info.name}")
        for item in vars(module).values():
            if (
                inspect.isclass(item)
                and issubclass(item, Solver)
                and item.__module__ == module.__name__
                and not inspect.isabstract(item)
            ):
                found[item.name] = item
    return found | plugins("hqp_rp.solvers", Solver, found)  # type: ignore[type-abstract]


def all_solvers() -> dict[str, type[Solver]]:
    """Every solver in the solvers folder, and those of other packages' entry points: name -> class, sorted by name."""
    return dict(sorted(_registry().items()))


def get_solver(solver: str | Solver | type[Solver], /, **settings: Any) -> Solver:
    """The solver named `solver` with these settings, or the given solver with these settings replaced.

    Raises:
        UnknownNameError: no solver of that name; the message lists them all.
        SettingError: a setting that the solver does not have; the message lists the ones it has.
    """
    if isinstance(solver, str):
        registry = _registry()
        if solver not in registry:
            raise unknown_name("solver", solver, registry)
        solver = registry[solver]
    if isinstance(solver, Solver):
        _check_settings(type(solver), settings)
        return dataclasses.replace(solver, **settings) if settings else solver
    if inspect.isclass(solver) and issubclass(solver, Solver):
        _check_settings(solver, settings)
        return solver(**settings)
    raise SettingError(f"solver is a {type(solver).__name__}; give a solver's name, a Solver class or a Solver.")


def _check_settings(solver: type[Solver], settings: dict[str, Any]) -> None:
    valid = [field.name for field in dataclasses.fields(solver) if field.init]
    for name in settings:
        if name not in valid:
            raise unknown_setting(solver.name, name, valid)


def solve(
    problem: Problem, solver: str | Solver, /, *, secondary: ArrayLike | None = None, **settings: Any
) -> Solution:
    """Solve `problem` with the solver of that name and these settings, or with a given `Solver`.

    Args:
        problem: the stack to solve.
        solver: a name of `all_solvers()`, or a `Solver`.
        secondary: (n,) free vector for the freedom that all levels leave; None means 0 (least norm).
        settings: fields of the solver.

    Raises `HqpError` for misuse only (unknown name or setting, a secondary vector that does not fit).
    """
    if not isinstance(problem, Problem):
        raise ProblemError(f"problem is a {type(problem).__name__}; build it with hqp_rp.Problem([...]).")
    return get_solver(solver, **settings).solve(problem, checked_secondary(secondary, problem.n))


def require_rank_tolerance(value: object) -> None:
    """Raises `SettingError` unless `value` is a number in [0, 1)."""
    if not isinstance(value, int | float) or not 0.0 <= value < 1.0:
        raise SettingError(f"rank_tolerance is {value!r}; it must be a number in [0, 1).")


def checked_secondary(secondary: ArrayLike | None, n: int) -> FloatArray | None:
    """`secondary` as a contiguous float64 vector (n,), or None. Raises `ProblemError` when it does not fit."""
    if secondary is None:
        return None
    try:
        vector = np.ascontiguousarray(secondary, dtype=np.float64)
    except (TypeError, ValueError):
        raise ProblemError(
            f"secondary is {secondary!r}; it must be {n} finite numbers, one for each unknown."
        ) from None
    if vector.shape != (n,) or not np.isfinite(vector).all():
        raise ProblemError(f"secondary must be {n} finite numbers, one for each unknown; got {vector.tolist()}.")
    return vector
