"""What solvers that stand on QPs keep between calls: back ends, and the stages of each shape of problem."""

from __future__ import annotations

import threading
from typing import Any

from hqp_rp.core.problem import Problem
from hqp_rp.core.qp_backend import Backend, make_backend
from hqp_rp.core.qp_stages import Stages


class Workspace(threading.local):
    """Back ends and stages, those of each thread apart: a solver may be shared between threads. A copy or a pickle is empty."""

    def __init__(self) -> None:
        self._backends: dict[tuple[str, float, int], Backend] = {}
        self._stages: dict[tuple[object, ...], Stages] = {}

    def backend(self, name: str, eps_abs: float, max_iterations: int) -> Backend:
        """The kept back end of these settings, made when first asked for."""
        key = (name, eps_abs, max_iterations)
        found = self._backends.get(key)
        if found is None:
            found = self._backends[key] = make_backend(name, eps_abs, max_iterations)
        return found

    def stages(self, problem: Problem) -> Stages:
        """The stages of the problems that have the shape of `problem`."""
        key = (problem.n, problem.hard_rows, problem.given_offsets.tobytes())
        found = self._stages.get(key)
        if found is None:
            found = self._stages[key] = Stages(problem.n, problem.hard_rows, problem.given_offsets)
        return found

    def clear(self) -> None:
        """Forget everything of this thread."""
        self._backends.clear()
        self._stages.clear()

    def __copy__(self) -> Workspace:
        return Workspace()

    def __deepcopy__(self, memo: Any) -> Workspace:
        return Workspace()

    def __reduce__(self) -> tuple[object, ...]:
        return (Workspace, ())
