"""The active set for a described problem: its hard rows and levels stacked, then the search."""

from __future__ import annotations

import functools

import numpy as np
from numba.core import types

from hqp_rp.core.kernels.active_set import hierarchical_active_set
from hqp_rp.core.kernels.compile import Compiled, entry, kernel, lean
from hqp_rp.core.kernels.direct import HARD_ROWS, SIZE, equalities_of, hard_rows_of, sizes_of, upper_of
from hqp_rp.core.kernels.room import (
    STACK_NUMBERS,
    as_counts,
    as_matrix,
    counts_at,
    matrix_at,
    numbers_at,
    stack_numbers,
)


@lean
def active_set_of(problem, z, tol, limit, go_on, x, side):
    """`hierarchical_active_set` for the problem described at this address; 8 iterations + code."""
    M, n, p = sizes_of(problem)
    if p + 2 + (counts_at(problem, SIZE)[HARD_ROWS] + M) * (n + 2) > STACK_NUMBERS:
        return active_set_on_the_heap(problem, z, tol, limit, go_on, x, side)
    return active_set_at(stack_numbers(), problem, z, tol, limit, go_on, x, side)


@kernel
def active_set_on_the_heap(problem, z, tol, limit, go_on, x, side):
    """The same where the stack has not the room."""
    M, n, p = sizes_of(problem)
    room = np.empty(p + 2 + (counts_at(problem, SIZE)[HARD_ROWS] + M) * (n + 2))
    return active_set_at(room, problem, z, tol, limit, go_on, x, side)


@lean
def active_set_at(room, problem, z, tol, limit, go_on, x, side):
    """The same in a given room."""
    M, n, p = sizes_of(problem)
    A, lower, offsets = equalities_of(problem)
    upper = upper_of(problem)
    hard, hard_lower, hard_upper = hard_rows_of(problem)
    h = hard.shape[0]
    above = hard.ctypes.data + 8 * h * n == A.ctypes.data and hard_lower.ctypes.data + 8 * h == lower.ctypes.data
    apart = h > 0 and not (above and hard_upper.ctypes.data + 8 * h == upper.ctypes.data)
    starts = as_counts(room, p + 2)
    starts[0] = 0
    for k in range(p + 1):
        starts[k + 1] = h + offsets[k]
    rows = matrix_at(hard.ctypes.data if h else A.ctypes.data, h + M, n)
    low = numbers_at(hard_lower.ctypes.data if h else lower.ctypes.data, h + M)
    high = numbers_at(hard_upper.ctypes.data if h else upper.ctypes.data, h + M)
    if apart:
        end = p + 2 + (h + M) * n
        rows = as_matrix(room[p + 2 :], h + M, n)
        low = room[end : end + h + M]
        high = room[end + h + M : end + 2 * (h + M)]
        for i in range(h):
            for j in range(n):
                rows[i, j] = hard[i, j]
            low[i] = hard_lower[i]
            high[i] = hard_upper[i]
        for i in range(M):
            for j in range(n):
                rows[h + i, j] = A[i, j]
            low[h + i] = lower[i]
            high[h + i] = upper[i]
    code, iterations = hierarchical_active_set(rows, low, high, starts, h, z, tol, limit, go_on, x, side)
    return 8 * iterations + code


@functools.cache
def active_set_entry() -> Compiled:
    """The machine code of `active_set_of`."""
    numbers, counts = types.float64[::1], types.int64[::1]
    return entry(active_set_of, (types.int64, numbers, types.float64, types.int64, types.boolean, numbers, counts))
