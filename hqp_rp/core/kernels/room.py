"""Where kernels work: arrays at an address, room on the stack, and matrices carved from a block without a call.

numba's `reshape` calls a function of its runtime, and `np.empty` one that allocates; on seven unknowns either costs as much as
a reflection. Nothing here is checked, and nothing is kept alive.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, cast

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic
from numba.np import arrayobj

from hqp_rp.core.kernels.compile import Compiled, inlined

STACK_NUMBERS = 384 if sys.platform == "win32" else 8192
FEW_NUMBERS = 64
"""Numbers of working room that a kernel takes from the stack; Windows wants a check where a frame passes 4 KiB."""


def _emitted(function: Callable[..., Any]) -> Compiled:
    return cast(Compiled, intrinsic(function))


def _array(context: Any, builder: Any, kind: Any, data: Any, shape: list[Any]) -> Any:
    """A C-contiguous array of 8-byte entries that owns nothing."""
    array = arrayobj.make_array(kind)(context, builder)
    eight = ir.Constant(ir.IntType(64), 8)
    strides = [eight] if len(shape) == 1 else [builder.mul(shape[1], eight), eight]
    pointer = builder.bitcast(data, array.data.type)
    arrayobj.populate_array(array, data=pointer, shape=shape, strides=strides, itemsize=eight, meminfo=None)
    return array._getvalue()


def _at_address(dtype: Any, ndim: int) -> Compiled:
    kind = types.Array(dtype, ndim, "C")

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        data = builder.inttoptr(given[0], ir.IntType(8).as_pointer())
        return _array(context, builder, kind, data, list(given[1:]))

    if ndim == 1:

        @_emitted
        def vector(_: Any, address: Any, count: Any) -> Any:
            return kind(types.int64, types.int64), codegen

        return vector

    @_emitted
    def matrix(_: Any, address: Any, rows: Any, columns: Any) -> Any:
        return kind(types.int64, types.int64, types.int64), codegen

    return matrix


numbers_at = _at_address(types.float64, 1)
"""numbers_at(address, count): the float64 vector that lies there."""

counts_at = _at_address(types.int64, 1)
"""counts_at(address, count): the int64 vector that lies there."""

matrix_at = _at_address(types.float64, 2)
"""matrix_at(address, rows, columns): the float64 matrix that lies there."""


def _on_the_stack(count: int) -> Compiled:
    kind = types.Array(types.float64, 1, "C")

    @_emitted
    def numbers(_: Any) -> Any:
        def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
            data = cgutils.alloca_once(builder, ir.DoubleType(), size=ir.Constant(ir.IntType(32), count))
            return _array(context, builder, kind, data, [ir.Constant(ir.IntType(64), count)])

        return kind(), codegen

    return numbers


stack_numbers = _on_the_stack(STACK_NUMBERS)
"""stack_numbers(): `STACK_NUMBERS` float64 on the stack of the calling kernel, not initialized."""

few_numbers = _on_the_stack(FEW_NUMBERS)
"""few_numbers(): the same for `FEW_NUMBERS`."""


@inlined
def matrix_in(room, start, rows, columns):
    """room[start : start + rows * columns] as a matrix (rows, columns); room is contiguous float64."""
    return matrix_at(room.ctypes.data + 8 * start, rows, columns)


@inlined
def counts_in(room, start, count):
    """room[start : start + count] as int64."""
    return counts_at(room.ctypes.data + 8 * start, count)
