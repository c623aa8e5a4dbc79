"""ProxQP and OSQP through their native interfaces, with workspaces kept between QPs of one shape."""

from __future__ import annotations

import atexit
import contextlib
import io
import math
import weakref
from typing import Any, NamedTuple

import numpy as np

from hqp_rp.core.problem import FloatArray
from hqp_rp.core.qp_backend import NOTHING, Backend, Outcome, QPAnswer, SlackQP

_INNER_ITERATIONS = 100
_NEVER = 1e-15


_alive: weakref.WeakSet[ProxQPBackend] = weakref.WeakSet()


@atexit.register
def _let_go() -> None:
    """Drop ProxQP's objects before the interpreter ends: its binding writes a page of warnings about each one still held."""
    for backend in list(_alive):
        vars(backend).clear()


class _Kept(NamedTuple):
    """ProxQP's objects for QPs of one shape, and views of its answers."""

    solver: Any
    settings: Any
    x: FloatArray
    z: FloatArray
    info: Any


class ProxQPBackend(Backend):
    """ProxQP's dense interface: a proximal augmented Lagrangian (Bambade, El-Kazdadi, Taylor and Carpentier, RSS 2022).

    Settings used: eps_abs as given, eps_rel = 0, the duality gap checked. ProxQP has no time limit
    and was seen to stall for seconds: its outer iterations are bounded by `max_iterations`, the inner ones of each by a
    constant.
    """

    def __init__(self, eps_abs: float, max_iterations: int) -> None:
        from proxsuite import proxqp

        _alive.add(self)
        self._proxqp = proxqp
        self._eps_abs = eps_abs
        self._max_iterations = max_iterations
        self._cold = proxqp.InitialGuess.EQUALITY_CONSTRAINED_INITIAL_GUESS
        self._warm = proxqp.InitialGuess.WARM_START
        self._solved = proxqp.QPSolverOutput.PROXQP_SOLVED
        self._limit = proxqp.QPSolverOutput.PROXQP_MAX_ITER_REACHED
        self._workspaces: dict[tuple[int, int], _Kept] = {}

    def solve(self, qp: SlackQP, guessed: bool = False) -> QPAnswer:
        n, m = shape = len(qp.gradient), len(qp.lower)
        kept = self._workspaces.get(shape)
        self.reused = kept is not None
        if kept is None:
            kept = self._workspaces[shape] = self._new(n, m)
            pass_on = kept.solver.init
        else:
            pass_on = kept.solver.update
        warm = guessed and m > 0
        kept.settings.initial_guess = self._warm if warm else self._cold
        if m:
            pass_on(qp.hessian, qp.gradient, None, None, qp.slack_rows, qp.lower, qp.upper)
        else:
            pass_on(qp.hessian, qp.gradient)
        if warm:
            kept.solver.solve(qp.start, None, qp.y)
        else:
            kept.solver.solve()
        info, t, y = kept.info, kept.x, kept.z if m else NOTHING
        status = info.status
        if status == self._solved:
            return QPAnswer(t, y, Outcome.CONVERGED, info.iter)
        if not math.isfinite((t @ t) + (y @ y)):
            # A NaN stays in a workspace for good.
            del self._workspaces[shape]
            return QPAnswer(None, np.zeros(m), Outcome.FAILED, info.iter, "ProxQP returned NaN")
        outcome = Outcome.LIMIT if status == self._limit else Outcome.FAILED
        return QPAnswer(t.copy(), y.copy(), outcome, info.iter, f"ProxQP ended with {status.name}")

    def _new(self, n: int, m: int) -> _Kept:
        dense = self._proxqp.dense
        solver = dense.QP(n, 0, m, False, dense.HessianType.Dense)
        settings = solver.settings
        settings.eps_abs = self._eps_abs
        settings.eps_rel = 0.0
        # Off by default, and then a row with a multiplier may end up away from its bound: errors of 1e-4 at eps 1e-9.
        settings.check_duality_gap = True
        settings.eps_duality_gap_abs = self._eps_abs
        settings.eps_duality_gap_rel = 0.0
        # Every QP put here is feasible and bounded; at the default 1e-4 ProxQP at times claims otherwise.
        settings.eps_primal_inf = settings.eps_dual_inf = _NEVER
        settings.max_iter = self._max_iterations
        settings.max_iter_in = _INNER_ITERATIONS
        results = solver.results
        return _Kept(solver, settings, results.x, results.z, results.info)

    def reset(self) -> None:
        self._workspaces.clear()


