"""One small QP put to ProxQP, OSQP (native interfaces, workspaces kept) or any other solver that qpsolvers knows."""

from __future__ import annotations

import abc
import contextlib
import dataclasses
import enum
import io
import math
import warnings
from typing import Any

import numpy as np

from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray

INFINITE = 1e20
"""Bounds at or beyond this size are no bounds: the convention of ProxQP and OSQP, applied to every back end."""

_NEVER = 1e-15


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SlackQP:
    """A convex QP with a diagonal Hessian whose first rows are softened by slacks of their own.

    ::

        min_{t, s}  1/2 sum_i hessian_i t_i^2 + gradient . t + 1/2 ||s||^2
        subject to  lower <= rows t + [s; 0] <= upper

    Args:
        hessian: (n,) diagonal, >= 0. gradient: (n,).
        rows: (m, n). lower, upper: (m,), infinite where there is no bound.
        soft: number of leading rows that have a slack; 0 <= soft <= m.
    """

    hessian: FloatArray
    gradient: FloatArray
    rows: FloatArray
    lower: FloatArray
    upper: FloatArray
    soft: int

    @property
    def shape(self) -> tuple[int, int, int]:
        """(n, m, soft): QPs of one shape share a workspace."""
        return (len(self.gradient), len(self.lower), self.soft)

    def slack_columns(self) -> FloatArray:
        """(m, n + soft) matrix of the rows on (t, s)."""
        n, m, soft = self.shape
        matrix = np.zeros((m, n + soft))
        matrix[:, :n] = self.rows
        matrix[range(soft), range(n, n + soft)] = 1.0
        return matrix


class Outcome(enum.Enum):
    """What a back end says of its own run; nobody takes its word for it."""

    CONVERGED = "converged"
    LIMIT = "reached its iteration limit"
    FAILED = "failed"


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class QPAnswer:
    """What a back end returned: t (n,) (None when it failed without any), y (m,) multipliers (> 0 at an upper bound,
    < 0 at a lower one; `hessian * t + gradient + rows^T y = 0`), its own verdict, its iterations, and what it said."""

    t: FloatArray | None
    y: FloatArray
    outcome: Outcome
    iterations: int
    message: str = ""


class Backend(abc.ABC):
    """A QP solver with the workspaces it keeps. Not safe to share between threads.

    `reused`: whether the last solve went through a workspace of an earlier one.
    """

    reused: bool = False

    @abc.abstractmethod
    def solve(self, qp: SlackQP, guess: tuple[FloatArray, FloatArray] | None = None) -> QPAnswer:
        """Solve `qp`, starting from `guess` = (t (n,), y (m,)) where the back end can use one."""

    def reset(self) -> None:
        """Drop every workspace."""


