"""Views of memory: a vector as a matrix, and a number at an address.

numba's own `reshape` checks and calls out at each use, which at these sizes costs more than what is done with the result.
For `lean` functions only: no reference is counted. Nothing is checked.
"""

from __future__ import annotations

import ctypes
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba.core import config, types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

from hqp_rp.core.kernels.compile import Compiled

WITHOUT_COMPILER = bool(cast(Any, config).DISABLE_JIT)
"""Kernels run as plain Python, which has no intrinsics."""


def _real_at(typing_context: Any, address: Any) -> Any:
    """The float64 at an address."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(builder.inttoptr(arguments[0], ir.DoubleType().as_pointer()), align=8)

    return types.float64(types.int64), emit


def _emit_view(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    kind = signature.return_type
    source = make_array(signature.args[0])(context, builder, arguments[0])
    view = make_array(kind)(context, builder)
    shape = arguments[1:]
    step = context.get_constant(types.intp, 8)
    strides = [step]
    for size in shape[:0:-1]:
        strides.insert(0, builder.mul(strides[0], size))
    populate_array(view, data=source.data, shape=shape, strides=strides, itemsize=step, meminfo=source.meminfo)
    return view._getvalue()


def _as_matrix(typing_context: Any, vector: Any, m: Any, n: Any) -> Any:
    """(m, n) view of the first entries of a vector of 8-byte numbers."""
    sizes = (types.intp, types.intp)
    return types.Array(vector.dtype, 2, "C")(vector, *sizes), _emit_view


def _as_stack(typing_context: Any, vector: Any, k: Any, m: Any, n: Any) -> Any:
    """(k, m, n) view of the first entries of a vector of 8-byte numbers."""
    sizes = (types.intp, types.intp, types.intp)
    return types.Array(vector.dtype, 3, "C")(vector, *sizes), _emit_view


def _as_vector(typing_context: Any, matrix: Any) -> Any:
    """All entries of a C-contiguous matrix of 8-byte numbers, row after row; one loop over them vectorizes, two do not."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        shape = make_array(signature.args[0])(context, builder, arguments[0]).shape
        size = builder.mul(builder.extract_value(shape, 0), builder.extract_value(shape, 1))
        return _emit_view(context, builder, signature, (arguments[0], size))

    return types.Array(matrix.dtype, 1, "C")(matrix), emit


def _real_at_in_python(address: int) -> float:
    return ctypes.c_double.from_address(int(address)).value


def _reshaped(vector: Any, *shape: int) -> Any:
    size = 1
    for length in shape:
        size *= length
    return vector[:size].reshape(shape)


def _either(function: Any, in_python: Any) -> Compiled:
    """numba's `intrinsic`, which a kernel calls without the typing context, or what does the same in Python."""
    return cast(Compiled, in_python if WITHOUT_COMPILER else intrinsic(function))


real_at = _either(_real_at, _real_at_in_python)
as_matrix = _either(_as_matrix, _reshaped)
as_stack = _either(_as_stack, _reshaped)
as_vector = _either(_as_vector, np.ravel)
