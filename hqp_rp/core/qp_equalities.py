"""Levels of equalities by QPs, the quick way: what it cannot prove it leaves to the general descent."""

from __future__ import annotations

from typing import Any

import numpy as np

from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.core.qp_backend import NOTHING, Backend
from hqp_rp.core.solver import RANK_TOLERANCE


class QuickDesk:
    """The arrays on which levels of equalities of one shape are solved; `held` (M,): no row is held, read-only.

    Args:
        n, offsets: unknowns, and the levels' offsets.
    """

    def __init__(self, n: int, offsets: Any) -> None:
        from hqp_rp.core.kernels import qp_equalities

        kernels: Any = qp_equalities
        p, rows = len(offsets) - 1, int(offsets[-1])
        _, _, vectors, *_, numbers, _, counts = kernels.room_parts(n, rows, p)
        self._numbers, self._counts = np.zeros(numbers), np.zeros(counts, np.int64)
        self._counts[kernels.N], self._counts[kernels.M], self._counts[kernels.P] = n, rows, p
        self._numbers[kernels.RANK_TOLERANCE] = RANK_TOLERANCE
        wide = (kernels.VECTORS, (n + 7) // 8 * 8)
        start, x, _, u, _, _, g = self._numbers[vectors : vectors + wide[0] * wide[1]].reshape(wide)
        u[:n] = np.random.default_rng(0).standard_normal(n)
        self._x, self._start = x[:n], start[:n]
        self._gradients = [g[:r] for r in range(n + 1)]
        self._go_on, self._tolerance = kernels.go_on_entry(), self._numbers[kernels.TOLERANCE : kernels.TOLERANCE + 1]
        self._moved = False
        self.held = np.zeros(rows, np.int8)
        self.held.flags.writeable = False

    def solve(
        self, problem: Problem, secondary: FloatArray | None, backend: Backend, tolerance: float
    ) -> tuple[FloatArray | None, int]:
        """(x (n,), iterations): x is proven optimal to the relative `tolerance`, or None where that did not succeed.

        Args:
            problem: of the shape of this desk, equalities alone. secondary: (n,) or None. backend: solves the QPs.
        """
        if secondary is not None or self._moved:
            self._start[:] = 0.0 if secondary is None else secondary
            self._moved = secondary is not None
        self._tolerance[0] = tolerance
        address = problem.address
        go_on, numbers, counts, gradients = self._go_on, self._numbers, self._counts, self._gradients
        iterations = 0
        r = go_on(address, numbers, counts, NOTHING)
        while r > 0:
            w, count = backend.unconstrained(gradients[r])
            iterations += count
            if not len(w):
                return None, iterations
            r = go_on(address, numbers, counts, w)
        return (self._x.copy() if r == 0 else None), iterations