class ProxQPBackend(Backend):
    """ProxQP's dense interface: a proximal augmented Lagrangian (Bambade, El-Kazdadi, Taylor and Carpentier, RSS 2022).

    Settings used: eps_abs as given, eps_rel = 0, diagonal Hessian. ProxQP has no time limit and was seen to stall for
    seconds, so both its outer and its inner iterations are bounded.
    """

    _INNER_ITERATIONS = 200

    def __init__(self, eps_abs: float, max_iterations: int) -> None:
        from proxsuite import proxqp

        self._proxqp = proxqp
        self._eps_abs = eps_abs
        self._max_iterations = max_iterations
        self._workspaces: dict[tuple[int, int, int], Any] = {}

    def solve(self, qp: SlackQP, guess: tuple[FloatArray, FloatArray] | None = None) -> QPAnswer:
        n, m, soft = qp.shape
        warm = guess is not None and m > 0
        solver = self._workspaces.get(qp.shape)
        self.reused = solver is not None
        if solver is None:
            solver = self._workspaces[qp.shape] = self._new(n + soft, m)
            update = solver.init
        else:
            update = solver.update
        hessian = np.diag(np.concatenate([qp.hessian, np.ones(soft)]))
        gradient = np.concatenate([qp.gradient, np.zeros(soft)])
        starts = self._proxqp.InitialGuess
        solver.settings.initial_guess = starts.WARM_START if warm else starts.EQUALITY_CONSTRAINED_INITIAL_GUESS
        if m == 0:
            update(hessian, gradient)
            solver.solve()
        else:
            lower, upper = np.maximum(qp.lower, -INFINITE), np.minimum(qp.upper, INFINITE)
            update(hessian, gradient, None, None, qp.slack_columns(), lower, upper)
            if warm:
                assert guess is not None
                solver.solve(_with_slacks(qp, guess), None, guess[1])
            else:
                solver.solve()
        info = solver.results.info
        outputs = self._proxqp.QPSolverOutput
        outcome = {outputs.PROXQP_SOLVED: Outcome.CONVERGED, outputs.PROXQP_MAX_ITER_REACHED: Outcome.LIMIT}.get(
            info.status, Outcome.FAILED
        )
        t = np.array(solver.results.x[:n])
        y = np.array(solver.results.z)
        message = "" if outcome is Outcome.CONVERGED else f"ProxQP ended with {info.status.name}"
        if not (np.isfinite(t).all() and np.isfinite(y).all()):
            # A NaN stays in a workspace for good.
            del self._workspaces[qp.shape]
            return QPAnswer(None, np.zeros(m), Outcome.FAILED, int(info.iter), "ProxQP returned NaN")
        return QPAnswer(t, y, outcome, int(info.iter), message)

    def _new(self, n: int, m: int) -> Any:
        dense = self._proxqp.dense
        solver = dense.QP(n, 0, m, False, dense.HessianType.Diagonal)
        settings = solver.settings
        settings.eps_abs = self._eps_abs
        settings.eps_rel = 0.0
        # Every QP put here is feasible and bounded; at the default 1e-4 ProxQP at times claims otherwise.
        settings.eps_primal_inf = settings.eps_dual_inf = _NEVER
        settings.max_iter = self._max_iterations
        settings.max_iter_in = self._INNER_ITERATIONS
        return solver

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

    def solve(self, qp: SlackQP, guess: tuple[FloatArray, FloatArray] | None = None) -> QPAnswer:
        n, m, soft = qp.shape
        hessian = np.concatenate([qp.hessian, np.ones(soft)])
        gradient = np.concatenate([qp.gradient, np.zeros(soft)])
        data = np.concatenate([qp.rows.ravel(order="F"), np.ones(soft)])
        solver = self._workspaces.get(qp.shape)
        self.reused = solver is not None
        if solver is None:
            solver = self._workspaces[qp.shape] = self._new(qp, hessian, gradient, data)
        else:
            solver.update(q=gradient, l=qp.lower, u=qp.upper)
            solver.update(Px=hessian, Ax=data if m else None)
        if guess is not None and m:
            solver.warm_start(x=_with_slacks(qp, guess), y=guess[1])
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
        return QPAnswer(np.array(x[:n]), np.array(y[:m]), outcome, iterations, message)

    def _solved(self, result: Any) -> bool:
        return int(result.info.status_val) == int(self._osqp.SolverStatus.OSQP_SOLVED)

    @staticmethod
    def _has_active_rows(qp: SlackQP, result: Any) -> bool:
        n = len(qp.gradient)
        z = qp.rows @ result.x[:n]
        z[: qp.soft] += result.x[n:]
        return bool(((z - qp.lower < -result.y) | (qp.upper - z < result.y)).any())

    def _new(self, qp: SlackQP, hessian: FloatArray, gradient: FloatArray, data: FloatArray) -> Any:
        n, m, soft = qp.shape
        size = n + soft
        indices = np.concatenate([np.tile(np.arange(m), n), np.arange(soft)])
        starts = np.concatenate([np.arange(n) * m, n * m + np.arange(soft + 1)])
        matrix = self._sparse.csc_matrix((data, indices, starts), shape=(m, size))
        diagonal = self._sparse.csc_matrix((hessian, np.arange(size), np.arange(size + 1)), shape=(size, size))
        solver = self._osqp.OSQP(algebra="builtin")
        solver.setup(diagonal, gradient, matrix, qp.lower, qp.upper, **self._settings)
        return solver

    def reset(self) -> None:
        self._workspaces.clear()


