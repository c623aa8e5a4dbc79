"""How a problem reaches a kernel by one number: the address of a block that tells where its arrays lie.

A call of compiled code pays for each array that it is given about as much as for a level of a small problem. Whoever keeps
arrays for many calls describes them once, keeps block and arrays alive, and hands over the block's address.

The block (`SIZE` int64) holds the addresses of matrix (M, n), lower (M,), upper (M,), offsets (p + 1,), then M, n and p, then
the addresses of the hard rows' matrix (h, n), lower (h,) and upper (h,), and h.
"""

from __future__ import annotations

from numba.core import types

from hqp_rp.core.kernels.compile import Compiled, entry, fixed, inlined, lean
from hqp_rp.core.kernels.room import counts_at, matrix_at, numbers_at

MATRIX, LOWER, UPPER, OFFSETS, ROWS, UNKNOWNS, LEVELS, HARD_MATRIX, HARD_LOWER, HARD_UPPER, HARD_ROWS = range(11)
SIZE = 11


@inlined
def sizes_of(problem):
    """(M, n, p) of the problem described at this address."""
    block = counts_at(problem, SIZE)
    return block[ROWS], block[UNKNOWNS], block[LEVELS]


@inlined
def equalities_of(problem):
    """(A (M, n), b (M,), offsets (p + 1,)) of the problem described at this address."""
    block = counts_at(problem, SIZE)
    A = matrix_at(block[MATRIX], block[ROWS], block[UNKNOWNS])
    b = numbers_at(block[LOWER], block[ROWS])
    return A, b, counts_at(block[OFFSETS], block[LEVELS] + 1)


@inlined
def upper_of(problem):
    """The upper bounds (M,) of the problem described at this address."""
    block = counts_at(problem, SIZE)
    return numbers_at(block[UPPER], block[ROWS])


@inlined
def hard_rows_of(problem):
    """(A (h, n), lower (h,), upper (h,)) of its hard rows."""
    block = counts_at(problem, SIZE)
    A = matrix_at(block[HARD_MATRIX], block[HARD_ROWS], block[UNKNOWNS])
    lower = numbers_at(block[HARD_LOWER], block[HARD_ROWS])
    return A, lower, numbers_at(block[HARD_UPPER], block[HARD_ROWS])


@lean
def _describe(matrix, lower, upper, offsets, block):
    M = matrix.shape[0]
    p = offsets.shape[0] - 1
    if lower.shape[0] != M or upper.shape[0] != M or p < 1 or offsets[0] != 0 or offsets[p] != M:
        return 0
    for k in range(p):
        if offsets[k] > offsets[k + 1]:
            return 0
    block[MATRIX] = matrix.ctypes.data
    block[LOWER] = lower.ctypes.data
    block[UPPER] = upper.ctypes.data
    block[OFFSETS] = offsets.ctypes.data
    block[ROWS] = matrix.shape[0]
    block[UNKNOWNS] = matrix.shape[1]
    block[LEVELS] = offsets.shape[0] - 1
    block[HARD_MATRIX] = 0
    block[HARD_LOWER] = 0
    block[HARD_UPPER] = 0
    block[HARD_ROWS] = 0
    return block.ctypes.data


@lean
def _describe_hard(matrix, lower, upper, block):
    if matrix.shape[1] != block[UNKNOWNS]:
        return False
    block[HARD_MATRIX] = matrix.ctypes.data
    block[HARD_LOWER] = lower.ctypes.data
    block[HARD_UPPER] = upper.ctypes.data
    block[HARD_ROWS] = matrix.shape[0]
    return True


@lean
def rows_at(matrix, lower, upper, block):
    """Say where rows are whose first `HARD_ROWS` are the hard ones; upper is empty where every row is an equality."""
    on_top = block[HARD_ROWS]
    block[HARD_MATRIX] = matrix.ctypes.data
    block[HARD_LOWER] = lower.ctypes.data
    block[HARD_UPPER] = upper.ctypes.data if len(upper) else lower.ctypes.data
    block[MATRIX] = block[HARD_MATRIX] + 8 * matrix.shape[1] * on_top
    block[LOWER] = block[HARD_LOWER] + 8 * on_top
    block[UPPER] = block[HARD_UPPER] + 8 * on_top


@lean
def _describe_on_top(matrix, lower, upper, offsets, block):
    block[OFFSETS] = offsets.ctypes.data
    block[ROWS] = offsets[offsets.shape[0] - 1]
    block[UNKNOWNS] = matrix.shape[1]
    block[LEVELS] = offsets.shape[0] - 1
    block[HARD_ROWS] = matrix.shape[0] - block[ROWS]
    rows_at(matrix, lower, upper, block)
    return block.ctypes.data


_ROWS, _BOUNDS, _COUNTS = types.float64[:, ::1], types.float64[::1], types.int64[::1]
_FROZEN_ROWS = types.Array(types.float64, 2, "C", readonly=True)
_FROZEN_BOUNDS = types.Array(types.float64, 1, "C", readonly=True)

describe = fixed(_describe, (_ROWS, _BOUNDS, _BOUNDS, _COUNTS, _COUNTS))
"""describe(matrix, lower, upper, offsets, block): fill the block for a problem without hard rows; returns its address, or 0
for arrays that do not fit together.

`TypeError` for arrays of other types or of another layout, or read-only."""

describe_on_top = fixed(_describe_on_top, (_ROWS, _BOUNDS, _BOUNDS, _COUNTS, _COUNTS))
"""describe_on_top(matrix, lower, upper, offsets, block): the same where hard rows stand above the levels' rows."""

describe_hard = fixed(_describe_hard, (_FROZEN_ROWS, _FROZEN_BOUNDS, _FROZEN_BOUNDS, _COUNTS))
"""describe_hard(matrix, lower, upper, block): add hard rows, which are read-only; whether they have as many columns."""


def closed_form_entry(kernel: Compiled) -> Compiled:
    """The machine code of a closed form's kernel (problem's address, settings' address, x (n,))."""
    return entry(kernel, (types.int64, types.int64, types.float64[::1]))
