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


def stack_block(words: int) -> Compiled:
    """block(): so many integers on the caller's stack, for as long as the caller runs: an allocation costs 100 ns."""

    def block(_: Any) -> tuple[Any, Callable[..., Any]]:
        def codegen(context: Any, builder: Any, sig: Any, _: Any) -> Any:
            word = ir.IntType(64)
            with builder.goto_entry_block():
                data = builder.alloca(ir.ArrayType(word, words))
            array = context.make_array(sig.return_type)(context, builder)
            context.populate_array(
                array, data=builder.bitcast(data, word.as_pointer()), shape=[ir.Constant(word, words)],
                strides=[ir.Constant(word, 8)], itemsize=ir.Constant(word, 8), meminfo=None,
            )  # fmt: skip
            return array._getvalue()

        return COUNT(), codegen

    return cast(Compiled, intrinsic(block))


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
                    array = context.make_array(field)(context, builder)
                    width = ir.Constant(word, context.get_abi_sizeof(context.get_data_type(field.dtype)))
                    shape = [entry(ENTRIES * number + 1 + i) for i in range(field.ndim)]
                    count = ir.Constant(word, 1)
                    strides: list[Any] = []
                    for length in reversed(shape):
                        strides.insert(0, builder.mul(count, width))
                        count = builder.mul(count, length)
                    data = builder.inttoptr(entry(ENTRIES * number), array.data.type)
                    context.populate_array(array, data=data, shape=shape, strides=strides, itemsize=width, meminfo=None)
                    arrays.append(array._getvalue())
                    number += 1
                tuples.append(context.make_tuple(builder, kind, arrays))
            return context.make_tuple(builder, given, tuples)

        return given(types.int64), codegen

    return cast(Compiled, intrinsic(at))
