"""Who is timed on the families: our solvers through their public call, and what a user would pick instead."""

from __future__ import annotations

import dataclasses
import functools
import importlib.util
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hqp_rp.compare.contestants import variants
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.solver import Solver, all_solvers, get_solver

say = Sentences(__file__)

Call = Callable[[], Any]


@dataclasses.dataclass(frozen=True, slots=True)
class Entrant:
    """One who solves problems, ready to be timed.

    Attributes:
        label: in tables. peer: not ours. settings: how it is set, in words or as the solver's repr.
        refuses: a sentence that says why it cannot take a problem, or None.
        prepare: one call for each problem, with everything built that a control loop would have at hand.
        answer: x (n,) from what a call returned, or None.
        path_only: takes part only where problems are neighbours, since its warm start needs it.
    """

    label: str
    peer: bool
    settings: str
    refuses: Callable[[Problem], str | None]
    prepare: Callable[[Sequence[Problem]], list[Call]]
    answer: Callable[[Any], FloatArray | None]
    path_only: bool = False


def our_entrants() -> list[Entrant]:
    """Every solver at its defaults; active set cold and warm, the QP cascade also on OSQP."""
    chosen: list[tuple[str, Solver, bool]] = []
    for name in all_solvers():
        if name == "hierarchical_active_set":
            chosen.append(("active set, cold", get_solver(name, warm_start=False), False))
            chosen.append(("active set, warm", get_solver(name), True))
            continue
        chosen.append((variants(name)[0].label, variants(name)[0].solver, False))
        if name == "qp_cascade":
            chosen.append(("QP OSQP", get_solver(name, backend="osqp"), False))
    return [_ours(label, solver, path_only) for label, solver, path_only in chosen]


def _ours(label: str, solver: Solver, path_only: bool) -> Entrant:
    def prepare(problems: Sequence[Problem]) -> list[Call]:
        fresh = dataclasses.replace(solver)  # workspaces and warm starts of its own
        return [functools.partial(fresh.solve, problem) for problem in problems]

    return Entrant(label, False, repr(solver), solver.refuses, prepare, lambda solution: solution.x, path_only)


SOLVER_PEERS = ("daqp", "numpy", "qpsolvers")
"""Peers that solve a problem as it is: name for `--peer`."""


def peer_entrants(names: Sequence[str] = SOLVER_PEERS) -> tuple[list[Entrant], list[str]]:
    """The peers of these names that can be imported, and a sentence for each one that cannot."""
    found: list[Entrant] = []
    missing = []
    for name in names:
        if name in SOLVER_PEERS and importlib.util.find_spec(name) is None:
            missing.append(not_installed(name))
        elif name == "daqp":
            found += [
                Entrant("DAQP, defaults", True, say("daqp_defaults"), _anything, _daqp_defaults, _first),
                Entrant("DAQP, accurate", True, say("daqp_accurate", softness=_RHO, warm=False), _anything,
                        _daqp_accurate, _first),
                Entrant("DAQP, accurate, warm", True, say("daqp_accurate", softness=_RHO, warm=True), _anything,
                        functools.partial(_daqp_accurate, warm=True), _first, path_only=True),
            ]  # fmt: skip
        elif name == "numpy":
            settings = say("numpy_cascade")
            found.append(Entrant("numpy SVD cascade", True, settings, _equalities, _numpy_cascade, _itself))
        elif name == "qpsolvers":
            settings = say("qp_cascade", weight=_TIKHONOV)
            found.append(Entrant("plain QP cascade", True, settings, _equality_levels, _qpsolvers_cascade, _itself))
    return found, missing


def not_installed(name: str) -> str:
    """The sentence about a peer that cannot be imported here."""
    package = {"pink": "pin-pink"}.get(name, name)
    return say("not_installed", name=name, package=package)


def _anything(problem: Problem) -> str | None:
    return None


def _equalities(problem: Problem) -> str | None:
    return None if problem.is_equality and problem.hard is None else say("equalities_only")


def _equality_levels(problem: Problem) -> str | None:
    return None if problem.is_equality else say("two_sided_rows_hard_only")


def _itself(x: FloatArray | None) -> FloatArray | None:
    return x


def _first(found: tuple[Any, ...]) -> FloatArray | None:
    return found[0] if found[2] > 0 else None


