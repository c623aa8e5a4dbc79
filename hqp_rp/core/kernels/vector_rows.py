"""Vector instructions that copy, scale and measure rows of padded matrices, beside those of `vector`."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types

from hqp_rp.core.kernels.vector import (
    _CHUNK,
    _DOUBLE,
    _INT,
    WIDTH,
    _all,
    _emitted,
    _further_chunks,
    _integer,
    _Row,
    _spread,
    _sum_of_products,
)


@_emitted
def copy_row(_: Any, W: Any, i: Any, V: Any, t: Any) -> Any:
    """copy_row(W, i, V, t): row i of W <- row t of V, as long."""
    signature = types.void(W, types.int64, V, types.int64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        array, first, other, second = given
        row = _Row(context, builder, sig.args[0], array, first, _integer(0))
        copied = _Row(context, builder, sig.args[2], other, second, _integer(0))
        row.store(copied.load(_integer(0)), _integer(0))
        _further_chunks(builder, row, lambda chunk: row.store(copied.load(chunk), chunk))
        return context.get_dummy_value()

    return signature, codegen


@_emitted
def scale_row(_: Any, W: Any, i: Any, factor: Any) -> Any:
    """scale_row(W, i, factor): row i is multiplied; returns its sum of squares."""
    signature = types.float64(W, types.int64, types.float64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        array, which, scale = given
        row = _Row(context, builder, sig.args[0], array, which, _integer(0))
        factors = _spread(builder, scale)

        def scaled(chunk: Any) -> list[tuple[Any, Any]]:
            entries = builder.fmul(row.load(chunk), factors)
            row.store(entries, chunk)
            return [(entries, entries)]

        return _sum_of_products(builder, scaled(_integer(0)), row, scaled)[0]

    return signature, codegen


@_emitted
def largest_of_rows(_: Any, W: Any, i0: Any, i1: Any) -> Any:
    """largest_of_rows(W, i0, i1): the largest magnitude in rows i0:i1, inf where an entry is not finite; 0 without rows."""
    signature = types.float64(W, types.int64, types.int64)

    def codegen(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        array, first, end = given
        row = _Row(context, builder, sig.args[0], array, first, _integer(0))
        infinite = _all(float("inf"))
        most = cgutils.alloca_once_value(builder, _all(0.0))
        chunks = builder.mul(builder.sub(end, first), builder.lshr(row.columns, _integer(3)))
        with cgutils.for_range(builder, chunks) as loop:
            entries, so_far = row.load(loop.index), builder.load(most)
            sizes = builder.select(builder.fcmp_ordered("<", entries, _all(0.0)), builder.fneg(entries), entries)
            sizes = builder.select(builder.fcmp_ordered("<", sizes, infinite), sizes, infinite)
            builder.store(builder.select(builder.fcmp_ordered(">", sizes, so_far), sizes, so_far), most)
        kind = ir.FunctionType(_DOUBLE, [_CHUNK])
        reduce = cgutils.get_or_insert_function(builder.module, kind, f"llvm.vector.reduce.fmax.v{WIDTH}f64")
        return builder.call(reduce, [builder.load(most)], fastmath=("nnan",))

    return signature, codegen


@_emitted
def inverse_power(_: Any, big: Any) -> Any:
    """inverse_power(big): 2^-e of big = m 2^e, 0.5 <= m < 1, for normal numbers; never beyond 2^1000 or 2^-1000."""

    def codegen(_: Any, builder: Any, sig: Any, given: Any) -> Any:
        exponent = builder.and_(builder.lshr(builder.bitcast(given[0], _INT), _integer(52)), _integer(2047))
        inverse = builder.sub(_integer(2045), exponent)  # each is biased by 1023, and m is not in [1, 2)
        low, high = _integer(23), _integer(2023)
        inverse = builder.select(builder.icmp_signed("<", inverse, low), low, inverse)
        inverse = builder.select(builder.icmp_signed(">", inverse, high), high, inverse)
        return builder.bitcast(builder.shl(inverse, _integer(52)), _DOUBLE)

    return types.float64(types.float64), codegen
