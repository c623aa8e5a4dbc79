"""Arrays handed from kernel to kernel by one address.

numba passes an array as seven numbers or more. A search that hands fifteen arrays from function to function moves more bytes
for that than for its arithmetic on seven unknowns, and LLVM compiles signatures of a hundred parameters. Here a table of
integers says where the arrays are, and each function is given its address: `at` makes of it named tuples of arrays, of
which LLVM loads only what the function uses.

The arrays are borrowed: whoever owns the memory keeps it alive while they are used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from hqp_rp.core.kernels.compile import Compiled, lean
from hqp_rp.core.kernels.room import borrowed

MATRIX = types.Array(types.float64, 2, "C")
COUNTS = types.Array(types.int64, 2, "C")
COUNT = types.Array(types.int64, 1, "C")
PAGES = types.Array(types.float64, 3, "C")

ENTRIES = 4
"""Integers of the table for each array: where its data begin, then its shape."""


@lean
def enter(table, number, address, i, j, k):
    """Say where array `number` is: the address of its data, its shape (of fewer dimensions: the first of i, j, k)."""
    table[ENTRIES * number] = address
    table[ENTRIES * number + 1] = i
    table[ENTRIES * number + 2] = j
    table[ENTRIES * number + 3] = k


def arrays_at(*kinds: tuple[type, tuple[Any, ...]]) -> Compiled:
    """at(address): a tuple of named tuples, of the arrays in the table there; kinds: (named tuple, types of its fields)."""
    given = types.Tuple([types.NamedTuple(fields, kind) for kind, fields in kinds])

    def at(_: Any, address: Any) -> tuple[Any, Callable[..., Any]]:
        def codegen(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
            word = ir.IntType(64)
            table = builder.inttoptr(arguments[0], word.as_pointer())

            def entry(i: int) -> Any:
                return builder.load(builder.gep(table, [ir.Constant(word, i)]))

            number = 0
            tuples = []
            for kind in given:
                arrays = []
                for field in kind:
                    shape = [entry(ENTRIES * number + 1 + i) for i in range(field.ndim)]
                    data = builder.inttoptr(entry(ENTRIES * number), word.as_pointer())
                    arrays.append(borrowed(context, builder, field, data, shape))
                    number += 1
                tuples.append(context.make_tuple(builder, kind, arrays))
            return context.make_tuple(builder, given, tuples)

        return given(types.int64), codegen

    return cast(Compiled, intrinsic(at))
