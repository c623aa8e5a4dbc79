"""One small QP, what a back end answers, and the back ends that are reached through qpsolvers."""

from __future__ import annotations

import abc
import enum
import math
import warnings
from typing import Any, NamedTuple

import numpy as np

from hqp_rp.core.errors import SettingError
from hqp_rp.core.extras import require
from hqp_rp.core.problem import FloatArray

INFINITE = 1e20
"""Bounds at or beyond this size are no bounds: the convention of ProxQP and OSQP, applied to every back end."""


NOTHING = np.zeros(0)
"""No answer; not to be written to."""


class SlackQP(NamedTuple):
    """A convex QP whose first rows are softened by slacks of their own, on the unknowns u = (t, s), N = n + soft.

    ::

        min_u  1/2 u^T hessian u + gradient . u    subject to    lower <= slack_rows u <= upper

    with `hessian` the identity on s and `slack_rows = [rows I; rows 0]`, the identity beside the first `soft` rows.

    Args:
        hessian: (N, N), positive semidefinite. gradient: (N,).
        rows: (m, n). slack_rows: (m, N). lower, upper: (m,), at or beyond `INFINITE` where there is no bound.
        start, y: (N,), (m,) what an earlier answer says of this QP's answer and multipliers; zeros where nothing does.
        soft: number of leading rows that have a slack; 0 <= soft <= m.

    Arrays may be views that change with the next QP.
    """

    hessian: FloatArray
    gradient: FloatArray
    rows: FloatArray
    slack_rows: FloatArray
    lower: FloatArray
    upper: FloatArray
    start: FloatArray
    y: FloatArray
    soft: int

    @classmethod
    def of(cls, curvature: FloatArray, gradient: FloatArray, rows: FloatArray, bounds: Any, soft: int) -> SlackQP:
        """From curvature (n, n), gradient (n,), rows (m, n) and bounds (lower, upper) on t, without a guess."""
        (m, n), full = rows.shape, len(gradient) + soft
        hessian = np.eye(full)
        hessian[:n, :n] = curvature
        slack_rows = np.concatenate((rows, np.eye(m, soft)), axis=1)
        whole = np.concatenate((gradient, np.zeros(soft)))
        low, up = (np.clip(np.asarray(bound, dtype=np.float64), -INFINITE, INFINITE) for bound in bounds)
        return cls(hessian, whole, np.ascontiguousarray(rows), slack_rows, low, up, np.zeros(full), np.zeros(m), soft)

    @property
    def shape(self) -> tuple[int, int, int]:
        """(n, m, soft): QPs of one shape share a workspace."""
        return (len(self.gradient) - self.soft, len(self.lower), self.soft)


class Outcome(enum.Enum):
    """What a back end says of its own run; nobody takes its word for it."""

    CONVERGED = "converged"
    LIMIT = "reached its iteration limit"
    FAILED = "failed"


class QPAnswer(NamedTuple):
    """What a back end returned: t (n,) or longer (None when it failed without any), y (m,) multipliers (> 0 at an upper bound,
    < 0 at a lower one; `hessian u + gradient + slack_rows^T y = 0`), its own verdict, its iterations, and what it said."""

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
    def solve(self, qp: SlackQP, guessed: bool = False) -> QPAnswer:
        """Solve `qp`, from its `start` and `y` where `guessed` and the back end can use them.

        The answer may be a view that the next solve overwrites, t with the slacks behind it.
        """

    def reset(self) -> None:
        """Drop every workspace."""


class _Known(NamedTuple):
    """What is known of a solver: its names for our settings, and whether it needs a positive definite Hessian."""

    options: dict[str, Any]
    definite: bool = False


class QpsolversBackend(Backend):
    """Any other solver by its qpsolvers name, built anew at each call, at tight tolerances where we know their names.

    Solvers that need a positive definite Hessian (quadprog, DAQP) are led to the answer by a few proximal steps on the
    directions without curvature (Rockafellar 1976). Every QP put here can be met; where many rows pass through one point,
    rounding makes quadprog call it inconsistent all the same, so a QP without an answer is tried once more with its bounds
    moved apart by a tenth of eps_abs.
    """

    _PROXIMAL = 1e-4
    _PROXIMAL_STEPS = 20
    _APART = 0.1

    def __init__(self, name: str, eps_abs: float, max_iterations: int) -> None:
        import qpsolvers

        self._name = name
        self._eps_abs = eps_abs
        self._qpsolvers = qpsolvers
        self._sparse_only = name in qpsolvers.sparse_solvers and name not in qpsolvers.dense_solvers
        tight = min(eps_abs, 1e-9)
        known = dict(  # noqa: C408  as keywords: a back end is no solver of ours, whatever its name
            daqp=_Known({"primal_tol": tight, "dual_tol": tight, "iter_limit": max_iterations}, definite=True),
            quadprog=_Known({}, definite=True),
            piqp=_Known({"eps_abs": eps_abs, "eps_rel": 0.0, "max_iter": max_iterations}),
            clarabel=_Known({"tol_gap_abs": eps_abs, "tol_gap_rel": eps_abs, "tol_feas": eps_abs}),
            scs=_Known({"eps_abs": eps_abs, "eps_rel": 0.0, "max_iters": 100 * max_iterations}),
        ).get(name, _Known({}))
        self._options = known.options
        self._needs_definite = known.definite

    def solve(self, qp: SlackQP, guessed: bool = False) -> QPAnswer:
        n, m, soft = qp.shape
        curved = float(np.linalg.eigvalsh(qp.hessian)[0]) >= self._PROXIMAL if n + soft else True
        steps = self._PROXIMAL_STEPS if self._needs_definite and not curved else 1
        proximal = self._PROXIMAL * (np.arange(n + soft) < n) if steps > 1 else np.zeros(n + soft)
        centre = np.zeros(n + soft)
        answer = QPAnswer(None, np.zeros(m), Outcome.FAILED, 0)
        solves = 0
        for _ in range(steps):
            solves += 1
            hessian, gradient = qp.hessian + np.diag(proximal), qp.gradient - proximal * centre
            answer = self._solve_once(qp, hessian, gradient)
            if answer.t is None and m:
                apart = self._APART * self._eps_abs
                answer = self._solve_once(
                    qp._replace(lower=qp.lower - apart, upper=qp.upper + apart), hessian, gradient
                )
            if answer.t is None or answer.outcome is not Outcome.CONVERGED:
                return answer
            moved = float(np.abs(proximal * (answer.t - centre)).max(initial=0.0))
            centre = answer.t
            if moved <= self._eps_abs:
                break
        return answer._replace(iterations=solves)

    def _solve_once(self, qp: SlackQP, hessian: FloatArray, gradient: FloatArray) -> QPAnswer:
        above, below = qp.upper < INFINITE, qp.lower > -INFINITE
        G = np.concatenate([qp.slack_rows[above], -qp.slack_rows[below]])
        h = np.concatenate([qp.upper[above], -qp.lower[below]])
        P: Any = hessian
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


def installed_backends() -> tuple[str, ...]:
    """Names of the QP solvers that can be used here, sorted: what qpsolvers finds installed."""
    require("A QP back end", "qpsolvers", "proxsuite", "osqp")
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
    from hqp_rp.core.qp_native import OSQPBackend, ProxQPBackend

    if name == "proxqp":
        return ProxQPBackend(eps_abs, max_iterations)
    if name == "osqp":
        return OSQPBackend(eps_abs, max_iterations)
    return QpsolversBackend(name, eps_abs, max_iterations)
