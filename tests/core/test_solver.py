"""The registry, settings and `solve`: what misuse looks like, and that a refusal is a status."""

import dataclasses
import importlib
import pathlib
from typing import ClassVar

import numpy as np
import pytest

import hqp_rp
from hqp_rp import (
    Problem,
    ProblemError,
    SettingError,
    Solution,
    Solver,
    Status,
    UnknownNameError,
    all_solvers,
    get_solver,
)
from hqp_rp.core.solver import checked_secondary
from tests.problems import boxed, independent, two_sided


@dataclasses.dataclass(frozen=True, kw_only=True)
class Constant(Solver):
    """Returns the same entry everywhere: enough to see what `solve` hands over."""

    name: ClassVar[str] = "constant"
    summary: ClassVar[str] = "A constant."
    source: ClassVar[str] = "None."
    entry: float = 1.0

    def solve(self, problem: Problem, secondary: np.ndarray | None = None) -> Solution:
        refusal = self._refusal(problem)
        return refusal or Solution(problem, np.full(problem.n, self.entry), secondary=secondary)


def test_every_solver_is_one_file_named_after_it() -> None:
    folder = pathlib.Path(next(iter(importlib.import_module("hqp_rp.solvers").__path__)))
    files = {path.stem for path in folder.glob("*.py") if not path.stem.startswith("_")}
    assert set(all_solvers()) == files
    for name, solver in all_solvers().items():
        assert solver.name == name
        assert solver.summary
        assert solver.source
        assert dataclasses.is_dataclass(solver)
        assert 0 < solver().tolerance < 1e-2
        with pytest.raises(dataclasses.FrozenInstanceError):
            solver().name = "other"  # type: ignore[misc]
    assert list(all_solvers()) == sorted(all_solvers())


def test_all_solvers_returns_a_copy() -> None:
    all_solvers().clear()
    assert all_solvers()


def test_get_solver_from_name_class_or_solver() -> None:
    name, kind = next(iter(all_solvers().items()))
    assert type(get_solver(name)) is kind
    assert get_solver(Constant, entry=2.0) == Constant(entry=2.0)
    assert get_solver(Constant(), entry=2.0) == Constant(entry=2.0)
    solver = Constant()
    assert get_solver(solver) is solver


def test_unknown_names_and_settings() -> None:
    with pytest.raises(
        UnknownNameError, match=r"no solver named 'nul_space'\. Did you mean 'null_space'\? Valid: .*weighted"
    ):
        get_solver("nul_space")
    with pytest.raises(
        SettingError, match=r"no setting of constant named 'enty'\. Did you mean 'entry'\? Valid: entry\."
    ):
        hqp_rp.solve(independent(0), Constant(), enty=1)
    with pytest.raises(SettingError, match=r"no setting of constant named 'name'"):
        get_solver(Constant, name="x")
    with pytest.raises(SettingError, match="solver is a float; give a solver's name"):
        get_solver(3.5)  # type: ignore[arg-type]


def test_solve_hands_over_problem_and_secondary() -> None:
    problem = independent(0)
    solution = hqp_rp.solve(problem, Constant(), secondary=[1, 2, 3, 4, 5, 6, 7], entry=3)
    assert solution.problem is problem
    assert solution.x is not None
    assert solution.x.tolist() == [3] * 7
    assert solution.secondary is not None
    assert solution.secondary.dtype == np.float64
    assert solution.secondary.tolist() == [1, 2, 3, 4, 5, 6, 7]
    assert hqp_rp.solve(problem, Constant()).secondary is None


def test_misuse_of_solve() -> None:
    with pytest.raises(ProblemError, match=r"problem is a ndarray; build it with hqp_rp.Problem"):
        hqp_rp.solve(np.eye(3), Constant())  # type: ignore[arg-type]
    for bad in ([1, 2], [np.nan] * 7, np.zeros((7, 1)), "seven", [[1], [1, 2]]):
        with pytest.raises(ProblemError, match=r"secondary .*7 finite numbers"):
            hqp_rp.solve(independent(0), Constant(), secondary=bad)
    assert checked_secondary(None, 3) is None


def test_a_refusal_is_a_status_with_a_sentence() -> None:
    for problem, text in ((two_sided(0), "solves equalities only"), (boxed(independent(0), 1.0), "without hard rows")):
        solution = hqp_rp.solve(problem, Constant())
        assert solution.status is Status.REFUSED
        assert solution.x is None
        assert text in solution.message
        assert solution.message == Constant().refuses(problem)
    assert Constant().refuses(independent(0)) is None


def test_the_root_of_all_errors() -> None:
    for error in (
        ProblemError,
        UnknownNameError,
        SettingError,
        hqp_rp.FileError,
        hqp_rp.RobotError,
        hqp_rp.MissingExtraError,
    ):
        assert issubclass(error, hqp_rp.HqpError)