class OSQPBackend(Backend):
    """OSQP's native interface: operator splitting with polishing (Stellato, Banjac, Goulart, Bemporad and Boyd 2020).

    Settings used: eps_abs = eps_rel as given; polishing whenever a row is active. A workspace is set up with the full
    pattern of its shape, so that later problems of that shape only replace numbers.
    """

    def __init__(self, eps_abs: float, max_iterations: int) -> None:
        import osqp
        from scipy import sparse

        self._osqp = osqp
        self._sparse = sparse
        self._settings = {
            "eps_abs": eps_abs,
            "eps_rel": eps_abs,
            "eps_prim_inf": _NEVER,
            "eps_dual_inf": _NEVER,
            "max_iter": max_iterations,
            "verbose": False,
        }
        self._workspaces: dict[tuple[int, int, int], Any] = {}

    def solve(self, qp: SlackQP, guessed: bool = False) -> QPAnswer:
        n, m, soft = qp.shape
        curvature = np.concatenate([qp.hessian[:n, :n].T[np.tril_indices(n)], np.ones(soft)])
        data = np.concatenate([qp.rows.ravel(order="F"), np.ones(soft)])
        solver = self._workspaces.get(qp.shape)
        self.reused = solver is not None
        if solver is None:
            solver = self._workspaces[qp.shape] = self._new(qp, curvature, data)
        else:
            solver.update(q=qp.gradient, l=qp.lower, u=qp.upper)
            solver.update(Px=curvature, Ax=data if m else None)
        if guessed and m:
            solver.warm_start(x=qp.start, y=qp.y)
        else:
            solver.warm_start(x=np.zeros(n + soft), y=np.zeros(m))
        solver.update_settings(polishing=False)
        result = solver.solve(raise_error=False)
        iterations = int(result.info.iter)
        if m and self._solved(result) and self._has_active_rows(qp, result):
            # Asked to polish where no row is active, OSQP writes to standard output whatever `verbose` says.
            solver.update_settings(polishing=True)
            with contextlib.redirect_stdout(io.StringIO()):
                polished = solver.solve(raise_error=False)
            iterations += int(polished.info.iter)
            if self._solved(polished):
                result = polished
        status = int(result.info.status_val)
        values = self._osqp.SolverStatus
        if self._solved(result):
            outcome = Outcome.CONVERGED
        elif status in (values.OSQP_MAX_ITER_REACHED, values.OSQP_SOLVED_INACCURATE, values.OSQP_TIME_LIMIT_REACHED):
            outcome = Outcome.LIMIT
        else:
            outcome = Outcome.FAILED
        message = "" if outcome is Outcome.CONVERGED else f"OSQP ended with {result.info.status!r}"
        x, y = result.x, result.y
        if x is None or not (np.isfinite(x).all() and np.isfinite(y).all()):
            del self._workspaces[qp.shape]
            return QPAnswer(None, np.zeros(m), Outcome.FAILED, iterations, message or "OSQP returned NaN")
        return QPAnswer(np.array(x), np.array(y[:m]), outcome, iterations, message)

    def _solved(self, result: Any) -> bool:
        return int(result.info.status_val) == int(self._osqp.SolverStatus.OSQP_SOLVED)

    @staticmethod
    def _has_active_rows(qp: SlackQP, result: Any) -> bool:
        z = qp.slack_rows @ result.x
        return bool(((z - qp.lower < -result.y) | (qp.upper - z < result.y)).any())

    def _new(self, qp: SlackQP, curvature: FloatArray, data: FloatArray) -> Any:
        n, m, soft = qp.shape
        size = n + soft
        indices = np.concatenate([np.tile(np.arange(m), n), np.arange(soft)])
        starts = np.concatenate([np.arange(n) * m, n * m + np.arange(soft + 1)])
        matrix = self._sparse.csc_matrix((data, indices, starts), shape=(m, size))
        above = np.concatenate([np.arange(j + 1) for j in range(n)] + [np.arange(n, size)]).astype(np.int64)
        columns = np.cumsum([0, *range(1, n + 1), *([1] * soft)])
        upper = self._sparse.csc_matrix((curvature, above, columns), shape=(size, size))
        solver = self._osqp.OSQP(algebra="builtin")
        solver.setup(upper, qp.gradient, matrix, qp.lower, qp.upper, **self._settings)
        return solver

    def reset(self) -> None:
        self._workspaces.clear()
