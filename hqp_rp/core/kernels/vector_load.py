"""Vector instructions that load what a user gave: rows of any length, their largest entry, powers of two by their bits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types

from hqp_rp.core.kernels.vector import _DOUBLE, _INT, _LANES, WIDTH, _all, _emitted, _integer, _Row

INFINITE_BITS = 0x7FF0000000000000
"""The bits of infinity: those of |x| are smaller where x is finite, and greater for nan."""


@_emitted
def float_of(_: Any, bits: Any) -> Any:
    """float_of(bits): the number with these bits."""

    def codegen(_: Any, builder: Any, sig: Any, given: Any) -> Any:
        return builder.bitcast(given[0], _DOUBLE)

    return types.float64(types.int64), codegen


def _pieces(builder: Any, count: Any, piece: Callable[[Any, int], None]) -> None:
    """piece(start, width) for the numbers 0 ... count - 1: whole chunks, then what is left by 4, 2 and 1."""
    chunks = builder.lshr(count, _integer(3))
    with cgutils.for_range(builder, chunks) as loop:
        piece(builder.mul(loop.index, _integer(WIDTH)), WIDTH)
    start = builder.mul(chunks, _integer(WIDTH))
    for width in (4, 2, 1):
        with builder.if_then(builder.icmp_signed("!=", builder.and_(count, _integer(width)), _integer(0))):
            piece(start, width)
        start = builder.add(start, builder.and_(count, _integer(width)))


def _at(builder: Any, address: Any, start: Any, kind: Any) -> Any:
    moved = builder.add(address, builder.mul(start, _integer(8)))
    return builder.inttoptr(moved, kind.as_pointer())


@_emitted
def copy_scaled_row(_: Any, W: Any, i: Any, A: Any, k: Any, factor: Any) -> Any:
    """copy_scaled_row(W, i, A, k, factor): row i of padded W <- factor * row k of A, zeros behind it."""
    signature = types.void(W, types.int64, A, types.int64, types.float64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        into, first, source, second, scale = given
        row = _Row(context, builder, sig.args[0], into, first, _integer(0))
        other = _Row(context, builder, sig.args[2], source, second, _integer(0))
        row.store(_all(0.0), builder.sub(builder.lshr(row.columns, _integer(3)), _integer(1)))

        def piece(start: Any, width: int) -> None:
            kind = ir.VectorType(_DOUBLE, width)
            factors = builder.insert_element(ir.Constant(kind, ir.Undefined), scale, ir.Constant(ir.IntType(32), 0))
            zeros = ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width)
            factors = builder.shuffle_vector(factors, ir.Constant(kind, ir.Undefined), zeros)
            entries = builder.load(_at(builder, other.address, start, kind), align=8)
            builder.store(builder.fmul(entries, factors), _at(builder, row.address, start, kind), align=8)

        _pieces(builder, other.columns, piece)
        return context.get_dummy_value()

    return signature, codegen


@_emitted
def largest_bits(_: Any, A: Any, r0: Any, r1: Any) -> Any:
    """largest_bits(A, r0, r1): the bits of the largest |entry| of rows r0:r1, which lie one behind the other."""
    signature = types.int64(A, types.int64, types.int64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        array, first, end = given
        row = _Row(context, builder, sig.args[0], array, first, _integer(0))
        found = cgutils.alloca_once_value(builder, _integer(0))
        wide = cgutils.alloca_once_value(builder, ir.Constant(_LANES, [0] * WIDTH))

        def largest(old: Any, new: Any) -> Any:
            return builder.select(builder.icmp_signed(">", new, old), new, old)

        def piece(start: Any, width: int) -> None:
            kind = ir.VectorType(_INT, width)
            mask = ir.Constant(kind, [0x7FFFFFFFFFFFFFFF] * width)
            bits = builder.and_(builder.load(_at(builder, row.address, start, kind), align=8), mask)
            if width == WIDTH:
                builder.store(largest(builder.load(wide), bits), wide)
                return
            for lane in range(width):
                one = builder.extract_element(bits, ir.Constant(ir.IntType(32), lane))
                builder.store(largest(builder.load(found), one), found)

        _pieces(builder, builder.mul(builder.sub(end, first), row.columns), piece)
        kind = ir.FunctionType(_INT, [_LANES])
        reduce = cgutils.get_or_insert_function(builder.module, kind, f"llvm.vector.reduce.smax.v{WIDTH}i64")
        return largest(builder.load(found), builder.call(reduce, [builder.load(wide)]))

    return signature, codegen