_EQUALITY_ROW = 5  # DAQP's flag of an equality
_RHO = 1e-6


def _daqp_defaults(problems: Sequence[Problem]) -> list[Call]:
    import daqp

    calls: list[Call] = []
    for problem in problems:
        matrix, lower, upper, offsets = problem.with_hard
        sense = np.where(lower == upper, _EQUALITY_ROW, 0).astype(np.int32)
        ends = offsets[1:].astype(np.int32)
        arrays = (np.array(matrix), np.array(upper), np.array(lower))
        calls.append(functools.partial(daqp.solve, None, None, *arrays, sense, ends))
    return calls


def _daqp_accurate(problems: Sequence[Problem], warm: bool = False) -> list[Call]:
    """Rows of length one, so that DAQP's own scaling changes nothing; the softness restores each row's weight."""
    import daqp

    from hqp_rp.solvers.daqp import unit_rows

    models: dict[tuple[Any, ...], Any] = {}

    def solve(key: tuple[Any, ...], rows: Any, low: Any, up: Any, sense: Any, softness: Any) -> tuple[Any, ...]:
        model = models[key]
        flag = model.update(A=rows, bupper=up, blower=low, sense=None if warm else sense)
        if flag < 0:
            return None, None, flag
        model.soft_weights(softness, softness)
        found: tuple[Any, ...] = model.solve()
        return found

    calls: list[Call] = []
    for problem in problems:
        offsets = problem.with_hard.offsets
        given = unit_rows(problem.with_hard, np.zeros(problem.n), _RHO)
        assert given is not None
        rows, low, up, softness, sense = given
        key = (problem.n, offsets.tobytes())
        if key not in models:
            model = daqp.Model()
            model.settings = {"primal_tol": 1e-9, "iter_limit": 10_000}
            model.setup(np.eye(problem.n), None, rows, up, low, sense, offsets[1:].astype(np.int32))
            models[key] = model
        calls.append(functools.partial(solve, key, rows, low, up, sense, softness))
    return calls


def numpy_cascade(levels: Sequence[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """x (n,) of least norm, each (A, b) in the null space of the ones before it: what a textbook reader writes in numpy."""
    n = levels[0][0].shape[1]
    x, Z = np.zeros(n), np.eye(n)
    for A, b in levels:
        if not Z.shape[1]:
            break
        U, sigma, Vt = np.linalg.svd(A @ Z)
        rank = int((sigma > 1e-12 * np.linalg.norm(A)).sum())
        x = x + Z @ (Vt[:rank].T @ ((U[:, :rank].T @ (b - A @ x)) / sigma[:rank]))
        Z = Z @ Vt[rank:].T
    return x


def _numpy_cascade(problems: Sequence[Problem]) -> list[Call]:
    return [
        functools.partial(numpy_cascade, [(level.A, level.lower) for level in problem.levels]) for problem in problems
    ]


_TIKHONOV = 1e-10


def _qpsolvers_cascade(problems: Sequence[Problem]) -> list[Call]:
    import qpsolvers

    def solve(problem: Problem, G: FloatArray | None, h: FloatArray | None) -> FloatArray | None:
        A = np.empty((0, problem.n))
        b = np.empty(0)
        x = None
        wanted = [(level.A, level.lower) for level in problem.levels]
        for J, rate in [*wanted, (np.eye(problem.n), np.zeros(problem.n))]:
            P = J.T @ J + _TIKHONOV * np.eye(problem.n)
            held: dict[str, Any] = {"A": A, "b": b} if len(b) else {}
            x = qpsolvers.solve_qp(P, -J.T @ rate, G, h, **held, solver="piqp")
            if x is None:
                return None
            A, b = np.concatenate((A, J)), np.concatenate((b, J @ x))
        return x

    calls: list[Call] = []
    for problem in problems:
        G = h = None
        if problem.hard is not None:
            finite = np.isfinite(problem.hard.upper), np.isfinite(problem.hard.lower)
            G = np.concatenate((problem.hard.A[finite[0]], -problem.hard.A[finite[1]]))
            h = np.concatenate((problem.hard.upper[finite[0]], -problem.hard.lower[finite[1]]))
        calls.append(functools.partial(solve, problem, G, h))
    return calls
