"""What solvers that stand on QPs keep between calls: back ends, and a desk with warm starts for each shape of problem."""

from __future__ import annotations

from hqp_rp.core.problem import Problem
from hqp_rp.core.qp_backend import Backend, make_backend
from hqp_rp.core.qp_descent import Desk


class Workspace:
    """Back ends and desks; a copy or a pickle of it is empty."""

    def __init__(self) -> None:
        self._backends: dict[tuple[str, float, int], Backend] = {}
        self._desks: dict[tuple[object, ...], Desk] = {}

    def backend(self, name: str, eps_abs: float, max_iterations: int) -> Backend:
        """The kept back end of these settings, made when first asked for."""
        key = (name, eps_abs, max_iterations)
        found = self._backends.get(key)
        if found is None:
            found = self._backends[key] = make_backend(name, eps_abs, max_iterations)
        return found

    def desk(self, problem: Problem) -> Desk:
        """The desk of the problems that have the shape of `problem`."""
        key = (problem.n, problem.hard_rows, problem.given_offsets.tobytes())
        found = self._desks.get(key)
        if found is None:
            found = self._desks[key] = Desk(problem.n, problem.hard_rows, problem.offsets)
        return found

    def clear(self) -> None:
        """Forget everything."""
        self._backends.clear()
        self._desks.clear()

    def __reduce__(self) -> tuple[object, ...]:
        return (Workspace, ())