class QpsolversBackend(Backend):
    """Any other solver by its qpsolvers name, built anew at each call, at tight tolerances where we know their names.

    Solvers that need a positive definite Hessian (quadprog, DAQP) are led to the answer by a few proximal steps on the
    directions without curvature (Rockafellar 1976).
    """

    _PROXIMAL = 1e-4
    _PROXIMAL_STEPS = 20
    _DENSE_DEFINITE = ("quadprog", "daqp")

    def __init__(self, name: str, eps_abs: float, max_iterations: int) -> None:
        import qpsolvers

        self._name = name
        self._eps_abs = eps_abs
        self._qpsolvers = qpsolvers
        self._sparse_only = name in qpsolvers.sparse_solvers and name not in qpsolvers.dense_solvers
        self._options: dict[str, Any] = {
            "daqp": {"primal_tol": min(eps_abs, 1e-9), "dual_tol": min(eps_abs, 1e-9), "iter_limit": max_iterations},
            "piqp": {"eps_abs": eps_abs, "eps_rel": 0.0, "max_iter": max_iterations},
            "clarabel": {"tol_gap_abs": eps_abs, "tol_gap_rel": eps_abs, "tol_feas": eps_abs},
            "scs": {"eps_abs": eps_abs, "eps_rel": 0.0, "max_iters": 100 * max_iterations},
        }.get(name, {})

    def solve(self, qp: SlackQP, guess: tuple[FloatArray, FloatArray] | None = None) -> QPAnswer:
        n, m, soft = qp.shape
        hessian = np.concatenate([qp.hessian, np.ones(soft)])
        gradient = np.concatenate([qp.gradient, np.zeros(soft)])
        flat = hessian < self._PROXIMAL
        steps = 1
        if self._name in self._DENSE_DEFINITE and flat.any():
            steps = self._PROXIMAL_STEPS
        proximal = np.where(flat, self._PROXIMAL, 0.0) if steps > 1 else np.zeros(n + soft)
        matrix = qp.slack_columns()
        centre = np.zeros(n + soft)
        answer = QPAnswer(None, np.zeros(m), Outcome.FAILED, 0)
        for step in range(steps):
            answer = self._solve_once(matrix, qp, hessian + proximal, gradient - proximal * centre)
            if answer.t is None or answer.outcome is not Outcome.CONVERGED:
                return dataclasses.replace(answer, t=None if answer.t is None else answer.t[:n])
            moved = float(np.abs(proximal * (answer.t - centre)).max())
            centre = answer.t
            if moved <= self._eps_abs:
                break
        assert answer.t is not None
        return dataclasses.replace(answer, t=answer.t[:n], iterations=step + 1)

    def _solve_once(self, matrix: FloatArray, qp: SlackQP, hessian: FloatArray, gradient: FloatArray) -> QPAnswer:
        above, below = qp.upper < INFINITE, qp.lower > -INFINITE
        G = np.concatenate([matrix[above], -matrix[below]])
        h = np.concatenate([qp.upper[above], -qp.lower[below]])
        P: Any = np.diag(hessian)
        if self._sparse_only:
            from scipy import sparse

            P, G = sparse.csc_matrix(P), sparse.csc_matrix(G)
        constraints = (G, h) if len(h) else (None, None)
        none = np.zeros(len(qp.lower))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                problem = self._qpsolvers.Problem(P, gradient, *constraints)
                found = self._qpsolvers.solve_problem(problem, solver=self._name, **self._options)
        except (ArithmeticError, ValueError, RuntimeError, self._qpsolvers.exceptions.QPError) as error:
            return QPAnswer(None, none, Outcome.FAILED, 0, f"{self._name} failed: {error}")
        if found.x is None or not np.isfinite(found.x).all():
            return QPAnswer(None, none, Outcome.FAILED, 0, f"{self._name} found no answer")
        y = none
        if len(h) and found.z is not None and len(found.z) == len(h):
            count = int(above.sum())
            y[above] += found.z[:count]
            y[below] -= found.z[count:]
        outcome = Outcome.CONVERGED if found.found else Outcome.LIMIT
        message = "" if found.found else f"{self._name} did not converge"
        return QPAnswer(np.array(found.x), y, outcome, 1, message)


def _with_slacks(qp: SlackQP, guess: tuple[FloatArray, FloatArray]) -> FloatArray:
    """(t, s) with the slacks that the multipliers imply: s = -y on soft rows, from the stationarity in s."""
    t, y = guess
    return np.concatenate([t, -y[: qp.soft]])


def installed_backends() -> tuple[str, ...]:
    """Names of the QP solvers that can be used here, sorted: what qpsolvers finds installed."""
    import qpsolvers

    return tuple(sorted(qpsolvers.available_solvers))


def check_backend(name: object) -> None:
    """Raises `SettingError` that lists the installed back ends unless `name` is one of them."""
    installed = installed_backends()
    if name not in installed:
        raise SettingError(
            f"backend is {name!r}, which is not installed here or no QP solver; installed: {', '.join(installed)}. "
            "Others that qpsolvers knows can be installed beside it."
        )


def check_positive(name: str, value: object) -> None:
    """Raises `SettingError` unless `value` is a finite number > 0."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not (0.0 < value < math.inf):
        raise SettingError(f"{name} is {value!r}; it must be a finite number > 0.")


def make_backend(name: str, eps_abs: float, max_iterations: int) -> Backend:
    """The back end of that name: ProxQP and OSQP through their native interfaces, others through qpsolvers.

    Args:
        name: one of `installed_backends()`. eps_abs: absolute tolerance of the scaled QP. max_iterations: its limit.
    """
    check_backend(name)
    if name == "proxqp":
        return ProxQPBackend(eps_abs, max_iterations)
    if name == "osqp":
        return OSQPBackend(eps_abs, max_iterations)
    return QpsolversBackend(name, eps_abs, max_iterations)
