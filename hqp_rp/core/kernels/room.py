"""Where kernels work: arrays at an address, room on the stack, and views of a block that cost no call.

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

from hqp_rp.core.kernels.compile import Compiled

STACK_NUMBERS = 384 if sys.platform == "win32" else 8192
FEW_NUMBERS = 64
"""Numbers of working room that a kernel takes from the stack; Windows wants a check where a frame passes 4 KiB."""


def _emitted(function: Callable[..., Any]) -> Compiled:
    return cast(Compiled, intrinsic(function))


def borrowed(context: Any, builder: Any, kind: Any, data: Any, shape: list[Any]) -> Any:
    """A C-contiguous array of 8-byte entries that owns nothing."""
    array = arrayobj.make_array(kind)(context, builder)
    eight = ir.Constant(ir.IntType(64), 8)
    strides = [eight]
    for length in shape[:0:-1]:
        strides.insert(0, builder.mul(strides[0], length))
    pointer = builder.bitcast(data, array.data.type)
    arrayobj.populate_array(array, data=pointer, shape=shape, strides=strides, itemsize=eight, meminfo=None)
    return array._getvalue()


def _at_address(dtype: Any, ndim: int) -> Compiled:
    kind = types.Array(dtype, ndim, "C")

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        data = builder.inttoptr(given[0], ir.IntType(8).as_pointer())
        return borrowed(context, builder, kind, data, list(given[1:]))

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


def on_the_stack(count: int, dtype: Any = types.float64) -> Compiled:
    """numbers(): so many 8-byte numbers on the stack of the calling kernel, not initialized."""
    kind = types.Array(dtype, 1, "C")

    @_emitted
    def numbers(_: Any) -> Any:
        def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
            data = cgutils.alloca_once(builder, ir.DoubleType(), size=ir.Constant(ir.IntType(32), count))
            return borrowed(context, builder, kind, data, [ir.Constant(ir.IntType(64), count)])

        return kind(), codegen

    return numbers


stack_numbers = on_the_stack(STACK_NUMBERS)
"""stack_numbers(): `STACK_NUMBERS` float64 on the stack of the calling kernel, not initialized."""

few_numbers = on_the_stack(FEW_NUMBERS)
"""few_numbers(): the same for `FEW_NUMBERS`."""


@_emitted
def number_at(_: Any, address: Any) -> Any:
    """number_at(address): the float64 that lies there."""

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        return builder.load(builder.inttoptr(given[0], ir.DoubleType().as_pointer()), align=8)

    return types.float64(types.int64), codegen


def _view(context: Any, builder: Any, sig: Any, given: Any) -> Any:
    source = arrayobj.make_array(sig.args[0])(context, builder, given[0])
    return borrowed(context, builder, sig.return_type, source.data, list(given[1:]))


@_emitted
def as_matrix(_: Any, vector: Any, rows: Any, columns: Any) -> Any:
    """as_matrix(vector, rows, columns): the first entries of a vector of 8-byte numbers, row after row."""
    return types.Array(vector.dtype, 2, "C")(vector, types.int64, types.int64), _view


@_emitted
def as_stack(_: Any, vector: Any, pages: Any, rows: Any, columns: Any) -> Any:
    """as_stack(vector, pages, rows, columns): the first entries of a vector of 8-byte numbers, page after page."""
    return types.Array(vector.dtype, 3, "C")(vector, types.int64, types.int64, types.int64), _view


@_emitted
def as_counts(_: Any, vector: Any, count: Any) -> Any:
    """as_counts(vector, count): the first entries of a vector as int64."""
    return types.Array(types.int64, 1, "C")(vector, types.int64), _view


@_emitted
def as_vector(_: Any, matrix: Any) -> Any:
    """as_vector(matrix): all entries of a C-contiguous matrix; one loop over them vectorizes, two do not."""

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        shape = arrayobj.make_array(sig.args[0])(context, builder, given[0]).shape
        size = builder.mul(builder.extract_value(shape, 0), builder.extract_value(shape, 1))
        return _view(context, builder, sig, (given[0], size))

    return types.Array(matrix.dtype, 1, "C")(matrix), codegen
