"""The active set for a described problem: its hard rows and levels stacked, then the search."""

from __future__ import annotations

import functools

import numpy as np
from numba.core import types

from hqp_rp.core.kernels.active_set import hierarchical_active_set
from hqp_rp.core.kernels.compile import Compiled, entry, kernel
from hqp_rp.core.kernels.direct import equalities_of, hard_rows_of, sizes_of, upper_of
from hqp_rp.core.kernels.room import STACK_NUMBERS, counts_in, matrix_in, stack_numbers


@kernel
def active_set_of(problem, z, tol, limit, go_on, x, side):
    """`hierarchical_active_set` for the problem described at this address; 8 iterations + code."""
    M, n, p = sizes_of(problem)
    A, lower, offsets = equalities_of(problem)
    upper = upper_of(problem)
    hard, hard_lower, hard_upper = hard_rows_of(problem)
    h = hard.shape[0]
    size = p + 2
    if h:
        size += (h + M) * (n + 2)
    room = stack_numbers()
    if size > STACK_NUMBERS:
        room = np.empty(size)
    starts = counts_in(room, 0, p + 2)
    starts[0] = 0
    for k in range(p + 1):
        starts[k + 1] = h + offsets[k]
    if h:
        end = p + 2 + (h + M) * n
        rows = matrix_in(room, p + 2, h + M, n)
        bounds = matrix_in(room, end, 2, h + M)
        for i in range(h):
            for j in range(n):
                rows[i, j] = hard[i, j]
            bounds[0, i] = hard_lower[i]
            bounds[1, i] = hard_upper[i]
        for i in range(M):
            for j in range(n):
                rows[h + i, j] = A[i, j]
            bounds[0, h + i] = lower[i]
            bounds[1, h + i] = upper[i]
        A = rows
        lower = bounds[0]
        upper = bounds[1]
    code, iterations = hierarchical_active_set(A, lower, upper, starts, h, z, tol, limit, go_on, x, side)
    return 8 * iterations + code


@functools.cache
def active_set_entry() -> Compiled:
    """The machine code of `active_set_of`."""
    numbers, counts = types.float64[::1], types.int64[::1]
    return entry(active_set_of, (types.int64, numbers, types.float64, types.int64, types.boolean, numbers, counts))
