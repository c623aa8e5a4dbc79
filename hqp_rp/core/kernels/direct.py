"""How a problem reaches a kernel by one number: the address of a block that tells where its arrays lie.

A call of compiled code pays for each array that it is given about as much as for a level of a small problem. Whoever keeps
arrays for many calls describes them once, keeps block and arrays alive, and hands over the block's address.

The block (`SIZE` int64) holds the addresses of matrix (M, n), lower (M,), upper (M,), offsets (p + 1,), then M, n and p, then
the addresses of the hard rows' matrix (h, n), lower (h,) and upper (h,), and h.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, cast

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from hqp_rp.core.kernels.compile import Compiled, entry, fixed, inlined, lean

MATRIX, LOWER, UPPER, OFFSETS, ROWS, UNKNOWNS, LEVELS, HARD_MATRIX, HARD_LOWER, HARD_UPPER, HARD_ROWS = range(11)
SIZE = 11

STACK_NUMBERS = 480 if sys.platform == "win32" else 8192
"""Numbers of working room that a kernel takes from the stack; Windows wants a check where a frame passes 4 KiB."""


def _emitted(function: Callable[..., Any]) -> Compiled:
    return cast(Compiled, intrinsic(function))


@_emitted
def numbers_at(_: Any, address: Any) -> Any:
    """numbers_at(address): a pointer to float64."""
    pointer = types.CPointer(types.float64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        return builder.inttoptr(given[0], context.get_value_type(pointer))

    return pointer(types.int64), codegen


@_emitted
def counts_at(_: Any, address: Any) -> Any:
    """counts_at(address): a pointer to int64."""
    pointer = types.CPointer(types.int64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        return builder.inttoptr(given[0], context.get_value_type(pointer))

    return pointer(types.int64), codegen


@_emitted
def stack_numbers(_: Any) -> Any:
    """stack_numbers(): a pointer to `STACK_NUMBERS` float64 on the stack of the calling kernel, not initialized."""
    pointer = types.CPointer(types.float64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        block = cgutils.alloca_once(builder, ir.DoubleType(), size=ir.Constant(ir.IntType(32), STACK_NUMBERS))
        return builder.bitcast(block, context.get_value_type(pointer))

    return pointer(), codegen


@inlined
def sizes_of(problem):
    """(M, n, p) of the problem described at this address."""
    block = carray(counts_at(problem), (SIZE,))
    return block[ROWS], block[UNKNOWNS], block[LEVELS]


@inlined
def equalities_of(problem):
    """(A (M, n), b (M,), offsets (p + 1,)) of the problem described at this address."""
    block = carray(counts_at(problem), (SIZE,))
    A = carray(numbers_at(block[MATRIX]), (block[ROWS], block[UNKNOWNS]))
    b = carray(numbers_at(block[LOWER]), (block[ROWS],))
    return A, b, carray(counts_at(block[OFFSETS]), (block[LEVELS] + 1,))


@lean
def _describe(matrix, lower, upper, offsets, block):
    block[MATRIX] = matrix.ctypes.data
    block[LOWER] = lower.ctypes.data
    block[UPPER] = upper.ctypes.data
    block[OFFSETS] = offsets.ctypes.data
    block[ROWS] = matrix.shape[0]
    block[UNKNOWNS] = matrix.shape[1]
    block[LEVELS] = offsets.shape[0] - 1
    block[HARD_ROWS] = 0
    return block.ctypes.data


@lean
def _describe_hard(matrix, lower, upper, block):
    block[HARD_MATRIX] = matrix.ctypes.data
    block[HARD_LOWER] = lower.ctypes.data
    block[HARD_UPPER] = upper.ctypes.data
    block[HARD_ROWS] = matrix.shape[0]


_ROWS, _BOUNDS, _COUNTS = types.float64[:, ::1], types.float64[::1], types.int64[::1]
_FROZEN_ROWS = types.Array(types.float64, 2, "C", readonly=True)
_FROZEN_BOUNDS = types.Array(types.float64, 1, "C", readonly=True)

describe = fixed(_describe, (_ROWS, _BOUNDS, _BOUNDS, _COUNTS, _COUNTS))
"""describe(matrix, lower, upper, offsets, block): fill the block for a problem without hard rows; returns its address.

`TypeError` for arrays of other types or of another layout, or read-only."""

describe_hard = fixed(_describe_hard, (_FROZEN_ROWS, _FROZEN_BOUNDS, _FROZEN_BOUNDS, _COUNTS))
"""describe_hard(matrix, lower, upper, block): add hard rows, which are read-only."""


def closed_form_entry(kernel: Compiled) -> Compiled:
    """The machine code of a closed form's kernel (problem's address, settings' address, x (n,))."""
    return entry(kernel, (types.int64, types.int64, types.float64[::1]))
